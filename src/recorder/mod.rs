//! Records a live session in its own thread, so that the pipeline never waits for a disk.
//!
//! [`Tape`] is the recording as a state machine; [`Recorder`] is the thread that runs it.

#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing, clippy::string_slice)]
#![deny(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)]
#![deny(clippy::allow_attributes, clippy::allow_attributes_without_reason)]

mod disk;
mod health;
mod outage;
mod part;
mod plan;
mod tape;

pub use disk::{Disk, Folder, Presence};
pub use health::{DiskHealth, DiskState};
pub use plan::{Losses, Plan};
pub use tape::Tape;

use bytes::Bytes;
use slamd_capture::{CaptureError, CaptureInfo};
use slamd_core::Timestamp;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::Duration;

/// A piece of traffic to record.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Chunk {
    /// Bytes read.
    Received(Timestamp, Bytes),
    /// Bytes written.
    Sent(Timestamp, Bytes),
    /// The port was opened again.
    Opened(Timestamp),
}

impl Chunk {
    /// Session time of the read, the write or the opening.
    #[must_use]
    pub const fn at(&self) -> Timestamp {
        match self {
            Self::Received(at, _) | Self::Sent(at, _) | Self::Opened(at) => *at,
        }
    }

    /// Its length in bytes.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::Received(_, bytes) | Self::Sent(_, bytes) => bytes.len(),
            Self::Opened(_) => 0,
        }
    }

    /// True if it has no bytes.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// A running recording.
pub struct Recorder {
    queue: SyncSender<Chunk>,
    thread: JoinHandle<Losses>,
    health: Arc<DiskHealth>,
    parts: Arc<AtomicU32>,
    parts_seen: u32,
    dropped: u64,
    warn_at: Timestamp,
}

/// Length of the queue to the recording thread, which may be blocked by the disk: several minutes of chunks.
const QUEUE: usize = 65_536;
/// Shortest time between two warnings.
const WARNING_PERIOD: Duration = Duration::from_secs(60);
/// Time between two retries of a failed disk while no chunks arrive.
const IDLE: Duration = Duration::from_secs(1);

impl Recorder {
    /// Begins a recording. It says so where its first file existed, which is kept.
    ///
    /// # Errors
    /// When its first file cannot be created or written.
    pub fn begin(folder: Folder, info: CaptureInfo, plan: Plan, health: Arc<DiskHealth>) -> Result<Self, CaptureError> {
        let wanted = folder.path(1);
        let tape = Tape::begin(folder, info, plan)?;
        if tape.part() != 1 {
            tracing::warn!("{} exists and is kept; recording to {}", wanted.display(), tape.path().display());
        }
        let (queue, chunks) = sync_channel(QUEUE);
        let parts_seen = tape.part();
        let parts = Arc::new(AtomicU32::new(parts_seen));
        let thread = {
            let (parts, health) = (Arc::clone(&parts), Arc::clone(&health));
            std::thread::spawn(move || write(tape, &chunks, &parts, &health))
        };
        Ok(Self { queue, thread, health, parts, parts_seen, dropped: 0, warn_at: Timestamp::default() })
    }

    /// Records a chunk; a chunk that finds the queue full is counted as lost.
    pub fn record(&mut self, chunk: Chunk) {
        let at = chunk.at();
        if self.queue.try_send(chunk).is_ok() {
            return;
        }
        self.dropped += 1;
        self.health.update(|state| state.recording_dropped = self.dropped);
        if at >= self.warn_at {
            self.warn_at = at + WARNING_PERIOD;
            tracing::error!(
                "the disk hangs: {} chunks are missing from the recording; mapping continues",
                self.dropped
            );
        }
    }

    /// True once after a new file was begun: the board's description and ring must then be requested again, so that the file can be replayed alone.
    pub fn take_new_part(&mut self) -> bool {
        let parts = self.parts.load(Ordering::Relaxed);
        std::mem::replace(&mut self.parts_seen, parts) != parts
    }

    /// Writes all waiting chunks and closes the file. Returns what the recording lacks.
    pub fn finish(self) -> Losses {
        drop(self.queue);
        let failed = |_| Losses { chunks: 0, unfinished: Some("the recording thread failed".into()), is_gone: false };
        let mut losses = self.thread.join().unwrap_or_else(failed);
        losses.chunks += self.dropped;
        losses
    }
}

fn write(mut tape: Tape<Folder>, chunks: &Receiver<Chunk>, parts: &AtomicU32, health: &DiskHealth) -> Losses {
    let mut told = (0, 0, false);
    loop {
        let wait = tape.flush_in().unwrap_or(IDLE);
        match chunks.recv_timeout(wait) {
            Ok(chunk) => tape.push(chunk),
            // No chunk arrived, so session time advanced by the wait.
            Err(RecvTimeoutError::Timeout) => tape.advance(tape.now() + wait),
            Err(RecvTimeoutError::Disconnected) => {
                tape.retry();
                tell(&mut tape);
                return tape.finish();
            }
        }
        parts.store(tape.part(), Ordering::Relaxed);
        let state = (tape.errors(), tape.lost(), tape.outage().is_some());
        if state != told || state.2 {
            told = state;
            health.recording(&tape);
        }
        tell(&mut tape);
    }
}

fn tell(tape: &mut Tape<Folder>) {
    while let Some(notice) = tape.poll_notice() {
        tracing::warn!("{notice}");
    }
}
