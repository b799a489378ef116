//! What stands at a path where a command wants to write.

use rustix::fs::{FlockOperation, flock};
use rustix::io::Errno;
use std::fs::{self, File, Metadata};
use std::io::{self, ErrorKind};
use std::os::unix::fs::{FileTypeExt as _, MetadataExt as _};
use std::path::Path;

/// Marks an open file as being written until it is closed. Some network file systems have no locks: then it is not marked.
pub(crate) fn mark_as_written(file: &File) {
    let _ = flock(file, FlockOperation::NonBlockingLockExclusive);
}

/// True if a program has marked the file as being written.
pub(crate) fn is_being_written(path: &Path) -> bool {
    let Ok(file) = File::open(path) else { return false };
    flock(&file, FlockOperation::NonBlockingLockShared) == Err(Errno::WOULDBLOCK)
}

/// What a path leads to; a link that leads nowhere counts as a file.
pub(crate) fn existing(path: &Path) -> io::Result<Option<Metadata>> {
    let missing = |result: io::Result<Metadata>| match result {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        other => other.map(Some),
    };
    match missing(fs::metadata(path))? {
        Some(metadata) => Ok(Some(metadata)),
        None => missing(fs::symlink_metadata(path)),
    }
}

/// A pipe, a socket or a device such as a terminal.
pub(crate) fn is_stream(metadata: &Metadata) -> bool {
    let kind = metadata.file_type();
    kind.is_fifo() || kind.is_char_device() || kind.is_socket()
}

/// Nobody may write the file; that its owner could change that does not count, not even for root.
pub(crate) fn is_read_only(metadata: &Metadata) -> bool {
    metadata.is_file() && metadata.mode() & 0o222 == 0
}

pub(crate) fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or_else(|| Path::new("."))
}
