//! Session time: which deadlines are due before an input, and when each is handled.
//!
//! [`crate::driver::Driver`] asks it; another order of deadlines and inputs would give another map.

use crate::time::Timestamp;

/// Session time, which never runs back.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SessionClock {
    now: Timestamp,
}

/// Deadlines that passed longer ago than this are not made up for: a damaged time must not cost hours.
const MAX_SILENCE_US: u64 = 60_000_000;

impl SessionClock {
    /// A clock at the session's zero.
    #[must_use]
    pub(crate) const fn new() -> Self {
        Self { now: Timestamp::from_us(0) }
    }

    /// The latest instant reached.
    #[must_use]
    pub(crate) const fn now(&self) -> Timestamp {
        self.now
    }

    /// The instant of an input that came at `at`. Ask for the deadlines that are [`SessionClock::due`] before it.
    pub(crate) fn approach(&mut self, at: Timestamp) -> Timestamp {
        let at = at.max(self.now);
        // Where nothing was heard or said for longer, because no port was there, more questions would change nothing.
        self.now = self.now.max(Timestamp::from_us(at.us().saturating_sub(MAX_SILENCE_US)));
        at
    }

    /// The instant at which `deadline` is to be handled, if that is not after `at`; else `at` is reached.
    pub(crate) fn due(&mut self, at: Timestamp, deadline: Timestamp) -> Option<Timestamp> {
        let deadline = deadline.max(self.now);
        let is_due = deadline <= at;
        self.now = if is_due { deadline } else { at };
        is_due.then_some(deadline)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seconds(seconds: u64) -> Timestamp {
        Timestamp::from_us(seconds * 1_000_000)
    }

    #[test]
    fn deadlines_are_handled_at_their_own_time_and_time_never_runs_back() {
        let mut clock = SessionClock::default();
        let at = clock.approach(seconds(5));
        assert_eq!(clock.due(at, seconds(2)), Some(seconds(2)));
        assert_eq!(clock.due(at, seconds(1)), Some(seconds(2)));
        assert_eq!(clock.due(at, seconds(6)), None);
        assert_eq!((clock.now(), clock.approach(seconds(3))), (seconds(5), seconds(5)));
    }

    #[test]
    fn what_was_due_during_a_long_silence_is_not_made_up_for() {
        let mut clock = SessionClock::default();
        let at = clock.approach(seconds(3600));
        assert_eq!(clock.due(at, seconds(1)), Some(seconds(3540)));
    }
}
