//! A folder that one run at a time writes into.

use crate::part_file::remove_parts;
use rustix::fs::{FlockOperation, flock};
use rustix::io::Errno;
use std::fs::{File, OpenOptions};
use std::io;
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::{Path, PathBuf};

/// Keeps other runs out of a folder until it is dropped, or the process ends.
#[derive(Debug)]
pub struct FolderLock(#[expect(dead_code, reason = "the open file holds the lock")] File);

/// Why a folder cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum LockError {
    /// Another run writes into it.
    #[error("{}: another slamd is writing into this folder; wait for its end, or name another folder", .0.display())]
    InUse(PathBuf),
    /// It is a file.
    #[error("{} is a file, not a folder; name a folder", .0.display())]
    NoFolder(PathBuf),
    /// It cannot be opened.
    #[error("{}: {source}", path.display())]
    System {
        /// The folder.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
}

impl FolderLock {
    /// Locks an existing folder, and removes what killed runs have left of files of these names.
    ///
    /// # Errors
    /// When another run has locked it, or it is no folder that can be read.
    pub fn new(folder: &Path, names: &[&str]) -> Result<Self, LockError> {
        let system = |source| LockError::System { path: folder.into(), source };
        // A pipe that has taken its place is not waited for.
        let flags = rustix::fs::OFlags::NONBLOCK.bits().cast_signed();
        let file = OpenOptions::new().read(true).custom_flags(flags).open(folder).map_err(system)?;
        if !file.metadata().map_err(system)?.is_dir() {
            return Err(LockError::NoFolder(folder.into()));
        }
        match flock(&file, FlockOperation::NonBlockingLockExclusive) {
            Ok(()) => remove_parts(folder, names),
            Err(Errno::WOULDBLOCK) => return Err(LockError::InUse(folder.into())),
            // Some network file systems lock no folders: better no lock than no map.
            Err(error) => tracing::warn!("{}: cannot be locked against another run: {error}", folder.display()),
        }
        Ok(Self(file))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_run_at_a_time() {
        let folder = tempfile::tempdir().unwrap();
        let lock = FolderLock::new(folder.path(), &[]).unwrap();
        let error = FolderLock::new(&folder.path().join("."), &[]).unwrap_err().to_string();
        assert!(error.contains("another slamd is writing"), "{error}");
        drop(lock);
        FolderLock::new(folder.path(), &[]).unwrap();
        let file = folder.path().join("file");
        std::fs::write(&file, "").unwrap();
        assert!(matches!(FolderLock::new(&file, &[]), Err(LockError::NoFolder(_))));
    }
}
