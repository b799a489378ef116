//! File descriptors: as many as the system allows, with some that no connection may take.

use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use std::io;
use std::os::fd::{AsFd, AsRawFd as _};

/// Descriptors that connections leave free for port, recording, session, output and threads.
const RESERVED: u64 = 64;

/// Raises the limit of open descriptors to the most that this user may have.
pub(crate) fn raise_limit() {
    let limit = getrlimit(Resource::Nofile);
    if limit.current != limit.maximum {
        let raised = Rlimit { current: limit.maximum, maximum: limit.maximum };
        // Without it there are fewer places for clients.
        let _ = setrlimit(Resource::Nofile, raised);
    }
}

/// True if this connection leaves enough descriptors. The system gives the lowest free number, so a high one means that few are free.
pub(crate) fn is_spare(connection: &impl AsFd) -> bool {
    let number = u64::try_from(connection.as_fd().as_raw_fd()).unwrap_or(u64::MAX);
    let limit = getrlimit(Resource::Nofile).current.unwrap_or(u64::MAX);
    number < limit.saturating_sub(RESERVED.min(limit / 2))
}

/// Why no descriptor can be had; none if one can.
pub(crate) fn shortage() -> Option<io::Error> {
    let error = std::fs::File::open("/").err()?;
    let errno = rustix::io::Errno::from_io_error(&error);
    let is_shortage = matches!(errno, Some(rustix::io::Errno::MFILE | rustix::io::Errno::NFILE));
    is_shortage.then_some(error)
}
