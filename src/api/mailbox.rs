//! From the pipeline's thread to another: one place, where the newest wins.

use slamd_core::{Raster, Snapshot, Timestamp};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError, TryLockError};
use tokio::sync::Notify;

/// Where a session's newest moment lies.
#[derive(Debug, Default)]
pub struct Mailbox {
    slot: Mutex<Slot>,
    /// Clients that want to hear of each sweep.
    pub(super) watchers: AtomicUsize,
    asked: AtomicBool,
    map_asked: AtomicBool,
    news: Notify,
}

/// What lies there.
#[derive(Debug, Default)]
pub(super) struct Slot {
    pub(super) snapshot: Snapshot,
    /// A map that was asked for, and when it was copied.
    pub(super) map: Option<(Timestamp, Raster)>,
}

impl Mailbox {
    /// Asks for the moment as it is, whether anything has changed or not.
    pub fn ask(&self) {
        self.asked.store(true, Ordering::Release);
    }

    /// Asks for the map.
    pub fn ask_map(&self) {
        self.map_asked.store(true, Ordering::Release);
    }

    /// Waits for a moment and takes it, with the map where that was asked for.
    pub async fn next(&self) -> (Snapshot, Option<(Timestamp, Raster)>) {
        self.news.notified().await;
        let mut slot = self.slot.lock().unwrap_or_else(PoisonError::into_inner);
        (slot.snapshot.clone(), slot.map.take())
    }

    /// True where anybody wants anything.
    pub(super) fn is_wanted(&self) -> bool {
        self.watchers.load(Ordering::Relaxed) > 0 || self.is_asked()
    }

    /// True where somebody has asked since the last time.
    pub(super) fn is_asked(&self) -> bool {
        self.asked.load(Ordering::Acquire) || self.map_asked.load(Ordering::Acquire)
    }

    /// The place, with whether the map is wanted in it; none while the server looks into it: nobody waits for that.
    pub(super) fn open(&self) -> Option<(MutexGuard<'_, Slot>, bool)> {
        let slot = match self.slot.try_lock() {
            Ok(slot) => slot,
            Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            Err(TryLockError::WouldBlock) => return None,
        };
        // Who asks from here on is answered the next time.
        self.asked.store(false, Ordering::Release);
        Some((slot, self.map_asked.swap(false, Ordering::AcqRel)))
    }

    /// Tells whoever waits that there is something new.
    pub(super) fn tell(&self) {
        self.news.notify_one();
    }
}
