//! A disk that fails at any call: no good recording is deleted, no empty file stays, and what is missing is told.

#![allow(clippy::unwrap_used, reason = "a test may")]

use bytes::Bytes;
use slamd::recorder::{Chunk, DiskHealth, Folder, Losses, Plan, Recorder, Tape};
use slamd_capture::{CaptureInfo, CaptureReader, Record};
use slamd_core::Timestamp;
use slamd_testkit::faulty_disk::{FaultyDisk, IoMode, record};
use std::sync::Arc;
use std::time::Duration;

/// A chunk every 20 ms.
fn chunk(i: u64) -> Chunk {
    Chunk::Received(Timestamp::from_us(i * 20_000), Bytes::copy_from_slice(&(i + 1).to_le_bytes()))
}

const SECOND: u64 = 50;

fn push(tape: &mut Tape<FaultyDisk>, chunks: std::ops::Range<u64>) -> Vec<String> {
    let mut notices = Vec::new();
    for i in chunks {
        tape.push(chunk(i));
        notices.extend(std::iter::from_fn(|| tape.poll_notice()));
    }
    notices
}

fn numbers(disk: &FaultyDisk) -> Vec<u32> {
    disk.0.borrow().files.keys().copied().collect()
}

const KEEP_3: Plan =
    Plan { most_bytes: None, most_time: Some(Duration::from_secs(10)), keep: Some(3), keep_free_bytes: 0 };

#[test]
fn a_failing_disk_costs_no_good_recording_and_leaves_no_empty_file() {
    for failing_s in [15, 45, 600] {
        let disk = FaultyDisk::default();
        let mut tape = Tape::begin(disk.clone(), CaptureInfo::default(), KEEP_3).unwrap();
        push(&mut tape, 0..25 * SECOND);
        assert_eq!(numbers(&disk), [1, 2, 3]);
        disk.set_mode(IoMode::Broken);
        push(&mut tape, 25 * SECOND..(25 + failing_s) * SECOND);
        assert_eq!(numbers(&disk), [1, 2, 3], "nothing is deleted and nothing is added while the disk fails");
        disk.set_mode(IoMode::Working);
        let end = (25 + failing_s + 9) * SECOND;
        push(&mut tape, (25 + failing_s) * SECOND..end);
        assert_eq!(tape.finish(), Losses::default());
        assert!(disk.0.borrow().files.values().all(|file| file.len() > 1_000));
        // The newest three.
        assert_eq!(numbers(&disk).len(), 3);
        let (records, _) = disk.read();
        assert_eq!(records.last(), Some(&record(&chunk(end - 1))));
    }
}

#[test]
fn files_that_take_nothing_are_deleted_and_tried_ever_more_seldom() {
    let disk = FaultyDisk::default();
    let mut tape = Tape::begin(disk.clone(), CaptureInfo::default(), KEEP_3).unwrap();
    push(&mut tape, 0..5 * SECOND);
    disk.set_mode(IoMode::NamesOnly);
    let before = disk.0.borrow().calls;
    push(&mut tape, 5 * SECOND..305 * SECOND);
    assert_eq!(numbers(&disk), [1], "no empty file stays");
    let (created, calls) = (disk.0.borrow().created - 1, disk.0.borrow().calls - before);
    assert!((3..=10).contains(&created), "{created} files in 300 s");
    assert!(calls < 150, "{calls} calls in 300 s");
}

/// As SQLite's tests do: each call of a recording fails once, and then it and all that follow for a while.
#[test]
fn every_call_may_fail_and_what_is_missing_is_told() {
    let plan = Plan { most_time: Some(Duration::from_secs(2)), ..KEEP_3 };
    let all = 9 * SECOND;
    let run = |failing: std::ops::Range<u64>| -> u64 {
        let disk = FaultyDisk::default();
        disk.0.borrow_mut().failing_calls = failing.clone();
        let Ok(mut tape) = Tape::begin(disk.clone(), CaptureInfo::default(), plan) else {
            assert!(numbers(&disk).is_empty() || failing.end - failing.start > 1, "{failing:?}");
            return disk.0.borrow().calls;
        };
        push(&mut tape, 0..all);
        let errors = tape.errors();
        let losses = tape.finish();
        let calls = disk.0.borrow().calls;
        let empty: Vec<u32> =
            disk.0.borrow().files.iter().filter(|(_, file)| file.is_empty()).map(|(number, _)| *number).collect();
        assert!(empty.len() <= usize::from(failing.end.saturating_add(8) > calls), "{failing:?}: {empty:?} are empty");
        empty.iter().for_each(|number| drop(disk.0.borrow_mut().files.remove(number)));
        let (records, damage) = disk.read();
        let held: Vec<Record> = (0..all).map(|i| record(&chunk(i))).filter(|record| records.contains(record)).collect();
        assert!(held == records, "{failing:?}: each once, and in their order");
        // Three files of 2 s or more, but for what was told to be missing.
        let newest = records.len() as u64 + losses.chunks;
        assert!(newest >= 2 * 2 * SECOND, "{failing:?}: {newest} of {all} are there: {losses:?}");
        let is_last = records.last() == Some(&record(&chunk(all - 1)));
        assert!(is_last || losses.chunks > 0 || losses.unfinished.is_some(), "{failing:?}: {losses:?}");
        let is_hit = failing.start < calls;
        assert!(
            !is_hit || errors > 0 || losses.unfinished.is_some() || failing.end - failing.start == 1,
            "{failing:?}"
        );
        let is_whole = damage.iter().all(Option::is_none);
        assert!(is_whole || losses.unfinished.is_some() || errors > 0, "{failing:?}: {damage:?}");
        calls
    };
    let calls = run(u64::MAX..u64::MAX);
    assert!(calls > 100, "{calls}");
    for call in 0..calls {
        run(call..call + 1);
        run(call..call + 4);
        run(call..call + 40);
        run(call..u64::MAX);
    }
}

#[test]
fn a_removed_file_is_told_within_a_second_and_another_is_begun() {
    for is_renamed in [false, true] {
        let disk = FaultyDisk::default();
        let mut tape = Tape::begin(disk.clone(), CaptureInfo::default(), Plan::default()).unwrap();
        assert!(push(&mut tape, 0..5 * SECOND).is_empty());
        if is_renamed {
            disk.0.borrow_mut().renamed.push(1);
        } else {
            disk.0.borrow_mut().files.remove(&1);
        }
        let notices = push(&mut tape, 5 * SECOND..7 * SECOND);
        let what = if is_renamed { "the file was renamed" } else { "the file was removed" };
        assert!(notices.len() == 1 && notices[0].starts_with(&format!("memory-1.mcap: {what}; ")), "{notices:?}");
        assert!(notices[0].ends_with("; recording to memory-2.mcap"), "{notices:?}");
        let losses = tape.finish();
        let (records, _) = disk.read();
        assert_eq!(records.len() as u64 + losses.chunks, 7 * SECOND, "{losses:?}");
    }
}

#[test]
fn a_file_has_no_name_before_its_first_bytes_and_takes_none_that_exists() {
    use slamd::recorder::{Disk as _, Presence};
    use std::io::Write as _;
    let folder = tempfile::tempdir().unwrap();
    let mut disk = Folder::numbered(folder.path(), "drive").unwrap();
    let path = disk.path(1);
    let (mut file, mut slower) = (disk.create(1).unwrap(), disk.create(1).unwrap());
    assert!(!path.exists() && disk.presence(1, &file).unwrap() == Presence::There);
    file.write_all(b"head").unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), b"head");
    assert_eq!(std::os::unix::fs::MetadataExt::mode(&path.metadata().unwrap()) & 0o777, 0o600);
    assert_eq!(slower.write(b"other").unwrap_err().kind(), std::io::ErrorKind::AlreadyExists);
    assert_eq!(disk.create(1).err().unwrap().kind(), std::io::ErrorKind::AlreadyExists);
    assert_eq!(std::fs::read(&path).unwrap(), b"head");
    file.write_all(b" and body").unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), b"head and body");
    std::fs::remove_file(&path).unwrap();
    assert_eq!(disk.presence(1, &file).unwrap(), Presence::Removed);
}

#[test]
#[expect(clippy::disallowed_methods, reason = "the recorder's thread needs time")]
fn a_folder_that_is_removed_is_told_at_once_and_its_return_continues_the_recording() {
    let parent = tempfile::tempdir().unwrap();
    let folder = parent.path().join("records");
    let health = Arc::<DiskHealth>::default();
    let name = Folder::numbered(&folder, "drive").unwrap();
    let mut recorder = Recorder::begin(name, CaptureInfo::default(), Plan::default(), Arc::clone(&health)).unwrap();
    let mut next = 0;
    let mut drive = |recorder: &mut Recorder, until: &dyn Fn() -> bool| {
        for _ in 0..3_000 {
            recorder.record(chunk(next));
            next += 1;
            std::thread::sleep(Duration::from_millis(1));
            if until() {
                return;
            }
        }
        panic!("not within {} s of session time", next / SECOND);
    };
    drive(&mut recorder, &|| std::fs::metadata(folder.join("drive-0001.mcap")).unwrap().len() > 2_000);
    std::fs::remove_dir_all(&folder).unwrap();
    drive(&mut recorder, &|| health.state().is_failing());
    let state = health.state();
    assert!(state.troubles()[0].contains("drive-0001.mcap: the file was removed"), "{state:?}");
    assert!(state.recording_errors > 0);
    std::fs::create_dir(&folder).unwrap();
    drive(&mut recorder, &|| !health.state().is_failing());
    let losses = recorder.finish();
    let held = CaptureReader::open(&folder.join("drive-0002.mcap")).unwrap().count() as u64;
    assert_eq!(held + losses.chunks, next);
    assert!(held > 0 && losses.chunks > 0);
}
