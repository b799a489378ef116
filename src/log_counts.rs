//! Log lines that were not written, for `/metrics` and for the log itself.

use std::sync::atomic::{AtomicU64, Ordering};

/// Lines summed up, because their cause repeated too often.
pub(crate) static SUMMED_UP: Count = Count(AtomicU64::new(0));
/// Lines dropped, because nobody read the log.
pub(crate) static DROPPED: Count = Count(AtomicU64::new(0));

/// A counter of the whole process.
pub(crate) struct Count(AtomicU64);

impl Count {
    pub(crate) fn increment(&self) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }

    pub(crate) fn get(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }
}
