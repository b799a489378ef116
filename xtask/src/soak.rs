//! `cargo xtask soak`: does anything grow, drop or differ when the robot drives for long?
//!
//! Many hours of laps in the pipeline alone, twice side by side: the slope of its heap, and whether both know the same in the end. Then the
//! real program at a pseudo-terminal, 20 sweeps a second, recording, with both cores loaded: the slope of its memory over the last two
//! thirds, what it dropped, and whether the replay of its recording makes the same map.

use allocation_counter::measure;
use indicatif::ProgressBar;
use serde_json::Value;
use slamd_core::{Input, Pipeline};
use slamd_testkit::lattice::{Drive, Plan, drain};
use slamd_testkit::mock_port::Terminal;
use slamd_testkit::mock_port::daemon::Daemon;
use slamd_testkit::player::play;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Drive for long: does memory grow, is anything dropped, does the replay differ
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Minutes of the real program on a serial line; 0 for none
    #[arg(long, default_value_t = 60.0)]
    minutes: f64,
    /// Hours of laps in the pipeline alone; 0 for none
    #[arg(long, default_value_t = 72.0)]
    hours: f64,
}

const MAX_KIB_PER_HOUR: f64 = 10.0;
/// From so long a real run on its memory is judged.
const MIN_MINUTES: f64 = 30.0;
const SWEEPS_PER_HOUR: f64 = 36_000.0;
/// Looks at the memory in a drive.
const LOOKS: u32 = 60;
/// Samples in a look at the real program, of which the least counts: every 10 s it draws the map, which takes some 10 MB for a moment.
const SAMPLES: u32 = 60;
/// Until the building is explored, the map grows: this part of the looks is not used.
const EXPLORED: f64 = 1.0 / 3.0;

/// Least-squares slope of (hours, KiB) over the looks after the building is explored.
fn slope_kib_per_hour(looks: &[(f64, f64)]) -> f64 {
    let from_h = EXPLORED * looks.last().map_or(0.0, |look| look.0);
    let late: Vec<_> = looks.iter().filter(|look| look.0 >= from_h).collect();
    let mean = |of: fn(&(f64, f64)) -> f64| late.iter().map(|look| of(look)).sum::<f64>() / late.len() as f64;
    let (hours, kib) = (mean(|look| look.0), mean(|look| look.1));
    let of_both: f64 = late.iter().map(|look| (look.0 - hours) * (look.1 - kib)).sum();
    of_both / late.iter().map(|look| (look.0 - hours).powi(2)).sum::<f64>()
}

fn summary(folder: &Path) -> Value {
    let text = std::fs::read_to_string(folder.join("summary.json")).expect("a summary");
    serde_json::from_str(&text).expect("JSON")
}

/// The real program for so many minutes; what it says at the end, what the replay of its recording says, and the slope.
#[expect(clippy::disallowed_methods, reason = "a long run is timed")]
fn real(minutes: f64) -> (Value, Value, f64) {
    let folder = tempfile::tempdir().expect("a folder");
    let (capture, live, replayed) =
        (folder.path().join("soak.mcap"), folder.path().join("live"), folder.path().join("replayed"));
    let terminal = Terminal::open();
    let mut command = Command::new(slamd_testkit::program());
    command.arg("--port").arg(&terminal.path).arg("--record").arg(&capture).arg("--out").arg(&live);
    let (end, cores) = (AtomicBool::new(false), std::thread::available_parallelism().map_or(1, usize::from));
    let bar = ProgressBar::new(u64::from(LOOKS));
    let looks = std::thread::scope(|scope| {
        scope.spawn(|| play(terminal, 2, &end));
        for _ in 0..cores {
            scope.spawn(|| {
                // Both cores are always busy, and other work of the computer goes first.
                let _ = rustix::process::nice(19);
                while !end.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            });
        }
        let mut daemon = Daemon::run(command);
        daemon.expect("poses and map begin", Duration::from_secs(60));
        let begin = Instant::now();
        let look = |_| {
            let pause = Duration::from_secs_f64(60.0 * minutes / f64::from(LOOKS * SAMPLES));
            let samples = (0..SAMPLES).map(|_| {
                std::thread::sleep(pause);
                daemon.resident_kib()
            });
            let least_kib = samples.min().unwrap_or_default();
            bar.inc(1);
            (begin.elapsed().as_secs_f64() / 3600.0, least_kib as f64)
        };
        let looks: Vec<(f64, f64)> = (0..LOOKS).map(look).collect();
        daemon.end();
        end.store(true, Ordering::Relaxed);
        looks
    });
    bar.finish_and_clear();
    let mut command = Command::new(slamd_testkit::program());
    command.arg("replay").arg(&capture).arg("--out").arg(&replayed).stdout(Stdio::null()).stderr(Stdio::null());
    assert!(command.status().expect("slamd runs").success(), "the recording cannot be replayed");
    (summary(&live), summary(&replayed), slope_kib_per_hour(&looks))
}

/// Laps for so many hours: hours and heap, and the drive at its end.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "sweeps of a drive")]
fn laps(hours: f64, bar: &ProgressBar) -> (Vec<(f64, f64)>, Drive) {
    let mut drive = Drive::new(Plan { lines: 2, pitch_m: 7.5 }, hours);
    let (sweeps, mut poses, mut heap_bytes) = ((hours * SWEEPS_PER_HOUR / f64::from(LOOKS)) as u64, 0, 0);
    let mut handle = |pipeline: &mut Pipeline, input: Input<'_>| {
        pipeline.handle(input);
        drain(pipeline, &mut poses)
    };
    let looks = (1..=LOOKS).map(|look| {
        heap_bytes += measure(|| (0..sweeps).for_each(|_| drive.sweep(&mut handle))).bytes_current;
        bar.inc(1);
        (hours * f64::from(look) / f64::from(LOOKS), heap_bytes as f64 / 1024.0)
    });
    (looks.collect(), drive)
}

/// The laps' row of the table.
fn judge_laps(hours: f64) {
    let bar = ProgressBar::new(2 * u64::from(LOOKS));
    let [(looks, first), (_, second)] = std::thread::scope(|scope| {
        [scope.spawn(|| laps(hours, &bar)), scope.spawn(|| laps(hours, &bar))]
            .map(|both| both.join().expect("no panic"))
    });
    bar.finish_and_clear();
    let (slope, lap_h, counters) = (slope_kib_per_hour(&looks), first.lap_h(), first.pipeline.counters());
    let saved = first.pipeline.saved_state();
    let is_same = saved.is_some() && saved == second.pipeline.saved_state();
    println!(
        "| {hours} h of laps of {lap_h:.2} h, compressed | {} | {} | {} | {slope:.2} | {is_same} |",
        counters.sweeps, counters.dropped_sweeps, counters.lost_frames
    );
    assert!(is_same, "the same traffic has made another map");
    assert!(counters.dropped_sweeps == 0, "sweeps were dropped");
    assert!(slope < MAX_KIB_PER_HOUR, "memory grows");
}

/// The real program's row of the table.
fn judge_real(minutes: f64) {
    let (live, replayed, slope) = real(minutes);
    let key = |key: &str| live[key].as_u64().unwrap_or(u64::MAX);
    let is_same =
        ["map_sha256", "trajectory_sha256"].iter().all(|key| live[key] == replayed[key] && !live[key].is_null());
    println!(
        "| {minutes} min in real time, cores loaded | {} | {} | {} | {slope:.2} | {is_same} |",
        key("sweeps"),
        key("dropped"),
        key("lost_frames")
    );
    assert!(is_same, "the same traffic has made another map");
    assert!(key("dropped") == 0, "sweeps were dropped");
    // A shorter run has explored, and grown, to its end.
    assert!(minutes < MIN_MINUTES || slope < MAX_KIB_PER_HOUR, "memory grows");
}

pub(crate) fn run(options: &Options) {
    println!("| | sweeps | dropped | frames lost | memory, KiB per hour | the same twice |");
    println!("|---|---|---|---|---|---|");
    if options.hours > 0.0 {
        judge_laps(options.hours);
    }
    if options.minutes > 0.0 {
        judge_real(options.minutes);
    }
}
