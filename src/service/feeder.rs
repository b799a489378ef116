//! When the watchdog is fed: a state machine whose only clock is the one it is given.

use slamd_core::Timestamp;
use std::time::Duration;

/// Feeds a watchdog several times within its patience, as often as somebody looks and not more often.
#[derive(Clone, Copy, Debug)]
pub struct Feeder {
    every: Duration,
    due: Timestamp,
}

/// Times within the watchdog's patience: the loop may go round as rarely as once in 2.5 s, and a feeding may be lost.
const TIMES: u32 = 4;

impl Feeder {
    /// For a watchdog that waits for `patience`. The first feeding is due at once.
    #[must_use]
    pub fn new(patience: Duration) -> Self {
        Self { every: patience / TIMES, due: Timestamp::default() }
    }

    /// True where it is time, at `now`.
    #[must_use]
    pub fn is_due(&self, now: Timestamp) -> bool {
        now >= self.due
    }

    /// It was fed at `now`.
    pub fn fed(&mut self, now: Timestamp) {
        self.due = now + self.every;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: u64 = 1_000_000;

    /// When a watchdog of 20 s is fed by a loop that goes round at these microseconds.
    fn feedings(looks: impl Iterator<Item = u64>) -> Vec<u64> {
        let mut feeder = Feeder::new(Duration::from_secs(20));
        let feed = |us: u64| {
            let now = Timestamp::from_us(us);
            feeder.is_due(now).then(|| {
                feeder.fed(now);
                us
            })
        };
        looks.filter_map(feed).collect()
    }

    #[test]
    fn a_busy_loop_feeds_it_four_times_within_its_patience_and_no_more() {
        let fed = feedings((0..6_000).map(|round| round * 10_000));
        assert_eq!(fed, (0..12).map(|time| time * 5 * SECOND).collect::<Vec<_>>());
    }

    #[test]
    fn a_loop_that_waits_for_a_port_feeds_it_in_time() {
        let fed = feedings((0..100).map(|round| round * 5 * SECOND / 2));
        assert!(fed.windows(2).all(|pair| pair[1] - pair[0] <= 10 * SECOND), "{fed:?}");
    }

    #[test]
    fn a_loop_that_hangs_does_not_feed_it_and_makes_up_for_nothing() {
        let hung = (0..10).map(|round| round * SECOND).chain([60 * SECOND, 61 * SECOND]);
        assert_eq!(feedings(hung), [0, 5 * SECOND, 60 * SECOND]);
    }
}
