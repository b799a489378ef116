//! The connection from the pipeline's thread to a sink's: a bounded queue, and a map slot that holds
//! the newest changes.

use super::snapshot::Snapshot;
use slamd_core::{Patch, Pose2, Raster, Timestamp};
use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TryRecvError, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// An update for a sink.
#[derive(Clone, Debug)]
pub(super) enum SinkUpdate {
    /// A sweep.
    Snapshot(Arc<Snapshot>),
    /// A true pose.
    Truth(Timestamp, Pose2),
    /// A log line.
    LogLine(Arc<LogLine>),
    /// Changes of the map, queued when the session waits: so a recording shows each map at its time.
    Map(Arc<NewMap>),
}

/// A log line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct LogLine {
    /// The level in Rerun's spelling.
    pub(super) level: &'static str,
    /// The text.
    pub(super) text: String,
}

/// The changes of the map since the sink's last look.
#[derive(Clone, Debug, Default)]
pub(super) struct NewMap {
    /// Side of the patches' cells, metres.
    pub(super) cell_m: f64,
    /// Patches by column and row.
    pub(super) patches: HashMap<(i32, i32), Arc<Patch>>,
    /// A map that is not sent in patches.
    pub(super) whole: Option<Arc<Raster>>,
}

/// Capacity of the queue: 12 s at 20 Hz.
const MAX_QUEUED: usize = 256;
/// Maximum time that a replay waits for a stalled sink.
const PATIENCE: Duration = Duration::from_secs(2);
/// Polling period of an empty queue: short enough for display.
const POLL_PERIOD: Duration = Duration::from_millis(20);
/// Polling period of a replay.
const REPLAY_POLL_PERIOD: Duration = Duration::from_millis(1);

#[derive(Debug, Default)]
struct Shared {
    map: Mutex<NewMap>,
    dropped: AtomicU64,
    is_patient: std::sync::atomic::AtomicBool,
}

/// The pipeline's end.
#[derive(Clone, Debug)]
pub(super) struct Mailbox {
    sender: SyncSender<SinkUpdate>,
    shared: Arc<Shared>,
}

/// The sink's end.
#[derive(Debug)]
pub(super) struct Inbox {
    receiver: Receiver<SinkUpdate>,
    shared: Arc<Shared>,
}

/// Makes a queue. If `is_patient`, a full queue makes the sender wait instead of dropping updates.
#[must_use]
pub(super) fn mailbox(is_patient: bool) -> (Mailbox, Inbox) {
    let (sender, receiver) = sync_channel(MAX_QUEUED);
    let shared = Arc::new(Shared { is_patient: is_patient.into(), ..Shared::default() });
    (Mailbox { sender, shared: Arc::clone(&shared) }, Inbox { receiver, shared })
}

impl Mailbox {
    /// Queues an update, or drops and counts it.
    pub(super) fn offer(&self, update: SinkUpdate) {
        let Err(TrySendError::Full(update)) = self.sender.try_send(update) else { return };
        if !self.shared.is_patient.load(Ordering::Relaxed) || !self.wait(update) {
            self.shared.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Waits for room in the queue. Returns false after [`PATIENCE`], and never waits again then.
    #[expect(clippy::disallowed_methods, reason = "only a replay waits")]
    fn wait(&self, mut update: SinkUpdate) -> bool {
        for _ in 0..PATIENCE.as_millis() / REPLAY_POLL_PERIOD.as_millis() {
            std::thread::sleep(REPLAY_POLL_PERIOD);
            match self.sender.try_send(update) {
                Err(TrySendError::Full(back)) => update = back,
                _ => return true,
            }
        }
        self.shared.is_patient.store(false, Ordering::Relaxed);
        false
    }

    /// Writes changes of the map into the map slot, over older ones. A replay queues them instead.
    pub(super) fn update_map(&self, update: impl FnOnce(&mut NewMap)) {
        if self.shared.is_patient.load(Ordering::Relaxed) {
            let mut map = NewMap::default();
            update(&mut map);
            return self.offer(SinkUpdate::Map(Arc::new(map)));
        }
        update(&mut self.shared.map.lock().unwrap_or_else(PoisonError::into_inner));
    }

    /// Number of updates dropped so far.
    #[must_use]
    pub(super) fn dropped(&self) -> u64 {
        self.shared.dropped.load(Ordering::Relaxed)
    }
}

impl Inbox {
    /// The next update. Polls instead of blocking, because waking a blocked thread would cost the
    /// pipeline's thread more than everything else here.
    ///
    /// # Errors
    /// When no update comes in time, or the sender is gone.
    #[expect(clippy::disallowed_methods, reason = "the viewer runs in real time")]
    pub(super) fn next(&self, timeout: Duration) -> Result<SinkUpdate, RecvTimeoutError> {
        let begin = Instant::now();
        loop {
            match self.receiver.try_recv() {
                Ok(update) => return Ok(update),
                Err(TryRecvError::Disconnected) => return Err(RecvTimeoutError::Disconnected),
                Err(TryRecvError::Empty) if begin.elapsed() >= timeout => return Err(RecvTimeoutError::Timeout),
                Err(TryRecvError::Empty) => {
                    let is_patient = self.shared.is_patient.load(Ordering::Relaxed);
                    std::thread::sleep(if is_patient { REPLAY_POLL_PERIOD } else { POLL_PERIOD.min(timeout) });
                }
            }
        }
    }

    /// Takes the changes of the map since the last call.
    #[must_use]
    pub(super) fn take_map(&self) -> NewMap {
        std::mem::take(&mut self.shared.map.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Number of updates dropped so far.
    #[must_use]
    pub(super) fn dropped(&self) -> u64 {
        self.shared.dropped.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line() -> SinkUpdate {
        SinkUpdate::LogLine(Arc::new(LogLine { level: "INFO", text: "hello".into() }))
    }

    #[test]
    fn a_stalled_sink_drops_what_does_not_fit() {
        let (mailbox, inbox) = mailbox(false);
        for _ in 0..1_000 {
            mailbox.offer(line());
        }
        assert_eq!(mailbox.dropped(), 1_000 - MAX_QUEUED as u64);
        assert!(inbox.next(Duration::ZERO).is_ok());
        mailbox.offer(line());
        assert_eq!(inbox.dropped(), 1_000 - MAX_QUEUED as u64, "there was room again");
    }

    #[test]
    fn a_closed_sink_drops_nothing() {
        let (mailbox, inbox) = mailbox(true);
        drop(inbox);
        mailbox.offer(line());
        assert_eq!(mailbox.dropped(), 0);
    }

    #[test]
    fn a_replay_waits_for_a_slow_sink() {
        let (mailbox, inbox) = mailbox(true);
        let sink = std::thread::spawn(move || (0..).take_while(|_| inbox.next(PATIENCE).is_ok()).count());
        for _ in 0..10_000 {
            mailbox.offer(line());
        }
        assert_eq!(mailbox.dropped(), 0);
        drop(mailbox);
        assert_eq!(sink.join().unwrap(), 10_000);
    }
}
