//! A period in which the disk fails: when it is tried again.

use slamd_core::Timestamp;
use std::io::{self, ErrorKind};
use std::time::Duration;

/// A period in which the disk fails.
pub(super) struct Outage {
    pub(super) since: Timestamp,
    /// When the write is tried again.
    pub(super) retry_at: Timestamp,
    retry: Duration,
    /// When another file is tried.
    replace_at: Timestamp,
    replace: Duration,
    /// Chunks that were lost before.
    pub(super) lost_before: u64,
    /// The last error.
    pub(super) cause: String,
    pub(super) is_reported: bool,
}

/// The first wait before a failed write is tried again; it doubles up to the last.
const FIRST_RETRY: Duration = Duration::from_secs(1);
const LAST_RETRY: Duration = Duration::from_secs(8);
const LAST_RETRY_OF_FULL: Duration = Duration::from_secs(2);
/// After so long a failure that is not a full disk, a new file is begun: the disk may have been removed and inserted again. The wait doubles up
/// to the last.
const GIVE_UP: Duration = Duration::from_secs(10);
const LAST_GIVE_UP: Duration = Duration::from_secs(60);

impl Outage {
    pub(super) fn begin(now: Timestamp, lost_before: u64) -> Self {
        Self {
            since: now,
            retry_at: now,
            retry: FIRST_RETRY,
            replace_at: now + GIVE_UP,
            replace: GIVE_UP,
            lost_before,
            cause: String::new(),
            is_reported: false,
        }
    }

    /// Notes a failed attempt. True if another file shall be tried.
    pub(super) fn fail(&mut self, now: Timestamp, error: &io::Error) -> bool {
        self.cause = error.to_string();
        let is_full = matches!(error.kind(), ErrorKind::StorageFull | ErrorKind::QuotaExceeded);
        let last = if is_full { LAST_RETRY_OF_FULL } else { LAST_RETRY };
        (self.retry_at, self.retry) = (now + self.retry, (self.retry * 2).min(last));
        if is_full || now < self.replace_at {
            return false;
        }
        self.replace = (self.replace * 2).min(LAST_GIVE_UP);
        self.replace_at = now + self.replace;
        true
    }
}
