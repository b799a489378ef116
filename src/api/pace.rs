//! When the next report of a class is due.

use slamd_core::Timestamp;
use std::time::Duration;

/// True if a report is due at this rate; then sets the next time. A report may come a quarter of a period early, because sweeps are not exactly
/// periodic.
pub(super) fn is_time(due: &mut Timestamp, hz: f64, at: Timestamp) -> bool {
    if hz <= 0.0 {
        return false;
    }
    let period = Duration::from_secs_f64(1.0 / hz);
    let is_time = at + period / 4 >= *due;
    if is_time {
        *due = (*due + period).max(at);
    }
    is_time
}
