//! Writes map, picture and trajectories every ten seconds of a live run, so that a power cut costs no more.

use super::session::Session;
use crate::priority;
use crate::recorder::DiskHealth;
use slamd_core::Timestamp;
use slamd_publish::WriteError;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

/// Time between two checkpoints, and between two saves of the session.
pub const PERIOD: Duration = Duration::from_secs(10);

/// The pipeline waits for copies in memory, never for the disk.
#[derive(Debug)]
pub struct Checkpoints {
    next: Timestamp,
    writing: Option<JoinHandle<Result<(), WriteError>>>,
    has_failed: bool,
    health: Arc<DiskHealth>,
}

impl Checkpoints {
    /// Checkpoints that have not begun.
    #[must_use]
    pub fn new(health: Arc<DiskHealth>) -> Self {
        Self { next: Timestamp::default() + PERIOD, writing: None, has_failed: false, health }
    }

    /// Begins a checkpoint in its own thread if one is due and the last one has ended.
    pub fn tick(&mut self, session: &mut Session) {
        let at = session.now();
        if at < self.next || self.writing.as_ref().is_some_and(|writing| !writing.is_finished()) {
            return;
        }
        self.next = at + PERIOD;
        let last = self.join();
        let begun = last.and_then(|()| session.checkpoint());
        self.health.output(&begun.as_ref().map(|_| ()));
        match begun {
            Ok(checkpoint) => {
                self.has_failed = false;
                if let Some(moved) = checkpoint.as_ref().and_then(|checkpoint| checkpoint.moved()) {
                    tracing::warn!("the results of the drive before are now in {}", moved.display());
                }
                self.writing = checkpoint.map(|checkpoint| {
                    std::thread::spawn(move || {
                        priority::background();
                        checkpoint.write()
                    })
                });
            }
            // A full disk is reported once.
            Err(error) if !std::mem::replace(&mut self.has_failed, true) => {
                tracing::warn!("{error}; the map is written again in 10 s, and mapping goes on");
            }
            Err(_) => {}
        }
    }

    /// Waits for the last checkpoint, so that it cannot take the place of the final files. Its failure no longer matters.
    pub fn finish(mut self) {
        let _ = self.join();
    }

    fn join(&mut self) -> Result<(), WriteError> {
        self.writing.take().map_or(Ok(()), |writing| writing.join().unwrap_or(Ok(())))
    }
}
