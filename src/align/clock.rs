//! Board clock → host clock.
//!
//! The board stamps with 32 bits of microseconds that wrap every 71.6 minutes, from a resonator that is off by up to one per cent.
//! [`Widener`] removes the wrap. [`ClockMap`] fits offset and rate: over the last minute it keeps one sample of
//! `host − board` a second, the one that was delayed least, and draws a line through them. A time response bounds the delay from
//! both sides (half its round trip); where the board answers none, the least delayed arrival has to do.

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

/// One second's best observation of `host − board`.
#[derive(Clone, Copy, Debug)]
struct Sample {
    second: u64,
    board_s: f64,
    offset_s: f64,
    delay_s: f64,
}

/// Host time as a function of board time.
#[derive(Clone, Debug, Default)]
pub struct ClockMap {
    one_way: VecDeque<Sample>,
    two_way: VecDeque<Sample>,
    line: Option<Line>,
}

/// `host = board + offset + slope * (board − at)`.
#[derive(Clone, Copy, Debug)]
struct Line {
    at_s: f64,
    offset_s: f64,
    slope: f64,
}

/// Samples kept: one a second for a minute.
const WINDOW: usize = 60;
/// The rate is fitted once the samples span this long; a shorter line would follow the jitter.
const FIT_SPAN_S: f64 = 8.0;
/// A round trip this much above the least one counts a quarter.
const TRIP_SCALE_S: f64 = 1e-3;

impl ClockMap {
    /// A message stamped `board` has arrived at `host`.
    pub fn arrived(&mut self, board: DeviceTime, host: Timestamp) {
        let offset_s = host.seconds() - board.seconds();
        // Of arrivals in one second the earliest, relative to its stamp, was delayed least.
        let is_news = keep(&mut self.one_way, Sample::new(board.seconds(), offset_s, offset_s));
        if is_news && self.two_way.is_empty() {
            self.line = fit(&self.one_way, |_| 1.0);
        }
    }

    /// A request that left at `sent` was received and answered by the board at `received` and `answered`; the answer came at `host`.
    pub fn round_trip(&mut self, sent: Timestamp, received: DeviceTime, answered: DeviceTime, host: Timestamp) {
        let trip_s = host.seconds_since(sent) - answered.seconds_since(received);
        if !(0.0..1.0).contains(&trip_s) {
            return;
        }
        let board_s = 0.5 * (received.seconds() + answered.seconds());
        let offset_s = 0.5 * (sent.seconds() + host.seconds()) - board_s;
        if keep(&mut self.two_way, Sample::new(board_s, offset_s, trip_s)) {
            let least_s = self.two_way.iter().map(|sample| sample.delay_s).fold(f64::INFINITY, f64::min);
            self.line = fit(&self.two_way, |sample| (1.0 + (sample.delay_s - least_s) / TRIP_SCALE_S).powi(-2));
        }
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
        let host_s = board.seconds() + line.offset_s + line.slope * (board.seconds() - line.at_s);
        Some(Timestamp::from_us((host_s * 1e6).max(0.0).round() as u64))
    }

    /// Forgets the board's past after a restart.
    pub fn reset(&mut self) {
        *self = Self::default();
    }
}

impl Sample {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "board time is not negative")]
    fn new(board_s: f64, offset_s: f64, delay_s: f64) -> Self {
        Self { second: board_s as u64, board_s, offset_s, delay_s }
    }
}

/// Keeps the least delayed sample of each second; false where `new` is not it.
fn keep(samples: &mut VecDeque<Sample>, new: Sample) -> bool {
    match samples.back_mut() {
        Some(last) if new.second <= last.second => {
            let is_better = new.second == last.second && new.delay_s < last.delay_s;
            if is_better {
                *last = new;
            }
            is_better
        }
        _ => {
            if samples.len() == WINDOW {
                samples.pop_front();
            }
            samples.push_back(new);
            true
        }
    }
}

/// Weighted least squares through the samples; the least delayed one alone while they are few.
fn fit(samples: &VecDeque<Sample>, weight: impl Fn(&Sample) -> f64) -> Option<Line> {
    let (first, last) = (samples.front()?, samples.back()?);
    if last.board_s - first.board_s < FIT_SPAN_S {
        let best = samples.iter().min_by(|a, b| a.delay_s.total_cmp(&b.delay_s))?;
        return Some(Line { at_s: best.board_s, offset_s: best.offset_s, slope: 0.0 });
    }
    let total: f64 = samples.iter().map(&weight).sum();
    let at_s = samples.iter().map(|s| weight(s) * s.board_s).sum::<f64>() / total;
    let offset_s = samples.iter().map(|s| weight(s) * s.offset_s).sum::<f64>() / total;
    let (mut xx, mut xy) = (0.0, 0.0);
    for s in samples {
        let dx = s.board_s - at_s;
        xx += weight(s) * dx * dx;
        xy += weight(s) * dx * (s.offset_s - offset_s);
    }
    Some(Line { at_s, offset_s, slope: xy / xx })
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

    /// A board 0.9 % fast, answers with up to 16 ms of latency on the way back.
    fn error_ms(round_trips: bool) -> f64 {
        let mut map = ClockMap::default();
        let mut noise: u64 = 1;
        let mut worst: f64 = 0.0;
        for ms in (0..60_000u64).step_by(20) {
            noise = noise.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let latency_us = 1_000 + (noise >> 33) % 16_000;
            let board = DeviceTime::from_us(7_000_000 + ms * 1_009);
            map.arrived(board, Timestamp::from_us(ms * 1_000 + latency_us));
            if round_trips && ms % 1_000 == 0 {
                let sent = Timestamp::from_us((ms * 1_000).saturating_sub(800));
                map.round_trip(sent, board, board, Timestamp::from_us(ms * 1_000 + latency_us));
            }
            if ms > 30_000 {
                let host = map.host_time(board).unwrap();
                worst = worst.max((host.seconds() - ms as f64 * 1e-3).abs() * 1e3);
            }
        }
        worst
    }

    #[test]
    fn a_fast_board_is_followed() {
        // A latency that is always there cannot be seen without round trips.
        assert!(error_ms(false) < 5.0, "{} ms with arrivals only", error_ms(false));
        assert!(error_ms(true) < 6.0, "{} ms with round trips", error_ms(true));
    }
}
