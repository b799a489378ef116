//! The output folder: one run at a time, and no run over the results of another robot's drive.

use super::WriteError;
use serde::{Deserialize, Serialize};
use slamd_files::{FolderLock, LockError, OutputGuard, Refusal, private, regular};
use std::fs::{self, DirBuilder};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

/// The files of a run.
pub const RESULTS: [&str; 11] = [
    "config.toml",
    "faults.csv",
    "lock.csv",
    "map.pgm",
    "map.png",
    "map.svg",
    "map.yaml",
    "odometry.tum",
    "summary.json",
    "trajectory.tum",
    "truth.tum",
];

/// What a run's results were made from.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Source {
    /// The capture that was replayed; none where a robot drove. What was replayed can be replayed again.
    pub capture: Option<String>,
    /// Unix time of the session's start, microseconds; none if unknown. A replay has that of its recording.
    pub began_unix_us: Option<u64>,
    /// True if the run continued a saved session, whose map is in its own.
    #[serde(skip)]
    pub is_resumed: bool,
}

/// A folder that cannot take a run's results.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    /// It holds what cannot be made again.
    #[error(
        "{} holds the results of a robot's drive, which are kept; name another folder with --out, or --force replaces them",
        .0.display()
    )]
    Kept(PathBuf),
    /// One of the results would be written over an input, or has the name of something that is no file.
    #[error(transparent)]
    Refused(#[from] Refusal),
    /// Another run is using it, or it is no folder.
    #[error(transparent)]
    Locked(#[from] LockError),
    /// It cannot be created or written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

/// What is done with the results that a folder holds already.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Earlier {
    /// There are none, or they take no part in anything: they are replaced.
    Replaced,
    /// They are moved into a folder of their own.
    Moved,
}

/// The folder of one run.
pub(super) struct ResultFolder {
    path: PathBuf,
    source: Source,
    earlier: Earlier,
    /// The folder holds a map already.
    has_map: bool,
    /// The earlier results have made room.
    is_taken: bool,
    _lock: FolderLock,
}

impl ResultFolder {
    /// Checks whether a run with a robot could open the folder now. Creates nothing.
    pub(super) fn check(path: &Path, guard: &OutputGuard) -> Result<(), FolderError> {
        guard.check_folder(path, &RESULTS)?;
        if path.is_dir() {
            drop(FolderLock::new(path, &RESULTS)?);
        } else if path.exists() {
            return Err(FolderError::Locked(LockError::NoFolder(path.into())));
        }
        private::check_folder(path).map_err(|source| FolderError::Write(WriteError { path: path.into(), source }))
    }

    /// Creates the folder if it is not there, locks it, and decides about earlier results. None of them is touched yet.
    pub(super) fn open(path: &Path, source: Source, guard: &OutputGuard) -> Result<Self, FolderError> {
        private::create_folder(path).map_err(|source| match source.kind() {
            ErrorKind::AlreadyExists => FolderError::Locked(LockError::NoFolder(path.into())),
            _ => FolderError::Write(WriteError { path: path.into(), source }),
        })?;
        guard.check_folder(path, &RESULTS)?;
        let lock = FolderLock::new(path, &RESULTS)?;
        let is_there = RESULTS.iter().any(|name| path.join(name).symlink_metadata().is_ok());
        let held = is_there.then(|| Held::read(path)).flatten();
        let has_map = is_there && held.as_ref().is_none_or(|held| held.nothing_mapped.is_none());
        let may_replace = !has_map
            || guard.is_forced()
            || held.and_then(|held| held.source).is_some_and(|held| {
                held.capture.is_some() || (held.began_unix_us.is_some() && held.began_unix_us == source.began_unix_us)
            });
        let earlier = match source.capture {
            _ if may_replace => Earlier::Replaced,
            Some(_) => return Err(FolderError::Kept(path.into())),
            None if source.is_resumed => Earlier::Replaced,
            None => Earlier::Moved,
        };
        Ok(Self { path: path.into(), source, earlier, has_map, is_taken: false, _lock: lock })
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    pub(super) const fn source(&self) -> &Source {
        &self.source
    }

    /// True if the folder holds the map of an earlier run.
    pub(super) const fn has_earlier_map(&self) -> bool {
        self.has_map && !self.is_taken
    }

    /// True once this run's files take the place of earlier ones.
    pub(super) const fn is_taken(&self) -> bool {
        self.is_taken
    }

    /// Makes room for this run's files: moves the earlier ones away where they must be kept. Returns where they are then.
    pub(super) fn take(&mut self) -> Result<Option<PathBuf>, WriteError> {
        if std::mem::replace(&mut self.is_taken, true) || self.earlier == Earlier::Replaced {
            return Ok(None);
        }
        let folder = self.next_folder()?;
        for name in RESULTS {
            let (from, to) = (self.path.join(name), folder.join(name));
            match fs::rename(&from, to) {
                Err(error) if error.kind() == ErrorKind::NotFound => {}
                other => other.map_err(|source| WriteError { path: from, source })?,
            }
        }
        Ok(Some(folder))
    }

    /// Removes earlier results that this run has not replaced, because they would be taken for its own.
    pub(super) fn remove_others(&self, written: &[&str]) -> Result<(), WriteError> {
        for name in RESULTS.iter().filter(|name| !written.contains(name)) {
            let path = self.path.join(name);
            match fs::remove_file(&path) {
                Err(error) if error.kind() != ErrorKind::NotFound => return Err(WriteError { path, source: error }),
                _ => {}
            }
        }
        Ok(())
    }

    /// A new folder for earlier results.
    fn next_folder(&self) -> Result<PathBuf, WriteError> {
        let mut number = 1;
        loop {
            let folder = self.path.join(format!("earlier-{number:04}"));
            match create_new_folder(&folder) {
                Ok(()) => return Ok(folder),
                Err(error) if error.kind() == ErrorKind::AlreadyExists => number += 1,
                Err(source) => return Err(WriteError { path: folder, source }),
            }
        }
    }
}

fn create_new_folder(path: &Path) -> io::Result<()> {
    use std::os::unix::fs::DirBuilderExt as _;
    DirBuilder::new().mode(0o700).create(path)
}

/// Largest `summary.json` that is read; slamd writes some kilobytes.
const MAX_SUMMARY_BYTES: u64 = 1 << 20;

/// What an earlier run says of itself in its `summary.json`.
#[derive(Deserialize)]
struct Held {
    nothing_mapped: Option<String>,
    source: Option<Source>,
}

impl Held {
    /// None where the summary is missing, as after a power cut, or is another program's, as a giant is.
    fn read(folder: &Path) -> Option<Self> {
        serde_json::from_slice(&regular::read(&folder.join("summary.json"), MAX_SUMMARY_BYTES).ok()?).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn robot(began_unix_us: u64) -> Source {
        Source { began_unix_us: Some(began_unix_us), ..Source::default() }
    }

    fn replay(began_unix_us: Option<u64>) -> Source {
        Source { capture: Some("c.mcap".into()), began_unix_us, is_resumed: false }
    }

    /// A folder that a run has left, and what another run may do with it.
    fn after(held: Option<&Source>, mapped: bool, run: Source, force: bool) -> Result<Option<String>, String> {
        let folder = tempfile::tempdir().unwrap();
        let reason = (!mapped).then_some("no frames");
        let json = serde_json::json!({ "nothing_mapped": reason, "source": held });
        if held.is_some() {
            fs::write(folder.path().join("summary.json"), json.to_string()).unwrap();
        }
        fs::write(folder.path().join("map.png"), "map").unwrap();
        let guard = OutputGuard::new(force);
        let mut opened = ResultFolder::open(folder.path(), run, &guard).map_err(|error| error.to_string())?;
        let moved = opened.take().unwrap();
        assert_eq!(folder.path().join("map.png").exists(), moved.is_none());
        Ok(moved.map(|moved| moved.file_name().unwrap().to_string_lossy().into_owned()))
    }

    #[test]
    fn a_robots_drive_is_never_written_over() {
        let moved = Ok(Some("earlier-0001".to_owned()));
        let kept = |result: Result<_, String>| result.unwrap_err().contains("holds the results of a robot's drive");
        assert_eq!(after(Some(&robot(1)), true, robot(2), false), moved);
        assert_eq!(after(None, true, robot(2), false), moved, "a killed run, or another program's files");
        assert_eq!(after(Some(&robot(1)), true, Source { is_resumed: true, ..robot(2) }, false), Ok(None));
        assert_eq!(after(Some(&robot(1)), true, robot(2), true), Ok(None));
        assert!(kept(after(Some(&robot(1)), true, replay(None), false)));
        assert!(kept(after(Some(&robot(1)), true, replay(Some(2)), false)));
        assert!(kept(after(None, true, replay(Some(2)), false)));
        assert_eq!(after(Some(&robot(1)), true, replay(Some(1)), false), Ok(None), "the drive's own recording");
        assert_eq!(after(Some(&robot(1)), true, replay(None), true), Ok(None));
        assert_eq!(after(Some(&replay(None)), true, robot(2), false), Ok(None));
        assert_eq!(after(Some(&replay(None)), true, replay(None), false), Ok(None));
        assert_eq!(after(Some(&robot(1)), false, replay(None), false), Ok(None), "nothing had been mapped");
    }

    #[test]
    fn a_giant_summary_is_another_programs() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("summary.json");
        let mut text = serde_json::json!({ "nothing_mapped": null, "source": replay(None) }).to_string();
        fs::write(&path, &text).unwrap();
        assert!(Held::read(folder.path()).is_some());
        text.extend(std::iter::repeat_n(' ', 1 << 20));
        fs::write(&path, text).unwrap();
        assert!(Held::read(folder.path()).is_none());
        // Ten gigabytes without a byte on the disk.
        fs::File::create(&path).unwrap().set_len(10 << 30).unwrap();
        assert!(Held::read(folder.path()).is_none());
    }

    #[test]
    fn two_runs_in_one_folder_are_refused_and_so_is_a_file() {
        let folder = tempfile::tempdir().unwrap();
        let guard = OutputGuard::new(true);
        let first = ResultFolder::open(folder.path(), robot(1), &guard).map(drop);
        assert!(first.is_ok());
        let _first = ResultFolder::open(folder.path(), robot(1), &guard).ok().unwrap();
        assert!(matches!(
            ResultFolder::open(folder.path(), robot(2), &guard),
            Err(FolderError::Locked(LockError::InUse(_)))
        ));
        let before = ResultFolder::check(folder.path(), &guard).unwrap_err();
        assert!(matches!(before, FolderError::Locked(LockError::InUse(_))));
        let file = folder.path().join("map.png");
        fs::write(&file, "").unwrap();
        for (name, words) in [("map.png", "is a file, not a folder"), ("map.png/o", "Not a directory")] {
            let error = ResultFolder::check(&folder.path().join(name), &guard).unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        }
        ResultFolder::check(&folder.path().join("new/o"), &guard).unwrap();
        assert!(!folder.path().join("new").exists(), "nothing is created");
        let error = ResultFolder::open(&file, robot(2), &guard).err().unwrap().to_string();
        assert!(error.contains("is a file, not a folder"), "{error}");
        let guard = OutputGuard::new(true).reads(&file);
        drop(_first);
        assert!(matches!(ResultFolder::open(folder.path(), robot(2), &guard), Err(FolderError::Refused(_))));
    }
}
