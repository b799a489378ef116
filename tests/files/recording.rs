//! A recording on a failing disk: SLAM is not held up, what can be kept is kept, and the log stays readable.

#![allow(clippy::unwrap_used, reason = "a test may")]

use bytes::Bytes;
use slamd::recorder::{Chunk, Folder, Losses, Plan, Recorder, Tape};
use slamd_capture::{CaptureInfo, CaptureReader, Record};
use slamd_core::Timestamp;
use slamd_testkit::faulty_disk::{FaultyDisk, IoMode, record};
use std::os::unix::fs::PermissionsExt as _;
use std::sync::Arc;
use std::time::Duration;

/// A chunk every 20 ms, at 6 kB/s.
fn chunk(i: u64) -> Chunk {
    let bytes: Bytes = (0..120u64).map(|b| (b * 7 + i).to_le_bytes()[0]).collect();
    let at = Timestamp::from_us(i * 20_000);
    if i.is_multiple_of(50) { Chunk::Sent(at, bytes) } else { Chunk::Received(at, bytes) }
}

const SECOND: u64 = 50;

/// A tape on a disk, what it was given, and its notices.
struct Run {
    disk: FaultyDisk,
    tape: Tape<FaultyDisk>,
    given: u64,
    notices: Vec<(Timestamp, String)>,
    most_waiting: usize,
}

impl Run {
    fn new(plan: Plan) -> Self {
        let disk = FaultyDisk::default();
        let tape = Tape::begin(disk.clone(), CaptureInfo::default(), plan).unwrap();
        Self { disk, tape, given: 0, notices: Vec::new(), most_waiting: 0 }
    }

    fn run(&mut self, seconds: u64, mode: IoMode) {
        self.disk.set_mode(mode);
        for _ in 0..seconds * SECOND {
            self.tape.push(chunk(self.given));
            self.given += 1;
            while let Some(notice) = self.tape.poll_notice() {
                self.notices.push((self.tape.now(), notice));
            }
            self.most_waiting = self.most_waiting.max(self.tape.waiting_bytes());
        }
    }

    fn finish(self) -> (Losses, Vec<Record>, Vec<Option<String>>) {
        let losses = self.tape.finish();
        let (records, damage) = self.disk.read();
        (losses, records, damage)
    }
}

fn given(chunks: impl IntoIterator<Item = u64>) -> Vec<Record> {
    chunks.into_iter().map(|i| record(&chunk(i))).collect()
}

/// The records are all chunks but `lost` in one piece; the number in front of the gap.
fn assert_one_gap(records: &[Record], all: u64, lost: u64) -> u64 {
    let front = records.iter().zip(0..).take_while(|(got, i)| **got == record(&chunk(*i))).count() as u64;
    assert!(records == given((0..front).chain(front + lost..all)), "{front} in front of the gap of {lost}");
    front
}

#[test]
fn a_full_disk_that_gets_room_again_costs_nothing() {
    let mut run = Run::new(Plan::default());
    run.run(10, IoMode::Working);
    run.run(600, IoMode::Room(1_000));
    run.run(10, IoMode::Working);
    let told: Vec<_> = run.notices.iter().map(|(_, notice)| notice.as_str()).collect();
    assert_eq!(told.len(), 11, "one warning a minute, and the end: {told:#?}");
    assert!(
        told[0].starts_with("recording waits: memory-1.mcap: no storage space; mapping continues, "),
        "{}",
        told[0]
    );
    assert!(told[10].starts_with("recording continues after 6"), "{}", told[10]);
    assert!(told[10].ends_with("; nothing is missing"), "{}", told[10]);
    let all = run.given;
    let (losses, records, damage) = run.finish();
    assert_eq!(losses, Losses::default());
    assert_eq!(damage, [None], "one file, and a whole one");
    assert!(records == given(0..all));
}

#[test]
fn a_disk_full_for_long_loses_the_end_of_that_time_and_memory_stays_bounded() {
    let mut run = Run::new(Plan::default());
    run.run(10, IoMode::Working);
    run.run(3_600, IoMode::Room(0));
    run.run(10, IoMode::Working);
    let (all, most) = (run.given, run.most_waiting);
    assert!(most < 17 << 20, "{most} bytes");
    assert!(run.notices.last().unwrap().1.ends_with(" chunks are missing"));
    let (losses, records, damage) = run.finish();
    assert!(losses.chunks > 0 && losses.unfinished.is_none());
    assert_eq!(damage, [None]);
    let front = assert_one_gap(&records, all, losses.chunks);
    assert!(front > 1_500 * SECOND, "{front}: what is there has no gap before the bound was reached");
}

#[test]
fn short_writes_and_errors_that_change_each_second_lose_nothing() {
    let mut run = Run::new(Plan::default());
    for i in 0..120 {
        run.run(1, [IoMode::Short(1), IoMode::Broken, IoMode::Short(17), IoMode::Room(300), IoMode::Working][i % 5]);
    }
    run.disk.set_mode(IoMode::Short(5));
    assert!(run.notices.len() <= 2 * 2, "{:#?}", run.notices);
    let all = run.given;
    let (losses, records, damage) = run.finish();
    assert_eq!((losses, damage), (Losses::default(), vec![None]));
    assert!(records == given(0..all));
}

#[test]
fn a_file_that_cannot_be_written_any_more_is_given_up_for_another() {
    let mut run = Run::new(Plan::default());
    run.run(10, IoMode::Working);
    run.run(60, IoMode::Stale);
    assert_eq!(run.tape.part(), 2);
    let all = run.given;
    let (losses, records, damage) = run.finish();
    assert!(losses.chunks <= 5, "{losses:?}: what was encoded for the first file and never written");
    assert_eq!(damage.len(), 2);
    assert!(damage[0].as_ref().unwrap().contains("was not finished") && damage[1].is_none());
    assert_one_gap(&records, all, losses.chunks);
}

#[test]
fn a_recording_is_cut_by_size_and_by_time_and_the_oldest_is_deleted() {
    let plans = [
        Plan { most_bytes: Some(100_000), ..Plan::default() },
        Plan { most_time: Some(Duration::from_secs(60)), ..Plan::default() },
    ];
    for plan in plans {
        let mut run = Run::new(plan);
        run.run(300, IoMode::Working);
        let (all, disk) = (run.given, run.disk.clone());
        let (losses, records, damage) = run.finish();
        assert_eq!(losses, Losses::default());
        assert!(damage.len() >= 5 && damage.iter().all(Option::is_none), "{damage:?}");
        assert!(records == given(0..all), "the parts together are the recording");
        let sizes: Vec<usize> = disk.0.borrow().files.values().map(Vec::len).collect();
        if plan.most_bytes.is_some() {
            // A chunk, and the index that closes the file.
            assert!(sizes.iter().all(|size| *size < 140_000), "{sizes:?}");
        }
    }
    let mut run = Run::new(Plan { most_time: Some(Duration::from_secs(10)), keep: Some(3), ..Plan::default() });
    run.run(100, IoMode::Working);
    assert_eq!(run.disk.0.borrow().files.keys().copied().collect::<Vec<_>>(), [8, 9, 10]);
    assert_eq!(run.disk.0.borrow().removed, [1, 2, 3, 4, 5, 6, 7]);
}

#[test]
fn free_space_is_left_to_others() {
    let mut run = Run::new(Plan { keep_free_bytes: 100 << 20, ..Plan::default() });
    run.disk.0.borrow_mut().free_bytes = Some(200 << 20);
    run.run(10, IoMode::Working);
    run.disk.0.borrow_mut().free_bytes = Some(99 << 20);
    run.run(1, IoMode::Working);
    let size = || run.disk.0.borrow().files[&1].len();
    let before = size();
    run.run(30, IoMode::Working);
    assert_eq!(run.disk.0.borrow().files[&1].len(), before);
    assert!(run.notices[0].1.contains("99 MiB are free, and 100 must stay free"), "{:?}", run.notices);
    run.disk.0.borrow_mut().free_bytes = Some(200 << 20);
    run.run(2, IoMode::Working);
    let all = run.given;
    let (losses, records, _) = run.finish();
    assert_eq!(losses, Losses::default());
    assert!(records == given(0..all));
}

#[test]
fn recordings_are_private_and_spare_other_files() {
    let folder = tempfile::tempdir().unwrap();
    let info = CaptureInfo::default();
    let plan = Plan { most_bytes: Some(1), ..Plan::default() };
    let mode = |path: &std::path::Path| std::fs::metadata(path).unwrap().permissions().mode() & 0o777;
    // An old recording under the first number is another's.
    let target = folder.path().join("kept");
    let name = Folder::numbered(&target, "drive").unwrap();
    std::fs::write(target.join("drive-0002.mcap"), "an old one").unwrap();
    let mut recorder = Recorder::begin(name, info.clone(), plan, Arc::default()).unwrap();
    (0..10).for_each(|i| recorder.record(Chunk::Received(Timestamp::from_us(i * 100_000), Bytes::from_static(b"abc"))));
    assert_eq!(recorder.finish(), Losses::default());
    assert_eq!(std::fs::read(target.join("drive-0002.mcap")).unwrap(), b"an old one");
    assert_eq!((mode(&target), mode(&target.join("drive-0001.mcap"))), (0o700, 0o600));
    assert!(target.join("drive-0003.mcap").exists());
    // So is a file that the user names: the recording takes the next number.
    let path = folder.path().join("drive.mcap");
    std::fs::write(&path, "old").unwrap();
    std::os::unix::fs::symlink("nowhere", folder.path().join("drive-0002.mcap")).unwrap();
    let recorder = Recorder::begin(Folder::file(&path), info, Plan::default(), Arc::default()).unwrap();
    assert_eq!(recorder.finish(), Losses::default());
    assert_eq!(std::fs::read(&path).unwrap(), b"old");
    assert!(!folder.path().join("nowhere").exists());
    let next = folder.path().join("drive-0003.mcap");
    assert_eq!((mode(&next), CaptureReader::open(&next).unwrap().count()), (0o600, 0));
}

#[test]
fn only_a_recordings_own_files_are_deleted() {
    let folder = tempfile::tempdir().unwrap();
    let plan = Plan { most_bytes: Some(1), keep: Some(2), ..Plan::default() };
    for number in [1, 2, 4, 6] {
        std::fs::write(folder.path().join(format!("drive-{number:04}.mcap")), "another's").unwrap();
    }
    let name = Folder::numbered(folder.path(), "drive").unwrap();
    let mut recorder = Recorder::begin(name, CaptureInfo::default(), plan, Arc::default()).unwrap();
    (0..9).for_each(|i| recorder.record(Chunk::Received(Timestamp::from_us(i * 100_000), Bytes::from_static(b"abc"))));
    assert_eq!(recorder.finish(), Losses::default());
    for number in [1, 2, 4, 6] {
        assert_eq!(std::fs::read(folder.path().join(format!("drive-{number:04}.mcap"))).unwrap(), b"another's");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 4 + 2);
}

#[test]
fn a_recording_that_cannot_begin_is_refused_with_the_cause() {
    let nowhere = Folder::file("/nowhere/a.mcap".as_ref());
    let nowhere = Recorder::begin(nowhere, CaptureInfo::default(), Plan::default(), Arc::default());
    let error = nowhere.err().unwrap().to_string();
    assert!(error.starts_with("/nowhere/a.mcap: No such file or directory"), "{error}");
    let disk = FaultyDisk::default();
    disk.set_mode(IoMode::Room(10));
    let error = Tape::begin(disk, CaptureInfo::default(), Plan::default()).err().unwrap();
    assert_eq!(error.to_string(), "memory-1.mcap: no storage space");
}
