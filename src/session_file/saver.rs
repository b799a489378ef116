//! Saving beside a live run: the pipeline is held up for a copy of what it knows, never for the disk.

use super::{FileError, write};
use crate::priority;
use slamd_core::{SavedState, Timestamp};
use std::path::PathBuf;
use std::thread::JoinHandle;
use std::time::Duration;

/// Writes a session file every minute, and at the end.
#[derive(Debug)]
pub struct Saver {
    path: PathBuf,
    next: Timestamp,
    writing: Option<JoinHandle<Result<(), FileError>>>,
}

/// From one save to the next.
const PERIOD: Duration = Duration::from_secs(60);

impl Saver {
    /// A saver that has not saved yet.
    #[must_use]
    pub fn new(path: PathBuf) -> Self {
        Self { path, next: Timestamp::default() + PERIOD, writing: None }
    }

    /// Saves what `memory` gives, in a thread of its own, where it is time; not while the last save still goes on.
    pub fn tick(&mut self, at: Timestamp, memory: impl FnOnce() -> Option<SavedState>) {
        if at < self.next || self.writing.as_ref().is_some_and(|writing| !writing.is_finished()) {
            return;
        }
        self.next = at + PERIOD;
        if let Err(error) = self.join() {
            tracing::warn!("the session was not saved: {error}; the next try is in a minute");
        }
        if let Some(memory) = memory() {
            let path = self.path.clone();
            self.writing = Some(std::thread::spawn(move || {
                priority::background();
                write(&path, &memory)
            }));
        }
    }

    /// Saves for the last time.
    ///
    /// # Errors
    /// Where the file cannot be written.
    pub fn finish(mut self, memory: Option<SavedState>) -> Result<(), FileError> {
        // An older save must not overtake this one; its failure does not matter any more.
        let _ = self.join();
        match memory {
            Some(memory) => write(&self.path, &memory),
            None => {
                tracing::warn!("{}: not written, for nothing is known yet", self.path.display());
                Ok(())
            }
        }
    }

    fn join(&mut self) -> Result<(), FileError> {
        self.writing.take().map_or(Ok(()), |writing| writing.join().unwrap_or(Ok(())))
    }
}
