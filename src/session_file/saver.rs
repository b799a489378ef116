//! Saves the state during a live run: the pipeline waits for a copy in memory, never for the disk.

use super::{FileError, write};
use crate::priority;
use crate::recorder::DiskHealth;
use crate::source::checkpoints::PERIOD;
use slamd_core::{SavedState, Timestamp};
use std::path::PathBuf;
use std::sync::Arc;
use std::thread::JoinHandle;

/// Writes a session file every ten seconds, and at the end.
#[derive(Debug)]
pub struct Saver {
    path: PathBuf,
    next: Timestamp,
    writing: Option<JoinHandle<Result<(), FileError>>>,
    health: Arc<DiskHealth>,
}

impl Saver {
    /// A saver that has not saved yet.
    #[must_use]
    pub fn new(path: PathBuf) -> Self {
        Self { path, next: Timestamp::default() + PERIOD, writing: None, health: Arc::default() }
    }

    /// Reports to `health` whether the saves succeed.
    #[must_use]
    pub fn with_health(self, health: Arc<DiskHealth>) -> Self {
        Self { health, ..self }
    }

    /// Saves the state from `state` in its own thread if a save is due and the last one has ended.
    pub fn tick(&mut self, at: Timestamp, state: impl FnOnce() -> Option<SavedState>) {
        if at < self.next || self.writing.as_ref().is_some_and(|writing| !writing.is_finished()) {
            return;
        }
        self.next = at + PERIOD;
        let last = self.join();
        self.health.session(&last);
        if let Err(error) = last {
            tracing::warn!("the session was not saved: {error}; retrying in 10 s");
        }
        if let Some(state) = state() {
            let path = self.path.clone();
            self.writing = Some(std::thread::spawn(move || {
                priority::background();
                write(&path, &state)
            }));
        }
    }

    /// Saves for the last time.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn finish(mut self, state: Option<SavedState>) -> Result<(), FileError> {
        // Waits for an older save, so that it cannot overwrite this one; its failure no longer matters.
        let _ = self.join();
        match state {
            Some(state) => write(&self.path, &state),
            None => {
                tracing::warn!("{}: not written, because there is no state to save yet", self.path.display());
                Ok(())
            }
        }
    }

    fn join(&mut self) -> Result<(), FileError> {
        self.writing.take().map_or(Ok(()), |writing| writing.join().unwrap_or(Ok(())))
    }
}
