//! Board clock → host clock.
//!
//! The board's stamps are 32 bits of microseconds. They wrap every 71.6 minutes and come from a resonator with an error of up
//! to 1 %. [`Widener`] removes the wrap. [`ClockMap`] fits offset and rate.
//!
//! A round trip bounds `host − board` from both sides: the board receives a request after it was sent, and the answer arrives
//! after it was given. Delays (a USB bridge holds bytes for up to 16 ms) only loosen the bounds. [`ClockMap`] chooses the rate
//! that leaves the widest strip between the bounds of the last minute. The line in the strip's middle is wrong by at most half
//! the difference of the minimum delays there and back. (After Zhang, Liu and Xia, "Clock synchronization algorithms for
//! network measurements", INFOCOM 2002.) If the board does not answer, a line through the least delayed arrivals serves.

use super::params::Params;
use crate::time::{DeviceTime, Timestamp};
use std::collections::VecDeque;

/// Widens the board's 32-bit microseconds.
#[derive(Clone, Debug, Default)]
pub struct Widener {
    newest: Option<DeviceTime>,
    params: Params,
}

impl Widener {
    /// A widener that has seen no stamp.
    #[must_use]
    pub fn new(params: Params) -> Self {
        Self { newest: None, params }
    }

    /// Board time of the stamp `t_us`, given the stamps before; `None` if the clock jumped back, so the board restarted.
    pub fn widen(&mut self, t_us: u32) -> Option<DeviceTime> {
        // The first stamp gets one wrap, so that a message with a slightly earlier stamp still has a time.
        let newest = self.newest.unwrap_or_else(|| DeviceTime::from_us((1 << 32) + u64::from(t_us)));
        #[expect(clippy::cast_possible_truncation, reason = "the low half is meant")]
        let step = i64::from(t_us.wrapping_sub(newest.us() as u32).cast_signed());
        if step < -self.params.reset_back_us {
            return None;
        }
        let time = DeviceTime::from_us(newest.us().saturating_add_signed(step));
        self.newest = Some(newest.max(time));
        Some(time)
    }

    /// The newest board time; none before the first stamp.
    pub(crate) fn newest(&self) -> Option<DeviceTime> {
        self.newest
    }

    /// Forgets all stamps after a restart.
    pub fn reset(&mut self) {
        self.newest = None;
    }
}

/// A message's arrival: an upper bound of `host − board`.
#[derive(Clone, Copy, Debug)]
struct Arrival {
    board_s: f64,
    offset_s: f64,
}

/// A round trip: `host − board` is at least `low_s` at `received_s` and at most `high_s` at `answered_s`.
#[derive(Clone, Copy, Debug)]
struct RoundTrip {
    received_s: f64,
    low_s: f64,
    answered_s: f64,
    high_s: f64,
}

/// Host time as a function of board time.
#[derive(Clone, Debug, Default)]
pub struct ClockMap {
    /// The least delayed arrival of each second.
    arrivals: VecDeque<Arrival>,
    trips: VecDeque<RoundTrip>,
    line: Option<Line>,
    /// The rate before the first measurement: the one from before the last reset.
    rate: f64,
    params: Params,
}

/// `host = board + offset + rate * (board − at)`.
#[derive(Clone, Copy, Debug)]
struct Line {
    at_s: f64,
    offset_s: f64,
    rate: f64,
}

impl ClockMap {
    /// A map without measurements.
    #[must_use]
    pub fn new(params: Params) -> Self {
        Self { params, ..Self::default() }
    }

    /// A message stamped `board` arrived at `host`.
    pub fn arrived(&mut self, board: DeviceTime, host: Timestamp) {
        let new = Arrival { board_s: board.seconds(), offset_s: host.seconds() - board.seconds() };
        // Of the arrivals in one second keep the least delayed one.
        match self.arrivals.back_mut() {
            Some(last) if new.board_s.floor() <= last.board_s.floor() => {
                if new.offset_s >= last.offset_s {
                    return;
                }
                *last = new;
            }
            _ => self.arrivals.push_back(new),
        }
        while self.arrivals.front().is_some_and(|oldest| new.board_s - oldest.board_s > self.params.window_s) {
            self.arrivals.pop_front();
        }
        if self.trips.is_empty() {
            self.line = Some(through(&self.arrivals, self.rate, &self.params));
        }
    }

    /// The board received a request sent at `sent`, answered it, and the answer arrived at `host`.
    pub fn round_trip(&mut self, sent: Timestamp, received: DeviceTime, answered: DeviceTime, host: Timestamp) {
        let trip_s = host.seconds_since(sent) - answered.seconds_since(received);
        if !(0.0..self.params.max_trip_s).contains(&trip_s) {
            return;
        }
        if !self.trips.is_empty() && self.contradicts(sent, received, host) {
            self.reset();
        }
        self.trips.push_back(RoundTrip {
            received_s: received.seconds(),
            low_s: sent.seconds() - received.seconds(),
            answered_s: answered.seconds(),
            high_s: host.seconds() - answered.seconds(),
        });
        let Params { window_s, max_trips, .. } = self.params;
        let is_old = |oldest: &RoundTrip| answered.seconds() - oldest.answered_s > window_s;
        while self.trips.len() > max_trips || self.trips.front().is_some_and(is_old) {
            self.trips.pop_front();
        }
        self.line = Some(widest(&self.trips, self.rate, &self.params));
    }

    /// Host time of a board time; none before the first message.
    #[must_use]
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped at zero; a session is shorter than 2^53 us"
    )]
    pub fn host_time(&self, board: DeviceTime) -> Option<Timestamp> {
        let line = self.line?;
        let host_s = board.seconds() + line.offset_s + line.rate * (board.seconds() - line.at_s);
        Some(Timestamp::from_us((host_s * 1e6).max(0.0).round() as u64))
    }

    /// True if a message stamped `board` cannot have arrived at `host` yet: one of the clocks stopped or jumped.
    #[must_use]
    pub fn is_impossible(&self, board: DeviceTime, host: Timestamp) -> bool {
        self.host_time(board).is_some_and(|sent| sent.seconds_since(host) > self.params.max_ahead_s)
    }

    /// True if the line puts `received` outside the trip from `sent` to `host`: one of the clocks was set.
    fn contradicts(&self, sent: Timestamp, received: DeviceTime, host: Timestamp) -> bool {
        let bound_s = self.params.max_ahead_s;
        let is_outside = |at: Timestamp| sent.seconds_since(at) > bound_s || at.seconds_since(host) > bound_s;
        self.host_time(received).is_some_and(is_outside)
    }

    /// Forgets the measurements after a restart or a jump. Keeps the rate: the resonator is the same.
    pub fn reset(&mut self) {
        let rate = self.line.map_or(self.rate, |line| line.rate);
        *self = Self { rate, ..Self::new(self.params) };
    }
}

/// The middle of the widest strip between the bounds. The strip's width is a concave function of the rate, so a ternary search
/// finds its maximum.
fn widest(trips: &VecDeque<RoundTrip>, rate: f64, params: &Params) -> Line {
    let at_s = trips.back().map_or(0.0, |newest| newest.answered_s);
    let bounds = |rate: f64| {
        let (mut low_s, mut high_s) = (f64::NEG_INFINITY, f64::INFINITY);
        for trip in trips {
            low_s = low_s.max(trip.low_s - rate * (trip.received_s - at_s));
            high_s = high_s.min(trip.high_s - rate * (trip.answered_s - at_s));
        }
        (low_s, high_s)
    };
    let merit = |candidate: f64| {
        let (low_s, high_s) = bounds(candidate);
        high_s - low_s - params.rate_prior_s * ((candidate - rate) / 0.01).powi(2)
    };
    let (mut least, mut most) = (-params.max_rate, params.max_rate);
    for _ in 0..params.search_steps {
        let (a, b) = (least + (most - least) / 3.0, most - (most - least) / 3.0);
        if merit(a) < merit(b) {
            least = a;
        } else {
            most = b;
        }
    }
    let rate = 0.5 * (least + most);
    let (low_s, high_s) = bounds(rate);
    Line { at_s, offset_s: 0.5 * (low_s + high_s), rate }
}

/// Least-squares line through the arrivals.
fn through(arrivals: &VecDeque<Arrival>, rate: f64, params: &Params) -> Line {
    let count = arrivals.len().max(1) as f64;
    let at_s = arrivals.iter().map(|arrival| arrival.board_s).sum::<f64>() / count;
    let offset_s = arrivals.iter().map(|arrival| arrival.offset_s).sum::<f64>() / count;
    let (mut xx, mut xy) = (params.arrival_prior_s2, params.arrival_prior_s2 * rate);
    for arrival in arrivals {
        let dx = arrival.board_s - at_s;
        xx += dx * dx;
        xy += dx * (arrival.offset_s - offset_s);
    }
    Line { at_s, offset_s, rate: xy / xx }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_wrap_is_invisible() {
        let mut widener = Widener::default();
        let a = widener.widen(u32::MAX - 10_000).unwrap();
        let b = widener.widen(15_000).unwrap();
        assert_eq!(b.us() - a.us(), 25_001);
    }

    #[test]
    fn a_late_message_is_earlier_and_a_restart_is_told() {
        let mut widener = Widener::default();
        let a = widener.widen(5_000_000).unwrap();
        let b = widener.widen(4_980_000).unwrap();
        assert_eq!(a.us() - b.us(), 20_000);
        assert_eq!(widener.widen(1_000), None);
    }

    /// 99th percentile of the error of a ping's host time, ms. The board's clock has the rate error `drift`, wraps after ten
    /// minutes and restarts after half of `length_s`. A bridge delays its messages by up to `jitter_us`.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the low 32 bits of a positive time")]
    fn p99_error_ms(drift: f64, jitter_us: u64, length_s: u64) -> f64 {
        let mut map = ClockMap::default();
        let mut widener = Widener::default();
        let mut noise: u64 = 1;
        let mut errors_ms = Vec::new();
        let mut boot_us = u64::from(u32::MAX) - 600_000_000;
        for ms in (0..length_s * 1_000).step_by(5) {
            if ms == length_s * 500 {
                boot_us = 0;
                widener.reset();
                map.reset();
            }
            let since_boot_ms = ms % (length_s * 500);
            let clock_us = |us: u64| (boot_us + us + (us as f64 * drift) as u64) as u32;
            noise = noise.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let (now_us, latency_us) = (ms * 1_000, (noise >> 33) % jitter_us);
            let asks = ms % 500 == 0 || (since_boot_ms < 3_000 && ms % 50 == 0);
            if asks {
                let board = widener.widen(clock_us(now_us)).unwrap();
                // Nine bytes there, after up to a millisecond in the queue, and seventeen back at 115200 baud.
                let sent = Timestamp::from_us(now_us.saturating_sub(780 + (noise >> 20) % 1_000));
                map.round_trip(sent, board, board, Timestamp::from_us(now_us + 1_480 + latency_us));
            }
            if ms % 25 == 0 && ms >= 25 {
                let board = widener.widen(clock_us(now_us - 25_000)).unwrap();
                map.arrived(board, Timestamp::from_us(now_us + 3_000 + latency_us));
                // No sweep is used in the first second after a start.
                if since_boot_ms > 1_000 {
                    let error_us = map.host_time(board).unwrap().us().abs_diff(now_us - 25_000);
                    errors_ms.push(error_us as f64 * 1e-3);
                }
            }
        }
        errors_ms.sort_by(f64::total_cmp);
        errors_ms[errors_ms.len() * 99 / 100]
    }

    #[test]
    fn a_ping_is_dated_within_2_ms() {
        for drift in [-0.009, 0.0, 0.0005, 0.009] {
            // Bridges hold a message for up to 16 ms; one case is worse.
            for (jitter_us, bound_ms) in [(1_000, 0.7), (16_000, 2.0), (20_000, 3.0)] {
                for length_s in [60, 1_800] {
                    let error_ms = p99_error_ms(drift, jitter_us, length_s);
                    assert!(error_ms < bound_ms, "drift {drift}, jitter {jitter_us} us, {length_s} s: {error_ms} ms");
                }
            }
        }
    }
}
