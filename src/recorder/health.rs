//! What the disk refuses during a session, for `/metrics` and `/healthz`.

use super::{Disk, Tape};
use std::fmt;
use std::sync::{Mutex, PoisonError};

/// The state of the disk, shared by those who write and those who report. Nobody holds its lock while a disk works.
#[derive(Debug, Default)]
pub struct DiskHealth(Mutex<DiskState>);

/// What the disk refused.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DiskState {
    /// Failed attempts to write the recording.
    pub recording_errors: u64,
    /// Chunks missing from the recording because the memory for waiting ones was full, or their file was removed.
    pub recording_lost: u64,
    /// Chunks missing because the disk hung.
    pub recording_dropped: u64,
    /// Bytes that wait in memory while the recording cannot be written.
    pub recording_waiting_bytes: u64,
    /// Failed saves of the session.
    pub session_errors: u64,
    /// Failed checkpoints of the output folder.
    pub output_errors: u64,
    /// Why the recording waits.
    pub recording: Option<String>,
    /// Why the session was not saved last time.
    pub session: Option<String>,
    /// Why the output folder was not written last time.
    pub output: Option<String>,
}

impl DiskHealth {
    /// The state now.
    #[must_use]
    pub fn state(&self) -> DiskState {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    pub(super) fn update(&self, update: impl FnOnce(&mut DiskState)) {
        update(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner));
    }

    pub(super) fn recording<D: Disk>(&self, tape: &Tape<D>) {
        let waits = tape.outage().map(|(since, cause)| {
            let seconds = tape.now().seconds_since(since);
            format!("{}: {cause}, for {seconds:.0} s", tape.path().display())
        });
        self.update(|state| {
            (state.recording_errors, state.recording_lost) = (tape.errors(), tape.lost());
            state.recording_waiting_bytes = if waits.is_some() { tape.waiting_bytes() as u64 } else { 0 };
            state.recording = waits;
        });
    }

    /// A save of the session ended.
    pub fn session<E: fmt::Display>(&self, result: &Result<(), E>) {
        self.update(|state| {
            state.session = result.as_ref().err().map(ToString::to_string);
            state.session_errors += u64::from(result.is_err());
        });
    }

    /// A checkpoint of the output folder ended.
    pub fn output<E: fmt::Display>(&self, result: &Result<(), E>) {
        self.update(|state| {
            state.output = result.as_ref().err().map(ToString::to_string);
            state.output_errors += u64::from(result.is_err());
        });
    }
}

impl DiskState {
    /// What cannot be written now, a line each.
    #[must_use]
    pub fn troubles(&self) -> Vec<String> {
        let parts = [("recording", &self.recording), ("session", &self.session), ("output", &self.output)];
        parts.iter().filter_map(|(what, cause)| Some(format!("disk: {what}: {}", cause.as_ref()?))).collect()
    }

    /// True if something cannot be written now.
    #[must_use]
    pub const fn is_failing(&self) -> bool {
        self.recording.is_some() || self.session.is_some() || self.output.is_some()
    }
}
