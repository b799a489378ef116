//! Each call of the program's that opens, writes, syncs, renames or makes something fails once, and then with all that follow, as SQLite's tests
//! do. What a run leaves is complete or absent, the session that was there is as it was or as the run leaves it, and a run that lost something
//! names it and fails.
//!
//! Needs Debian's `strace`, which makes the calls fail. Without it the test says so, but fails where the variable CI is set.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd_capture::{CaptureReader, CaptureWriter};
use slamd_core::Timestamp;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;

const SLAMD: &str = env!("CARGO_BIN_EXE_slamd");
const CALLS: [&str; 10] =
    ["openat", "write", "fsync", "fdatasync", "rename", "renameat", "renameat2", "mkdir", "linkat", "ftruncate"];
/// Enough of the drive for poses and a map.
const DRIVE_US: u64 = 20_000_000;
/// What a run tells of its own time is different each time.
const TIMED: &str = "summary.json";

/// The beginning of a committed drive.
fn drive(path: &Path) {
    let whole = Path::new(env!("CARGO_MANIFEST_DIR")).join("replay/flat-paper-faults.mcap");
    let mut reader = CaptureReader::open(&whole).unwrap();
    let mut writer = CaptureWriter::create(path, reader.info()).unwrap();
    let end = Timestamp::from_us(DRIVE_US);
    let records = reader.by_ref().map(Result::unwrap).take_while(|record| record.at() < end);
    records.for_each(|record| writer.record(&record).unwrap());
    writer.finish().unwrap();
}

/// What a run left.
struct Left {
    code: Option<i32>,
    errors: String,
    /// The calls, as strace lists them.
    calls: String,
    files: BTreeMap<String, Vec<u8>>,
    session: Vec<u8>,
}

struct Bench {
    folder: tempfile::TempDir,
    old_session: Vec<u8>,
}

impl Bench {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        drive(&folder.path().join("drive.mcap"));
        let mut bench = Self { folder, old_session: Vec::new() };
        let first = bench.run("first", None);
        assert_eq!(first.code, Some(0), "{}", first.errors);
        bench.old_session = first.session;
        bench
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Replays the drive with a session, while a call fails: which, and when.
    fn run(&self, name: &str, failing: Option<(&str, &str)>) -> Left {
        let own = self.path(name);
        std::fs::create_dir(&own).unwrap();
        let (out, session, log) = (own.join("out"), own.join("home.session"), own.join("calls"));
        if !self.old_session.is_empty() {
            std::fs::write(&session, &self.old_session).unwrap();
        }
        let mut command = Command::new("strace");
        command.args(["-f", "-qq", "-o"]).arg(&log).arg("-e").arg(format!("trace={}", CALLS.join(",")));
        if let Some((call, when)) = failing {
            command.arg("-e").arg(format!("inject={call}:error=EIO:when={when}"));
        }
        command.arg(SLAMD).arg("replay").arg(self.path("drive.mcap")).arg("--out").arg(&out);
        command.arg("--session").arg(&session).env("XDG_CONFIG_HOME", "/nonexistent");
        if cfg!(feature = "viewer") {
            command.args(["--viewer", "off"]);
        }
        let output = command.output().unwrap();
        let entries = std::fs::read_dir(&out).into_iter().flatten().flatten();
        let files = entries.map(|it| (it.file_name().into_string().unwrap(), std::fs::read(it.path()).unwrap()));
        let left = Left {
            code: output.status.code(),
            errors: String::from_utf8_lossy(&output.stderr).into_owned(),
            calls: std::fs::read_to_string(&log).unwrap(),
            files: files.collect(),
            session: std::fs::read(&session).unwrap_or_default(),
        };
        std::fs::remove_dir_all(&own).unwrap();
        left
    }

    /// Judges a run that lost something, or not.
    fn judge(&self, sound: &Left, left: &Left, what: &str) {
        let said = &left.errors;
        assert!(left.code.is_some_and(|code| code != 101) && !said.contains("panicked"), "{what}: {said}");
        for (name, bytes) in &left.files {
            let of_sound = sound.files.get(name).unwrap_or_else(|| panic!("{what}: {name} is left behind"));
            let is_whole =
                bytes == of_sound || name == TIMED && serde_json::from_slice::<serde_json::Value>(bytes).is_ok();
            assert!(is_whole, "{what}: {name} is not whole: {} of {} bytes", bytes.len(), of_sound.len());
        }
        assert!(left.session == self.old_session || left.session == sound.session, "{what}: the session is damaged");
        let is_whole = left.files.len() == sound.files.len() && left.session == sound.session;
        // The log itself, or the summary on standard output, may be what failed.
        let has_failed = |descriptor: u8| {
            let call = format!(" write({descriptor},");
            left.calls.lines().any(|line| line.contains("INJECTED") && line.contains(&call))
        };
        let is_told = left.code != Some(0);
        assert!(is_told != is_whole || has_failed(1), "{what}: {:?}, {:?}: {said}", left.code, left.files.keys());
        let is_log = has_failed(2);
        assert!(is_whole || is_log || said.contains("Input/output error"), "{what}: {:?}: {said}", left.code);
    }
}

/// How often a thread makes a call at most, and how many times it did so before it opened the drive: the program is loaded until then.
fn counts(calls: &str, name: &str) -> (usize, usize) {
    let (mut of_thread, mut loaded) = (BTreeMap::<&str, usize>::new(), None);
    for line in calls.lines() {
        let (thread, rest) = line.trim_start().split_once(' ').unwrap();
        if rest.contains("drive.mcap") && loaded.is_none() {
            loaded = Some(of_thread.get(thread).copied().unwrap_or(0));
        }
        if rest.trim_start().starts_with(&format!("{name}(")) {
            *of_thread.entry(thread).or_default() += 1;
        }
    }
    (loaded.unwrap_or(0), of_thread.into_values().max().unwrap_or(0))
}

#[test]
fn each_failing_call_leaves_outputs_whole_or_absent_and_the_session_as_it_was() {
    if !Command::new("strace").arg("-V").output().is_ok_and(|output| output.status.success()) {
        assert!(std::env::var_os("CI").is_none(), "no strace: apt-get install strace");
        println!("not tested: strace cannot be run; Debian's package is strace");
        return;
    }
    let bench = Bench::new();
    let sound = bench.run("sound", None);
    assert_eq!(sound.code, Some(0), "{}", sound.errors);
    assert!(sound.files.len() > 8 && sound.session != bench.old_session, "{:?}", sound.files.keys());
    let mut cases = Vec::new();
    for call in CALLS {
        let (loaded, all) = counts(&sound.calls, call);
        for number in loaded + 1..=all {
            cases.extend([(call, number.to_string()), (call, format!("{number}+"))]);
        }
    }
    println!("{} cases", cases.len());
    assert!(cases.len() > 100, "{cases:?}");
    let waiting = Mutex::new(cases);
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                loop {
                    let Some((call, when)) = waiting.lock().unwrap().pop() else { return };
                    let left = bench.run(&format!("{call}-{when}"), Some((call, &when)));
                    assert!(left.calls.contains("(INJECTED)"), "{call} {when}: nothing failed");
                    bench.judge(&sound, &left, &format!("{call} {when}"));
                }
            });
        }
    });
}
