//! What must hold when a life has ended: its recording, its replay, its pose.

use super::life::Remains;
use super::plan::{Happening, Plan};
use super::watch::Watch;
use super::world::World;
use crate::faulty_disk::{IoMode, record};
use slamd::session_file;
use slamd::source::replay;
use slamd::source::session::Session;
use slamd_capture::{CaptureReader, FLUSH_PERIOD, Record};
use slamd_core::{Config, Event, Pose2, Start, Timestamp};
use slamd_metrics::AccuracyMeter;
use std::path::Path;
use std::time::Duration;

/// Poses farther off than this in an undisturbed drive are counted. `tests/accuracy` and docs/accuracy.md judge the estimator.
const MAX_OFF_M: f64 = 0.5;

/// Judges a life; `start` is what it began with.
pub fn judge(world: &mut World, plan: &Plan, start: Start, remains: Remains, folder: &Path) {
    let given: Vec<Record> = remains.chunks.iter().map(record).collect();
    let is_whole = recording(&remains, plan, &given);
    world.met.chunks += given.len() as u64;
    world.met.chunks_lost += remains.losses.as_ref().map_or(0, |losses| losses.chunks);
    restarts(world, &remains);
    let again = replayed(if is_whole { read(&remains, plan) } else { given }, start, &remains, folder);
    same(&remains.session, &again);
    let counters = remains.session.pipeline().counters();
    world.met.sweeps += counters.sweeps;
    world.met.accepted += counters.frames;
    world.met.rejected += counters.crc_errors + counters.malformed;
    if plan.is_clean {
        // A fired group is numbered at its trigger and sent when its slot is over: the last one is still missing.
        let lost = counters.lost_frames.saturating_sub(1);
        assert_eq!((counters.crc_errors, counters.malformed, lost), (0, 0, 0), "{counters:?}");
    }
    accuracy(world, plan, &remains);
}

/// What the disk holds.
fn read(remains: &Remains, plan: &Plan) -> Vec<Record> {
    let mut records = Vec::new();
    let is_cut = remains.losses.as_ref().is_none_or(|losses| losses.unfinished.is_some());
    for file in remains.disk.0.borrow().files.values() {
        // Of a torn file perhaps not even the beginning is left.
        let Ok(mut reader) = CaptureReader::begin(file.as_slice(), Path::new("memory.mcap")) else { continue };
        assert!(is_cut || !remains.was_well || reader.info().unix_zero_us == plan.wall_us, "the wall clock's time");
        records.extend(reader.by_ref().map_while(Result::ok));
        assert!(is_cut || !remains.was_well || reader.damage().is_none(), "{:?}", reader.damage());
    }
    records
}

/// The recording holds what was given to it, in order; missing chunks were reported. True if none is missing.
fn recording(remains: &Remains, plan: &Plan, given: &[Record]) -> bool {
    let held = read(remains, plan);
    let mut rest = given.iter();
    let is_in_order = held.iter().all(|held| rest.by_ref().any(|given| given == held));
    assert!(is_in_order, "the recording holds what was not given to it in this order");
    let missing = (given.len() - held.len()) as u64;
    match &remains.losses {
        Some(losses) if losses.unfinished.is_none() => {
            let most = if has_disk_trouble(plan) { missing + most_at_once(given) } else { missing };
            assert!((missing..=most).contains(&losses.chunks), "{missing} chunks are missing, told {losses:?}");
        }
        Some(losses) => assert!(missing <= losses.chunks, "{missing} chunks are missing, told {losses:?}"),
        None if remains.was_well && !remains.is_torn => {
            // A kill costs what was not yet flushed.
            assert!(held == given[..held.len()], "a killed program's recording has a gap");
            let end = given.last().map(Record::at).unwrap_or_default();
            let lost = given.get(held.len()).map(Record::at);
            assert!(lost.is_none_or(|lost| lost + 2 * FLUSH_PERIOD >= end), "{lost:?} is not there at {end:?}");
        }
        None => {}
    }
    missing == 0
}

/// The most that may be told as missing and is there: a file that was given up in the middle of a write may hold a capture chunk, but not
/// yet its index. Short reads make many of the session's chunks within its time.
fn most_at_once(given: &[Record]) -> u64 {
    let within = |first: &Record| given.partition_point(|record| record.at() < first.at() + 2 * FLUSH_PERIOD);
    given.iter().enumerate().map(|(index, first)| (within(first) - index) as u64).max().unwrap_or(0)
}

fn replayed(records: Vec<Record>, start: Start, remains: &Remains, folder: &Path) -> Session {
    let mut session =
        Session::new(slamd_paper::pipeline(&Config::default(), start).expect("sound"), folder).expect("sound");
    let (watch, watcher) = Watch::new();
    session.watch(watcher);
    for record in records {
        replay::step(&mut session, &record).expect("nothing is written");
    }
    session.run_until(remains.session.now());
    let (live, again) = (remains.watch.borrow(), watch.borrow());
    // As text: of numbers that are none, too, each must be the same.
    assert_eq!(format!("{:?}", live.events), format!("{:?}", again.events), "events live and replayed");
    session
}

fn has_disk_trouble(plan: &Plan) -> bool {
    plan.happenings.iter().any(|(_, happening)| matches!(happening, Happening::Disk(mode) if *mode != IoMode::Working))
}

/// Map, pose and all that is remembered are the same to the last bit.
fn same(live: &Session, again: &Session) {
    let bytes = |session: &Session| session.saved_state().map(|memory| session_file::encode(&memory));
    assert!(live.pipeline().raster() == again.pipeline().raster(), "the map is not that of what was received");
    assert!(bytes(live) == bytes(again), "the memory is not that of what was received");
    assert_eq!(live.pipeline().counters(), again.pipeline().counters(), "counted live and replayed");
}

/// Restarts are reported where the board restarted, and nowhere else.
fn restarts(world: &mut World, remains: &Remains) {
    let told = remains.watch.borrow().restarts;
    world.met.restarts_told += told;
    if world.met.resets == 0 && world.met.sleeps == 0 {
        assert_eq!(told, 0, "a restart was told, and the board has not restarted");
    }
}

fn accuracy(world: &mut World, plan: &Plan, remains: &Remains) {
    if world.met.deaths > 0 {
        return;
    }
    let mut meter = AccuracyMeter::default();
    let truths = world.truths.iter();
    let since_begin =
        |(host_us, pose): &(u64, Pose2)| Some((Timestamp::from_us(host_us.checked_sub(remains.begin_us)?), *pose));
    let mut truths = truths.filter_map(since_begin).peekable();
    for event in &remains.watch.borrow().events {
        let Event::Estimate(estimate) = event else { continue };
        while let Some((at, pose)) = truths.next_if(|(at, _)| *at <= estimate.at + Duration::from_millis(300)) {
            meter.truth(at, pose);
        }
        meter.estimate(estimate.at, estimate.pose);
    }
    let Some(accuracy) = meter.accuracy() else { return };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "millimetres in a building")]
    let off_mm = (accuracy.ate_max_m * 1e3) as u64;
    if plan.is_clean {
        world.met.worst_clean_mm = world.met.worst_clean_mm.max(off_mm);
        world.met.clean_and_off += u64::from(accuracy.ate_max_m > MAX_OFF_M);
    }
    world.met.worst_mm = world.met.worst_mm.max(off_mm);
}
