//! From the pipeline's thread to a sink's: a queue that never grows, a map slot where the newest wins.

use super::snapshot::Snapshot;
use slamd_core::geometry::Pose2;
use slamd_core::mapping::grid::Patch;
use slamd_core::mapping::raster::Raster;
use slamd_core::time::Timestamp;
use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TryRecvError, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// What a sink hears of.
#[derive(Clone, Debug)]
pub(super) enum SinkUpdate {
    /// A sweep.
    Snapshot(Arc<Snapshot>),
    /// Where the robot truly was, for once.
    Truth(Timestamp, Pose2),
    /// A line of the log.
    Line(Arc<Line>),
    /// Changes of the map, where nothing is dropped: a recording must not show the map of later.
    Map(Arc<NewMap>),
}

/// A line of the log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Line {
    /// How serious it is, as Rerun writes it.
    pub(super) level: &'static str,
    /// The text.
    pub(super) text: String,
}

/// The part of the map that the sink has not seen: at most the whole map.
#[derive(Clone, Debug, Default)]
pub(super) struct NewMap {
    /// Side of the patches' cells, metres.
    pub(super) cell_m: f64,
    /// Patches by place.
    pub(super) patches: HashMap<(i32, i32), Arc<Patch>>,
    /// A map that does not come in patches.
    pub(super) whole: Option<Arc<Raster>>,
}

/// Queued update: 12 s at 20 Hz.
const MAX_QUEUED: usize = 256;
/// How long a replay waits for a sink that takes nothing, before it goes on without it.
const PATIENCE: Duration = Duration::from_secs(2);
/// Between two looks into an empty queue: fast enough to the eye.
const LOOK: Duration = Duration::from_millis(20);
const NAP: Duration = Duration::from_millis(1);

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

/// A queue. A patient one is for a source that can wait: it drops nothing while the sink works.
#[must_use]
pub(super) fn mailbox(is_patient: bool) -> (Mailbox, Inbox) {
    let (sender, receiver) = sync_channel(MAX_QUEUED);
    let shared = Arc::new(Shared { is_patient: is_patient.into(), ..Shared::default() });
    (Mailbox { sender, shared: Arc::clone(&shared) }, Inbox { receiver, shared })
}

impl Mailbox {
    /// Queues update, or drops and counts them.
    pub(super) fn offer(&self, update: SinkUpdate) {
        let Err(TrySendError::Full(update)) = self.sender.try_send(update) else { return };
        if !self.shared.is_patient.load(Ordering::Relaxed) || !self.wait(update) {
            self.shared.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// True where there was room in time; nobody waits twice for a sink that is stuck.
    #[expect(clippy::disallowed_methods, reason = "only where nothing is in a hurry")]
    fn wait(&self, mut update: SinkUpdate) -> bool {
        for _ in 0..PATIENCE.as_millis() / NAP.as_millis() {
            std::thread::sleep(NAP);
            match self.sender.try_send(update) {
                Err(TrySendError::Full(back)) => update = back,
                _ => return true,
            }
        }
        self.shared.is_patient.store(false, Ordering::Relaxed);
        false
    }

    /// Puts changes of the map where the sink will find them, over older ones.
    pub(super) fn update_map(&self, update: impl FnOnce(&mut NewMap)) {
        if self.shared.is_patient.load(Ordering::Relaxed) {
            let mut map = NewMap::default();
            update(&mut map);
            return self.offer(SinkUpdate::Map(Arc::new(map)));
        }
        update(&mut self.shared.map.lock().unwrap_or_else(PoisonError::into_inner));
    }

    /// What found no room so far.
    #[must_use]
    pub(super) fn dropped(&self) -> u64 {
        self.shared.dropped.load(Ordering::Relaxed)
    }
}

impl Inbox {
    /// The next update. Looks now and then instead of waiting in the queue: waking it up would cost the pipeline's thread more than all
    /// the rest.
    ///
    /// # Errors
    /// When none come in time, or none will come any more.
    #[expect(clippy::disallowed_methods, reason = "people live in real time")]
    pub(super) fn next(&self, timeout: Duration) -> Result<SinkUpdate, RecvTimeoutError> {
        let begin = Instant::now();
        loop {
            match self.receiver.try_recv() {
                Ok(update) => return Ok(update),
                Err(TryRecvError::Disconnected) => return Err(RecvTimeoutError::Disconnected),
                Err(TryRecvError::Empty) if begin.elapsed() >= timeout => return Err(RecvTimeoutError::Timeout),
                Err(TryRecvError::Empty) => {
                    let is_patient = self.shared.is_patient.load(Ordering::Relaxed);
                    std::thread::sleep(if is_patient { NAP } else { LOOK.min(timeout) });
                }
            }
        }
    }

    /// What has changed of the map since the last call.
    #[must_use]
    pub(super) fn take_map(&self) -> NewMap {
        std::mem::take(&mut self.shared.map.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// What found no room so far.
    #[must_use]
    pub(super) fn dropped(&self) -> u64 {
        self.shared.dropped.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line() -> SinkUpdate {
        SinkUpdate::Line(Arc::new(Line { level: "INFO", text: "hello".into() }))
    }

    #[test]
    fn a_sink_that_takes_nothing_costs_what_does_not_fit() {
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
    fn a_sink_that_is_gone_costs_nothing() {
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
