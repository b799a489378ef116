//! Straight lines in a set of points: the Hough transform.
//!
//! A line is x cos(theta) + y sin(theta) = rho, theta in [0, π). Each point votes for every line through it, in an accumulator of
//! 2 degrees by 5 cm; a peak is two neighbouring columns of rho, so that no wall is lost between two. A peak is then refined by
//! a total least-squares line through its voters, because a ring's few endpoints do not fill a cell; the voters leave
//! the accumulator and the next peak is sought.
//!
//! Failure cases: fewer points than asked for, or none in line, give no line. Points that are not finite or out of the accumulator's
//! radius do not vote. Of more than 2048 points every second, third, ... votes, which bounds the time.

use crate::params::Params;
use nalgebra::Vector2;
use slamd_core::Point;
use std::f64::consts::{FRAC_PI_2, PI};

/// One line.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Line {
    /// Direction of its normal, radians in [0, π).
    pub theta_rad: f64,
    /// Its distance from the origin along the normal, metres, of either sign.
    pub rho_m: f64,
    /// The points on it.
    pub votes: usize,
}

impl Line {
    /// Its unit normal.
    #[must_use]
    pub fn normal(&self) -> Vector2<f64> {
        let (sin, cos) = libm::sincos(self.theta_rad);
        Vector2::new(cos, sin)
    }
}

/// The accumulator, reused from call to call.
#[derive(Clone, Debug)]
pub struct HoughLines {
    radius_m: f64,
    /// Points this near are on the line, metres.
    band_m: f64,
    /// Times that a line is fitted anew to the points near it.
    refinements: usize,
    columns: usize,
    /// (cos, sin) of each row's theta.
    rows: Vec<(f64, f64)>,
    votes: Vec<u16>,
    /// The points that still vote.
    voters: Vec<Point>,
    lines: Vec<Line>,
}

const ROWS: usize = 90;
const RHO_M: f64 = 0.05;
const MAX_VOTERS: usize = 2048;

impl HoughLines {
    /// An accumulator for points up to `radius_m` from the origin.
    #[must_use]
    pub fn new(radius_m: f64) -> Self {
        Self::with_params(radius_m, &Params::default())
    }

    /// The same with other constants.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a radius of metres, at least 0")]
    pub fn with_params(radius_m: f64, params: &Params) -> Self {
        let columns = (2.0 * radius_m.max(0.0) / RHO_M).ceil() as usize + 2;
        let row = |row: usize| {
            let (sin, cos) = libm::sincos(PI * row as f64 / ROWS as f64);
            (cos, sin)
        };
        Self {
            radius_m,
            band_m: params.band_m,
            refinements: params.refinements,
            columns,
            rows: (0..ROWS).map(row).collect(),
            votes: vec![0; ROWS * columns],
            voters: Vec::with_capacity(MAX_VOTERS),
            lines: Vec::new(),
        }
    }

    /// The strongest lines of `points`, at most `most` of them with at least `least_votes` points each, strongest peak first.
    pub fn find(&mut self, points: &[Point], least_votes: usize, most: usize) -> &[Line] {
        self.lines.clear();
        self.voters.clear();
        self.votes.fill(0);
        let stride = points.len().div_ceil(MAX_VOTERS).max(1);
        let radius2 = self.radius_m * self.radius_m;
        self.voters.extend(points.iter().step_by(stride).filter(|point| point.coords.norm_squared() < radius2));
        self.vote(0, |votes| *votes += 1);

        let least_votes = least_votes.div_ceil(stride).max(2);
        while self.lines.len() < most {
            let Some(peak) = self.peak(least_votes) else { break };
            let Some(line) = self.refine(peak) else { break };
            let taken = self.take_voters(&line);
            if taken == 0 {
                break;
            }
            if taken >= least_votes {
                self.lines.push(Line { votes: taken * stride, ..line });
            }
        }
        &self.lines
    }

    /// The lines of the last [`HoughLines::find`].
    #[must_use]
    pub fn lines(&self) -> &[Line] {
        &self.lines
    }

    /// Every voter from `from` on changes every cell it votes for.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "voters are inside the radius")]
    fn vote(&mut self, from: usize, change: impl Fn(&mut u16)) {
        let half = 0.5 * (self.columns - 2) as f64;
        for (&(cos, sin), votes) in self.rows.iter().zip(self.votes.chunks_exact_mut(self.columns)) {
            let (cos, sin) = (cos / RHO_M, sin / RHO_M);
            for voter in &self.voters[from..] {
                let column = (cos * voter.x + sin * voter.y + half) as u32 as usize;
                if let Some(cell) = votes.get_mut(column) {
                    change(cell);
                }
            }
        }
    }

    /// The strongest pair of neighbouring columns.
    fn peak(&self, least_votes: usize) -> Option<Line> {
        let mut best = (least_votes.saturating_sub(1), None);
        for (row, votes) in self.votes.chunks_exact(self.columns).enumerate() {
            for (column, pair) in votes.windows(2).enumerate() {
                let sum = usize::from(pair[0]) + usize::from(pair[1]);
                if sum > best.0 {
                    best = (sum, Some((row, column)));
                }
            }
        }
        let (row, column) = best.1?;
        let half = 0.5 * (self.columns - 2) as f64;
        let rho_m = ((column + 1) as f64 - half) * RHO_M;
        Some(Line { theta_rad: PI * row as f64 / ROWS as f64, rho_m, votes: best.0 })
    }

    /// The total least-squares line through the voters near `line`; none where they do not define one.
    fn refine(&self, mut line: Line) -> Option<Line> {
        for _ in 0..self.refinements {
            let n = line.normal();
            let near = || self.voters.iter().filter(|voter| (n.dot(&voter.coords) - line.rho_m).abs() < self.band_m);
            let count = near().count() as f64;
            if count < 2.0 {
                return None;
            }
            let mean = near().fold(Point::origin(), |sum, voter| sum + voter.coords / count);
            let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
            for voter in near() {
                let d = voter - mean;
                xx += d.x * d.x;
                xy += d.x * d.y;
                yy += d.y * d.y;
            }
            let along = 0.5 * libm::atan2(2.0 * xy, xx - yy);
            line.theta_rad = along + FRAC_PI_2;
            if line.theta_rad >= PI {
                line.theta_rad -= PI;
            }
            line.rho_m = line.normal().dot(&mean.coords);
        }
        Some(line)
    }

    /// Removes the line's voters and their votes; how many they were.
    fn take_voters(&mut self, line: &Line) -> usize {
        let n = line.normal();
        let mut kept = 0;
        for index in 0..self.voters.len() {
            let voter = self.voters[index];
            if (n.dot(&voter.coords) - line.rho_m).abs() >= self.band_m {
                self.voters.swap(kept, index);
                kept += 1;
            }
        }
        self.vote(kept, |votes| *votes -= 1);
        let taken = self.voters.len() - kept;
        self.voters.truncate(kept);
        taken
    }
}

/// The difference of two line directions, `to` − `from`, radians in (−π/2, π/2]: a line looks the same turned by π.
#[must_use]
pub fn turn_between(from_rad: f64, to_rad: f64) -> f64 {
    let half_turns = libm::floor((to_rad - from_rad) / PI + 0.5);
    let turn = to_rad - from_rad - half_turns * PI;
    if turn <= -FRAC_PI_2 { turn + PI } else { turn }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use slamd_core::Pose2;

    /// A 4 by 2.4 m rectangle about (0.3, 0.2), points every 5 cm; `noise(i)` is across the wall, metres.
    fn rectangle(noise: impl Fn(usize) -> f64) -> Vec<Point> {
        let mut points = Vec::new();
        for step in 0..=80 {
            let along = -2.0 + 0.05 * f64::from(step);
            points.push(Point::new(0.3 + along, 1.4 + noise(points.len())));
            points.push(Point::new(0.3 + along, -1.0 + noise(points.len())));
        }
        for step in 0..=48 {
            let along = -1.2 + 0.05 * f64::from(step);
            points.push(Point::new(2.3 + noise(points.len()), 0.2 + along));
            points.push(Point::new(-1.7 + noise(points.len()), 0.2 + along));
        }
        points
    }

    /// Spread evenly over ±4 cm, in no order.
    fn scatter(index: usize) -> f64 {
        0.08 * ((index * 37 % 101) as f64 / 100.0 - 0.5)
    }

    #[test]
    fn finds_the_walls_of_a_noisy_rectangle() {
        let mut hough = HoughLines::new(4.0);
        let lines = hough.find(&rectangle(scatter), 25, 8);
        assert_eq!(lines.len(), 4, "{lines:?}");
        for (theta, rho) in [(0.0, -1.7), (FRAC_PI_2, -1.0), (FRAC_PI_2, 1.4), (0.0, 2.3)] {
            let found = lines.iter().any(|line| {
                // A normal just below π is the one at 0 with rho of the other sign.
                let flip = if line.theta_rad - theta > FRAC_PI_2 { -1.0 } else { 1.0 };
                turn_between(theta, line.theta_rad).abs() < 0.015 && (flip * line.rho_m - rho).abs() < 0.02
            });
            assert!(found, "{theta} {rho}: {lines:?}");
        }
    }

    proptest! {
        #[test]
        fn turning_the_world_turns_the_strongest_line(delta in -1.5..1.5f64) {
            let wall: Vec<Point> = (0..60).map(|i| Point::new(0.05 * f64::from(i) - 1.0, 1.1)).collect();
            let turn = Pose2::new(0.0, 0.0, delta);
            let turned: Vec<Point> = wall.iter().map(|point| turn.transform(*point)).collect();
            let mut hough = HoughLines::new(4.0);
            let before = hough.find(&wall, 10, 1)[0];
            let after = hough.find(&turned, 10, 1)[0];
            prop_assert!((turn_between(before.theta_rad, after.theta_rad) - delta).abs() < 1e-6);
            prop_assert_eq!((before.votes, after.votes), (60, 60));
        }

        #[test]
        fn any_points_are_harmless(points in prop::collection::vec((-9.0..9.0f64, -9.0..9.0f64), 0..60)) {
            let mut points: Vec<Point> = points.into_iter().map(|(x, y)| Point::new(x, y)).collect();
            points.push(Point::new(f64::NAN, 1.0));
            let mut hough = HoughLines::new(4.0);
            prop_assert!(hough.find(&points, 3, 5).iter().all(|line| (0.0..PI).contains(&line.theta_rad)));
            prop_assert!(hough.votes.iter().map(|v| usize::from(*v)).sum::<usize>() <= ROWS * hough.voters.len());
        }
    }

    #[test]
    fn many_points_are_thinned_and_counted_whole() {
        let wall: Vec<Point> = (0..20_000).map(|i| Point::new(1e-4 * f64::from(i), 0.5)).collect();
        let line = HoughLines::new(4.0).find(&wall, 100, 3)[0];
        assert!((line.rho_m - 0.5).abs() < 1e-9 && line.votes >= 19_980);
    }

    #[test]
    fn a_line_turned_by_half_is_itself() {
        assert!(turn_between(0.01, PI - 0.01) + 0.02 < 1e-12);
        assert!((turn_between(0.0, FRAC_PI_2) - FRAC_PI_2).abs() < 1e-12);
    }
}
