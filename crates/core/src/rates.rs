//! Counters → rates per second over the last two seconds.

use crate::event::Counters;
use crate::time::Timestamp;
use std::collections::VecDeque;

/// Rates, per second.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rates {
    /// Sweeps used.
    pub sweeps: f64,
    /// Valid frames.
    pub frames: f64,
    /// Frames with a wrong checksum.
    pub crc_errors: f64,
    /// Missing frames.
    pub lost_frames: f64,
    /// Sweeps dropped.
    pub dropped_sweeps: f64,
}

/// Compares counters with those from about two seconds ago.
#[derive(Clone, Debug, Default)]
pub struct RateMeter {
    past: VecDeque<(Timestamp, Counters)>,
}

/// Rates are means over this time, seconds.
const WINDOW_S: f64 = 2.0;
/// A rate over less time than this means nothing, seconds.
const MIN_S: f64 = 0.25;
const MAX_KEPT: usize = 64;

impl RateMeter {
    /// Adds the counters at `at`. Returns the rates up to then; 0 while too little time has passed.
    pub fn rates(&mut self, at: Timestamp, now: Counters) -> Rates {
        self.past.push_back((at, now));
        while self.past.len() > MAX_KEPT
            || self.past.get(1).is_some_and(|(second, _)| at.seconds_since(*second) >= WINDOW_S)
        {
            self.past.pop_front();
        }
        let Some(&(since, then)) = self.past.front() else { return Rates::default() };
        let seconds = at.seconds_since(since);
        if seconds < MIN_S {
            return Rates::default();
        }
        // A late frame reduces the number of missing ones, so the difference can be negative: the rate is then 0.
        let per_second = |now: u64, then: u64| now.saturating_sub(then) as f64 / seconds;
        Rates {
            sweeps: per_second(now.sweeps, then.sweeps),
            frames: per_second(now.frames, then.frames),
            crc_errors: per_second(now.crc_errors, then.crc_errors),
            lost_frames: per_second(now.lost_frames, then.lost_frames),
            dropped_sweeps: per_second(now.dropped_sweeps, then.dropped_sweeps),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_are_those_of_the_last_two_seconds() {
        let mut meter = RateMeter::default();
        let mut rates = Rates::default();
        // 10 sweeps a second for 5 s, then 4 s of silence.
        for tenth in 0..=90u64 {
            let counters = Counters { sweeps: tenth.min(50), ..Counters::default() };
            rates = meter.rates(Timestamp::from_us(100_000 * tenth), counters);
            if tenth == 1 {
                assert!(rates.sweeps.abs() < 1e-9, "too early to tell: {rates:?}");
            }
            if tenth == 50 {
                assert!((rates.sweeps - 10.0).abs() < 1e-9, "{rates:?}");
            }
        }
        assert!(rates.sweeps.abs() < 1e-9, "{rates:?}");
    }

    #[test]
    fn a_late_frame_gives_no_negative_rate() {
        let mut meter = RateMeter::default();
        meter.rates(Timestamp::default(), Counters { lost_frames: 3, ..Counters::default() });
        let rates = meter.rates(Timestamp::from_us(1_000_000), Counters { lost_frames: 2, ..Counters::default() });
        assert!(rates.lost_frames.abs() < 1e-9);
    }
}
