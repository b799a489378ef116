//! Ranges that are ten times too short or too long: one side counts centimetres, the other millimetres.

use super::params::Params;
use slamd_protocol::{Echo, Sonar};

/// Finds such ranges before the robot's geometry is judged: no robot is ten times as large as it is taken for.
///
/// Too short: over metres of travel no reading lies beyond half a metre, while readings of several sensors change by a factor, and all
/// change by a small part of the travel. Too long: readings lie at all distances where no such sensor hears anything.
#[derive(Clone, Debug)]
pub(super) struct Decade {
    /// True over reported range.
    factor: f64,
    is_settled: bool,
    /// True where the configured sensors may reach as far as ranges that are too long.
    reaches_far: bool,
    path_m: f64,
    /// The part of the path on which both wheels rolled alike, and whether they do: in a turn, readings change without travel.
    straight_m: f64,
    is_straight: bool,
    flights: u32,
    /// Flights beyond the reach of ranges that are too short.
    beyond: u32,
    /// Flights beyond the reach of a usual sensor, and the milliseconds (from the limit on) in which they lie.
    far: u32,
    far_ms: u32,
    least_us: f64,
    sensors: Vec<Span>,
    params: Params,
}

/// What one sensor has read.
#[derive(Clone, Copy, Debug, Default)]
struct Span {
    count: u32,
    least_us: f64,
    most_us: f64,
    last_us: f64,
    varied_us: f64,
}

/// Microseconds of flight per metre of range, there and back, at 20 degrees.
const US_PER_M: f64 = 2e6 / 343.4;

impl Decade {
    /// A check of sensors that measure up to this range, metres.
    pub(super) fn new(max_range_m: f64, params: Params) -> Self {
        Self {
            factor: 1.0,
            is_settled: false,
            reaches_far: max_range_m * US_PER_M > 0.6 * f64::from(params.decade_far_us),
            path_m: 0.0,
            straight_m: 0.0,
            is_straight: false,
            flights: 0,
            beyond: 0,
            far: 0,
            far_ms: 0,
            least_us: f64::INFINITY,
            sensors: Vec::new(),
            params,
        }
    }

    /// True over reported range.
    pub(super) const fn factor(&self) -> f64 {
        self.factor
    }

    /// The wheels have rolled so far in a sweep, metres.
    pub(super) fn rolled(&mut self, left_m: f64, right_m: f64) {
        let step_m = 0.5 * (left_m.abs() + right_m.abs());
        self.path_m += step_m;
        self.is_straight =
            step_m > self.params.decade_step_m && (left_m - right_m).abs() < self.params.decade_straight * 2.0 * step_m;
        self.straight_m += if self.is_straight { step_m } else { 0.0 };
    }

    /// True while the readings do not tell whether they are ten times too short.
    pub(super) const fn is_open(&self) -> bool {
        !self.is_settled
            && self.factor <= 1.0
            && self.flights > self.params.decade_flights
            && self.beyond <= self.params.decade_beyond
    }

    /// Takes the flights of a group, microseconds by the unit of their numbers and `scale`. True if the factor changes by them.
    pub(super) fn take(&mut self, sonar: &Sonar, scale: f64) -> bool {
        if self.is_settled {
            return false;
        }
        for answer in &sonar.echoes {
            let Echo::Flight { us } = answer.echo else { continue };
            self.flight(usize::from(answer.sensor), scale * f64::from(us));
        }
        let before = self.factor;
        self.judge();
        (self.factor / before - 1.0).abs() > 0.5
    }

    fn flight(&mut self, sensor: usize, us: f64) {
        let Params { decade_near_us, decade_far_us, .. } = self.params;
        // Beyond a metre a range that was called too short is certainly right.
        let near_us = if self.factor > 1.0 { 2.0 } else { 1.0 } * f64::from(decade_near_us);
        self.flights += 1;
        self.beyond += u32::from(us > near_us);
        self.least_us = self.least_us.min(us);
        let past_ms = (us - f64::from(decade_far_us)) * 1e-3;
        if past_ms > 0.0 {
            self.far += 1;
            self.far_ms |= (0..u32::BITS).find(|ms| past_ms < f64::from(ms + 1)).map_or(0, |ms| 1 << ms);
        }
        if self.sensors.len() <= sensor {
            self.sensors.resize(sensor + 1, Span::default());
        }
        if let Some(span) = self.sensors.get_mut(sensor) {
            span.take(us, self.is_straight);
        }
    }

    fn judge(&mut self) {
        let Params { decade_flights, decade_beyond, decade_path_m, decade_end_m, .. } = self.params;
        if self.flights < decade_flights {
            return;
        }
        let has_beyond = self.beyond > decade_beyond;
        if self.factor > 1.0 {
            if has_beyond {
                (self.factor, self.is_settled) = (1.0, true);
            }
        } else if !has_beyond && self.are_short() {
            (self.factor, self.beyond) = (10.0, 0);
        } else if self.are_long() {
            (self.factor, self.is_settled) = (0.1, true);
        } else {
            let is_usual = has_beyond && self.far == 0 && self.path_m > decade_path_m;
            self.is_settled = is_usual || self.path_m > decade_end_m;
        }
    }

    fn are_short(&self) -> bool {
        let Params { decade_path_m, decade_straight_m, decade_span, decade_varied, decade_pings, .. } = self.params;
        if self.path_m < decade_path_m || self.straight_m < decade_straight_m {
            return false;
        }
        let measuring = || self.sensors.iter().filter(|span| span.count >= decade_pings);
        let count = measuring().count();
        let spread = measuring().filter(|span| span.most_us > decade_span * span.least_us).count();
        let varied_m = measuring().map(|span| span.varied_us).sum::<f64>() / US_PER_M / count.max(1) as f64;
        spread >= 3 && 2 * spread >= count && varied_m < decade_varied * self.straight_m
    }

    fn are_long(&self) -> bool {
        let Params { decade_far_share, decade_far_ms, decade_least_us, .. } = self.params;
        !self.reaches_far
            && f64::from(self.far) > decade_far_share * f64::from(self.flights)
            && self.far_ms.count_ones() >= decade_far_ms
            && self.least_us > f64::from(decade_least_us)
    }
}

impl Span {
    fn take(&mut self, us: f64, is_straight: bool) {
        if self.count == 0 {
            (self.least_us, self.most_us) = (us, us);
        } else if is_straight {
            self.varied_us += (us - self.last_us).abs();
        }
        self.count += 1;
        (self.least_us, self.most_us, self.last_us) = (self.least_us.min(us), self.most_us.max(us), us);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use slamd_protocol::SensorEcho;

    /// What the check says of a robot in a square room of `half_m` to each side that drives to and fro, whose 8 sensors read `reported`
    /// of the true range, with noise.
    fn factor(half_m: f64, reported: f64, reach_m: f64) -> f64 {
        let mut decade = Decade::new(3.0, Params::default());
        for step in 0..1_200_u32 {
            let along_m = 0.8 * half_m * (f64::from(step) * 0.025 / half_m).sin();
            let way_m = 0.8 * 0.025 * (f64::from(step) * 0.025 / half_m).cos();
            let echoes = (0..8_u8).filter_map(|sensor| {
                let (sin, cos) = (f64::from(sensor) * std::f64::consts::FRAC_PI_4).sin_cos();
                let [x_m, y_m] = [(half_m - along_m * cos.signum()) / cos.abs(), half_m / sin.abs()];
                let range_m = x_m.min(y_m) + 0.01 * f64::from(step % 3);
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a test's flight")]
                let us = (reported * range_m * US_PER_M) as u16;
                (range_m < reach_m && us < 65_000).then_some(SensorEcho { sensor, echo: Echo::Flight { us } })
            });
            let sonar = Sonar {
                t_us: 0,
                group: 0,
                last_of_cycle: true,
                left_ticks: 0,
                right_ticks: 0,
                echoes: echoes.collect(),
            };
            decade.take(&sonar, 1.0);
            decade.rolled(way_m, way_m);
        }
        decade.factor()
    }

    #[test]
    fn a_tenth_and_tenfold_are_found_and_right_ranges_left_alone() {
        for (reported, expected) in [(0.1, 10.0), (0.05, 10.0), (1.0, 1.0), (0.5, 1.0), (2.0, 1.0), (10.0, 0.1)] {
            let found = factor(1.2, reported, 3.0);
            assert!((found / expected - 1.0).abs() < 1e-9, "{reported}: {found}");
        }
    }

    #[test]
    fn a_narrow_place_is_no_wrong_unit() {
        for half_m in [0.2, 0.25, 0.3] {
            let found = factor(half_m, 1.0, 3.0);
            assert!((found - 1.0).abs() < 1e-9, "{half_m} m: {found}");
        }
    }
}
