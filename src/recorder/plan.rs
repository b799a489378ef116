//! What a recording shall do, and what it lacks in the end.

use std::time::Duration;

/// When a recording begins a new file, and how much disk space it leaves free.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Plan {
    /// Largest size of a file, bytes.
    pub most_bytes: Option<u64>,
    /// Longest time in a file.
    pub most_time: Option<Duration>,
    /// Number of files to keep; older files of this recording are deleted.
    pub keep: Option<u32>,
    /// Writing pauses while fewer bytes are free.
    pub keep_free_bytes: u64,
}

/// What a recording lacks.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Losses {
    /// Chunks that were not written, or whose file was removed.
    pub chunks: u64,
    /// Why the last file could not be closed; its content can still be read, unless it is gone.
    pub unfinished: Option<String>,
    /// The last file is gone, because nothing of the traffic could be written to it.
    pub is_gone: bool,
}
