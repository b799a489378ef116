//! The newest snapshot, passed from the pipeline's thread to another thread.

use slamd_core::{Raster, Snapshot, Timestamp};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError, TryLockError};
use tokio::sync::Notify;

/// Holds a session's newest snapshot; a newer one replaces it.
#[derive(Debug, Default)]
pub struct Mailbox {
    slot: Mutex<Slot>,
    /// Number of clients that subscribe to each sweep.
    pub(super) watchers: AtomicUsize,
    requested: AtomicBool,
    map_requested: AtomicBool,
    updated: Notify,
}

/// The content.
#[derive(Debug, Default)]
pub(super) struct Slot {
    pub(super) snapshot: Snapshot,
    /// A requested map, and when it was copied.
    pub(super) map: Option<(Timestamp, Raster)>,
}

impl Mailbox {
    /// Requests a snapshot, even if nothing has changed.
    pub fn ask(&self) {
        self.requested.store(true, Ordering::Release);
    }

    /// Requests the map.
    pub fn ask_map(&self) {
        self.map_requested.store(true, Ordering::Release);
    }

    /// Waits for a snapshot and takes it, with the map if that was requested.
    pub async fn next(&self) -> (Snapshot, Option<(Timestamp, Raster)>) {
        self.updated.notified().await;
        let mut slot = self.slot.lock().unwrap_or_else(PoisonError::into_inner);
        (slot.snapshot.clone(), slot.map.take())
    }

    /// True if a client watches or a request is open.
    pub(super) fn is_wanted(&self) -> bool {
        self.watchers.load(Ordering::Relaxed) > 0 || self.is_requested()
    }

    /// True if a request came since the last answer.
    pub(super) fn is_requested(&self) -> bool {
        self.requested.load(Ordering::Acquire) || self.map_requested.load(Ordering::Acquire)
    }

    /// Locks the slot and tells whether the map is requested; none while the server holds the lock, so that the pipeline never waits.
    pub(super) fn open(&self) -> Option<(MutexGuard<'_, Slot>, bool)> {
        let slot = match self.slot.try_lock() {
            Ok(slot) => slot,
            Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            Err(TryLockError::WouldBlock) => return None,
        };
        // Later requests are answered the next time.
        self.requested.store(false, Ordering::Release);
        Some((slot, self.map_requested.swap(false, Ordering::AcqRel)))
    }

    /// Wakes the thread that waits in [`Mailbox::next`].
    pub(super) fn notify(&self) {
        self.updated.notify_one();
    }
}
