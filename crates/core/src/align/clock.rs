//! Board clock → host clock.
//!
//! The board stamps with 32 bits of microseconds that wrap every 71.6 minutes, from a resonator that is off by up to one per cent.
//! [`Widener`] removes the wrap. [`ClockMap`] fits offset and rate.
//!
//! A round trip is a pair of bounds on `host − board`: a request is received after it was sent, and an answer arrives after it was
//! given. What delays them (a USB bridge holds bytes for up to 16 ms) only loosens the bounds. So of all rates the one is taken that
//! leaves the widest strip between the bounds of the last minute, and the line in its middle is wrong by no more than half the
//! difference of the least delays there and back. (The idea of Zhang, Liu and Xia, "Clock synchronization algorithms for network
//! measurements", INFOCOM 2002.) Where the board answers nothing, a line through the least delayed arrivals has to do.

use crate::time::{DeviceTime, Timestamp};
use std::collections::VecDeque;

/// Widens the board's 32-bit microseconds.
#[derive(Clone, Debug, Default)]
pub struct Widener {
    newest: Option<DeviceTime>,
}

/// A stamp further back than this is no late message but a board that began anew.
const RESET_BACK_US: i64 = 1_000_000;

impl Widener {
    /// The board time that `t_us` stands for, given what came before; `None` where the clock has jumped back: the board has restarted.
    pub fn widen(&mut self, t_us: u32) -> Option<DeviceTime> {
        // The first stamp is put one wrap up, so that a message stamped a little earlier still has a time.
        let newest = self.newest.unwrap_or_else(|| DeviceTime::from_us((1 << 32) + u64::from(t_us)));
        #[expect(clippy::cast_possible_truncation, reason = "the low half is meant")]
        let step = i64::from(t_us.wrapping_sub(newest.us() as u32).cast_signed());
        if step < -RESET_BACK_US {
            return None;
        }
        let time = DeviceTime::from_us(newest.us().saturating_add_signed(step));
        self.newest = Some(newest.max(time));
        Some(time)
    }

    /// Forgets the board's past after a restart.
    pub fn reset(&mut self) {
        *self = Self::default();
    }
}

/// A message's arrival: `host − board` is less than this.
#[derive(Clone, Copy, Debug)]
struct Arrival {
    board_s: f64,
    offset_s: f64,
}

/// A round trip: `host − board` is at least `low_s` where the request was received and at most `high_s` where it was answered.
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
    /// The rate before anything has been measured: that of the board's former life.
    rate: f64,
}

/// `host = board + offset + rate * (board − at)`.
#[derive(Clone, Copy, Debug)]
struct Line {
    at_s: f64,
    offset_s: f64,
    rate: f64,
}

/// What is older than this says nothing of now: resonators warm up.
const WINDOW_S: f64 = 60.0;
/// Most round trips kept.
const MAX_TRIPS: usize = 256;
/// Not even a rate learnt within a second lets the board's clock run ahead by so much, seconds.
const MAX_AHEAD_S: f64 = 0.2;
/// No board is off by more.
const MAX_RATE: f64 = 0.02;
/// What speaks for the rate known before: a rate that differs from it by 1 % must leave a strip this much wider, seconds.
const RATE_PRIOR_S: f64 = 3e-4;
/// The rate through arrivals alone is drawn towards the one known before as by this much, seconds squared.
const ARRIVAL_PRIOR_S2: f64 = 30.0;

impl ClockMap {
    /// A message stamped `board` has arrived at `host`.
    pub fn arrived(&mut self, board: DeviceTime, host: Timestamp) {
        let new = Arrival { board_s: board.seconds(), offset_s: host.seconds() - board.seconds() };
        // Of arrivals in one second the earliest, relative to its stamp, was delayed least.
        match self.arrivals.back_mut() {
            Some(last) if new.board_s.floor() <= last.board_s.floor() => {
                if new.offset_s >= last.offset_s {
                    return;
                }
                *last = new;
            }
            _ => self.arrivals.push_back(new),
        }
        while self.arrivals.front().is_some_and(|oldest| new.board_s - oldest.board_s > WINDOW_S) {
            self.arrivals.pop_front();
        }
        if self.trips.is_empty() {
            self.line = Some(through(&self.arrivals, self.rate));
        }
    }

    /// A request that left at `sent` was received and answered by the board at `received` and `answered`; the answer came at `host`.
    pub fn round_trip(&mut self, sent: Timestamp, received: DeviceTime, answered: DeviceTime, host: Timestamp) {
        let trip_s = host.seconds_since(sent) - answered.seconds_since(received);
        if !(0.0..1.0).contains(&trip_s) {
            return;
        }
        self.trips.push_back(RoundTrip {
            received_s: received.seconds(),
            low_s: sent.seconds() - received.seconds(),
            answered_s: answered.seconds(),
            high_s: host.seconds() - answered.seconds(),
        });
        let is_old = |oldest: &RoundTrip| answered.seconds() - oldest.answered_s > WINDOW_S;
        while self.trips.len() > MAX_TRIPS || self.trips.front().is_some_and(is_old) {
            self.trips.pop_front();
        }
        self.line = Some(widest(&self.trips, self.rate));
    }

    /// Host time of an instant of the board; none before the first message.
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

    /// True where a message stamped `board` cannot have arrived at `host` already: one of the clocks has stood still, or has jumped.
    #[must_use]
    pub fn is_impossible(&self, board: DeviceTime, host: Timestamp) -> bool {
        self.host_time(board).is_some_and(|sent| sent.seconds_since(host) > MAX_AHEAD_S)
    }

    /// Forgets the past after a restart or a jump; the board's resonator is the same one.
    pub fn reset(&mut self) {
        *self = Self { rate: self.line.map_or(self.rate, |line| line.rate), ..Self::default() };
    }
}

/// The middle of the widest strip between the bounds. The strip's width is a concave function of the rate: a ternary search finds
/// its maximum.
fn widest(trips: &VecDeque<RoundTrip>, rate: f64) -> Line {
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
        high_s - low_s - RATE_PRIOR_S * ((candidate - rate) / 0.01).powi(2)
    };
    let (mut least, mut most) = (-MAX_RATE, MAX_RATE);
    // (2/3)^36 of the range is a hundredth of a part per million.
    for _ in 0..36 {
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

/// The line through the arrivals by least squares.
fn through(arrivals: &VecDeque<Arrival>, rate: f64) -> Line {
    let count = arrivals.len().max(1) as f64;
    let at_s = arrivals.iter().map(|arrival| arrival.board_s).sum::<f64>() / count;
    let offset_s = arrivals.iter().map(|arrival| arrival.offset_s).sum::<f64>() / count;
    let (mut xx, mut xy) = (ARRIVAL_PRIOR_S2, ARRIVAL_PRIOR_S2 * rate);
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

    /// A session with a board whose clock is off by `drift`, wraps after ten minutes and restarts after half of `length_s`, behind a
    /// bridge that delays what comes from the board by up to `jitter_us`: the 99th percentile of the error of a ping's host time, ms.
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
                // The first second after a start is for asking; no sweep is used as early as that.
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
            // Where a bridge holds each message for up to 16 ms, and beyond.
            for (jitter_us, bound_ms) in [(1_000, 0.7), (16_000, 2.0), (20_000, 3.0)] {
                for length_s in [60, 1_800] {
                    let error_ms = p99_error_ms(drift, jitter_us, length_s);
                    assert!(error_ms < bound_ms, "drift {drift}, jitter {jitter_us} us, {length_s} s: {error_ms} ms");
                }
            }
        }
    }
}
