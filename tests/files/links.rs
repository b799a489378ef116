//! Links that others planted, or that the user forgot: what they lead to is never written.

#![allow(clippy::unwrap_used, reason = "a test may")]

use bytes::Bytes;
use slamd::recorder::{Chunk, Folder, Losses, Plan, Recorder};
use slamd_capture::{CaptureInfo, CaptureWriter};
use slamd_core::Timestamp;
use slamd_files::{PartFile, write_file};
use std::os::unix::fs::symlink;
use std::path::Path;
use std::sync::Arc;

const PRECIOUS: &str = "somebody's file";

/// A folder with a file that two links lead to: `soft` and `hard`.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("precious"), PRECIOUS).unwrap();
    symlink("precious", path("soft")).unwrap();
    std::fs::hard_link(path("precious"), path("hard")).unwrap();
    folder
}

fn is_kept(folder: &Path) -> bool {
    ["precious", "soft", "hard"].iter().all(|name| std::fs::read(folder.join(name)).unwrap() == PRECIOUS.as_bytes())
}

#[test]
fn a_recording_never_writes_through_a_link() {
    for name in ["soft", "hard"] {
        let folder = folder();
        // Planted under the next names, too.
        symlink("precious", folder.path().join(format!("{name}-0002.mcap"))).unwrap();
        std::fs::hard_link(folder.path().join("precious"), folder.path().join(format!("{name}-0003.mcap"))).unwrap();
        let to = Folder::file(&folder.path().join(name));
        let plan = Plan { most_bytes: Some(1), keep: Some(1), ..Plan::default() };
        let mut recorder = Recorder::begin(to, CaptureInfo::default(), plan, Arc::default()).unwrap();
        for i in 0..20 {
            recorder.record(Chunk::Received(Timestamp::from_us(i * 100_000), Bytes::from_static(b"abc")));
        }
        assert_eq!(recorder.finish(), Losses::default());
        assert!(is_kept(folder.path()), "{name}");
        assert!(folder.path().join(format!("{name}-0003.mcap")).exists(), "nothing of others is deleted");
    }
}

#[test]
fn captures_and_results_never_write_through_a_link() {
    for name in ["soft", "hard"] {
        let folder = folder();
        let error = CaptureWriter::create(&folder.path().join(name), &CaptureInfo::default()).err().unwrap();
        assert!(error.to_string().contains(name), "{error}");
        assert!(is_kept(folder.path()), "{name}");
        // A result takes the name, and what was behind it stays.
        write_file(folder.path(), name, b"ours").unwrap();
        let mut growing = PartFile::create(&folder.path().join(name)).unwrap();
        growing.append(b"ours, too");
        growing.publish().unwrap();
        growing.finish().unwrap();
        assert_eq!(std::fs::read(folder.path().join("precious")).unwrap(), PRECIOUS.as_bytes(), "{name}");
        assert_eq!(std::fs::read(folder.path().join(name)).unwrap(), b"ours, too");
    }
}

/// Names that a run uses before it renames cannot be foreseen, so nobody can plant a link there.
#[test]
fn temporary_names_differ_each_time() {
    let folder = tempfile::tempdir().unwrap();
    let mut seen = std::collections::BTreeSet::new();
    for _ in 0..20 {
        let file = PartFile::create(&folder.path().join("map.png")).unwrap();
        let entry = std::fs::read_dir(folder.path()).unwrap().next().unwrap().unwrap();
        assert!(entry.file_name().len() > "map.png".len() + 16, "{entry:?}");
        assert!(seen.insert(entry.file_name()));
        drop(file);
    }
}
