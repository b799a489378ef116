//! The unit of the board's stamps: microseconds, or what a board counts in their place.
//!
//! A board whose stamps count milliseconds is understood: they are taken times 1000. Other rates are reported only.

use super::params::Params;
use super::trouble::Trouble;
use crate::time::Timestamp;

/// Watches how fast the stamps of one kind of message advance.
#[derive(Clone, Debug)]
pub(crate) struct Stamps {
    first_at: Option<Timestamp>,
    unit: Option<Unit>,
    short: Option<Interval>,
    long: Option<Interval>,
    has_said_rate: bool,
    params: Params,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Unit {
    Microseconds,
    Milliseconds,
}

#[derive(Clone, Copy, Debug)]
struct Interval {
    from: (u32, Timestamp),
    newest: (u32, Timestamp),
    stamps: u32,
}

/// The unit is taken for known after this time, seconds: a board may send too few stamps to tell.
const UNKNOWN_S: f64 = 1.0;
/// A longer silence begins a new interval, seconds.
const SILENCE_S: f64 = 1.0;
/// Stamps this far back are late; farther back the clock jumped, and a new interval begins.
const LATE: u32 = 1_000_000;
/// Rates of milliseconds, as a share of that of microseconds, and the least rate of microseconds.
const MILLISECONDS: std::ops::RangeInclusive<f64> = 0.5e-3..=2e-3;
const MIN_MICROSECONDS: f64 = 0.1;

impl Stamps {
    /// Stamps of unknown unit.
    #[must_use]
    pub(crate) const fn new(params: Params) -> Self {
        Self { first_at: None, unit: None, short: None, long: None, has_said_rate: false, params }
    }

    /// Takes the stamp of a message that arrived at `at`. Returns what is wrong, once each.
    pub(crate) fn take(&mut self, stamp: u32, at: Timestamp) -> Option<Trouble> {
        self.first_at.get_or_insert(at);
        Interval::extend(&mut self.short, stamp, at);
        Interval::extend(&mut self.long, stamp, at);
        if let Some(short) = self.short.filter(|short| short.host_s() >= self.params.unit_s)
            && short.stamps >= self.params.unit_stamps
        {
            self.short = None;
            let unit = match short.rate() {
                rate if MILLISECONDS.contains(&rate) => Some(Unit::Milliseconds),
                rate if rate > MIN_MICROSECONDS => Some(Unit::Microseconds),
                _ => None,
            };
            if unit.is_some() && unit != self.unit {
                (self.unit, self.long) = (unit, None);
                return (unit == Some(Unit::Milliseconds)).then_some(Trouble::ClockCountsMilliseconds);
            }
        }
        let long = self.long.filter(|long| long.host_s() >= self.params.rate_check_s)?;
        self.long = None;
        let is_wrong = (long.rate() - 1.0).abs() > self.params.rate_tolerance && self.unit != Some(Unit::Milliseconds);
        if !is_wrong || std::mem::replace(&mut self.has_said_rate, true) {
            return None;
        }
        Some(Trouble::ClockRate(long.rate() * 1e6))
    }

    /// The stamp in microseconds.
    #[must_use]
    pub(crate) fn microseconds(&self, stamp: u32) -> u32 {
        if self.unit == Some(Unit::Milliseconds) { stamp.wrapping_mul(1_000) } else { stamp }
    }

    /// False while the unit may still turn out to be another one.
    #[must_use]
    pub(crate) fn is_known(&self, at: Timestamp) -> bool {
        self.unit.is_some() || self.first_at.is_none_or(|first| at.seconds_since(first) > UNKNOWN_S)
    }
}

impl Interval {
    fn extend(interval: &mut Option<Self>, stamp: u32, at: Timestamp) {
        let new = Self { from: (stamp, at), newest: (stamp, at), stamps: 0 };
        let Some(Self { newest: (newest, newest_at), stamps, .. }) = interval else {
            *interval = Some(new);
            return;
        };
        let ahead = stamp.wrapping_sub(*newest);
        if at.seconds_since(*newest_at) > SILENCE_S || (u32::MAX / 2..u32::MAX - LATE).contains(&ahead) {
            *interval = Some(new);
        } else if (1..u32::MAX / 2).contains(&ahead) {
            (*newest, *newest_at, *stamps) = (stamp, at, *stamps + 1);
        }
    }

    fn host_s(&self) -> f64 {
        self.newest.1.seconds_since(self.from.1)
    }

    /// Stamps per microsecond.
    fn rate(&self) -> f64 {
        f64::from(self.newest.0.wrapping_sub(self.from.0)) * 1e-6 / self.host_s()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is said of stamps every 20 ms that advance at `rate` and arrive in bursts of `burst_ms`.
    fn said(rate: f64, burst_ms: u64) -> (Vec<Trouble>, Stamps) {
        let mut stamps = Stamps::new(Params::default());
        let mut said = Vec::new();
        for ms in (0..60_000_u64).step_by(20) {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a minute in 32 bits")]
            let stamp = (7_000_000.0 + ms as f64 * 1e3 * rate) as u32;
            said.extend(stamps.take(stamp, Timestamp::from_us(ms.next_multiple_of(burst_ms) * 1_000)));
        }
        (said, stamps)
    }

    #[test]
    fn milliseconds_are_noticed_and_taken_times_1000() {
        let (troubles, stamps) = said(1e-3, 1);
        assert_eq!(troubles, [Trouble::ClockCountsMilliseconds]);
        assert_eq!(stamps.microseconds(5), 5_000);
    }

    #[test]
    fn microseconds_of_a_bad_resonator_in_bursts_are_left_alone() {
        for rate in [0.98, 1.0, 1.02] {
            for burst_ms in [1, 16, 500, 1_000] {
                let (troubles, stamps) = said(rate, burst_ms);
                assert_eq!((troubles, stamps.microseconds(5)), (Vec::new(), 5), "{rate} {burst_ms}");
            }
        }
    }

    #[test]
    fn another_rate_is_reported_once() {
        let (troubles, _) = said(0.25, 1);
        let [Trouble::ClockRate(hz)] = troubles[..] else { panic!("{troubles:?}") };
        assert!((hz - 250_000.0).abs() < 2_500.0, "{hz}");
    }
}
