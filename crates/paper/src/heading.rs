//! The paper's heading: lines of the local map against lines of the current endpoints.
//!
//! dtheta is the least change of orientation that lays the endpoints' strongest line on a line of the local map (equation 7), and
//! theta = theta(t−1) + dtheta (equation 8). Where |dtheta| exceeds what the robot can turn in one step,
//! max_turn_rate · dt, the old heading is kept (equation 9), and so it is where either side shows no line.
//!
//! **Literal: the encoders are not used.** A step turns no more than half the angle between two walls, or the wrong wall is
//! the nearest; and while no line is seen the robot is believed not to turn. With cone beams, whose endpoints lie on
//! arcs rather than on walls, 300 to 600 s of driving on a simulator ended at 99 to 106 degrees of heading RMSE: the heading is lost. With
//! point beams and walls always in range it holds.

use super::hough::{HoughLines, Line, turn_between};
use crate::params::Params;
use slamd_core::{Point, wrap_angle};
use std::f64::consts::PI;

/// Variance of a heading that may be anything, square radians.
const UNKNOWN_RAD2: f64 = PI * PI / 3.0;

/// The heading and the accumulators that find it.
#[derive(Clone, Debug)]
pub struct Heading {
    params: Params,
    theta_rad: f64,
    variance_rad2: f64,
    map: HoughLines,
    sweep: HoughLines,
    turned: Vec<Point>,
}

impl Heading {
    /// Heading 0 in the map frame, for a local map of `radius_m`.
    #[must_use]
    pub fn new(radius_m: f64, params: Params) -> Self {
        Self {
            theta_rad: 0.0,
            params,
            variance_rad2: params.line_sigma_rad * params.line_sigma_rad,
            map: HoughLines::with_params(radius_m, &params),
            sweep: HoughLines::with_params(radius_m, &params),
            turned: Vec::new(),
        }
    }

    /// The heading in the map frame, radians in (−π, π].
    #[must_use]
    pub fn theta_rad(&self) -> f64 {
        self.theta_rad
    }

    /// Its variance, square radians. The paper has none: a line is taken for 1.5 degrees, and a step that keeps the old heading adds
    /// that of any turn the robot could have made.
    #[must_use]
    pub fn variance_rad2(&self) -> f64 {
        self.variance_rad2
    }

    /// The lines of the local map, as of the last [`Heading::update`], about the point it was given about.
    #[must_use]
    pub fn map_lines(&self) -> &[Line] {
        self.map.lines()
    }

    /// Sets the heading: the first map is made with the encoders'.
    pub fn set(&mut self, theta_rad: f64) {
        self.theta_rad = wrap_angle(theta_rad);
    }

    /// Equations 7 to 9. `local_map` are occupied cells in the map frame's axes about the robot, `endpoints` the reliable
    /// endpoints in the robot frame (both metres), `max_turn_rad` is max_turn_rate · dt. Returns dtheta, or none where the old
    /// heading was kept.
    pub fn update(&mut self, local_map: &[Point], endpoints: &[Point], max_turn_rad: f64) -> Option<f64> {
        let (sin, cos) = libm::sincos(self.theta_rad);
        self.turned.clear();
        self.turned.extend(endpoints.iter().map(|p| Point::new(cos * p.x - sin * p.y, sin * p.x + cos * p.y)));
        let map = self.map.find(local_map, self.params.map_line_votes, self.params.map_lines);
        let seen = self.sweep.find(&self.turned, self.params.sweep_line_votes, 1);

        let change = seen.first().and_then(|seen| least_turn(seen, map)).filter(|turn| turn.abs() <= max_turn_rad);
        if let Some(turn) = change {
            self.theta_rad = wrap_angle(self.theta_rad + turn);
            self.variance_rad2 = self.params.line_sigma_rad * self.params.line_sigma_rad;
        } else {
            self.variance_rad2 = (self.variance_rad2 + max_turn_rad * max_turn_rad / 3.0).min(UNKNOWN_RAD2);
        }
        change
    }
}

/// The least turn that lays `seen` on one of `map`.
fn least_turn(seen: &Line, map: &[Line]) -> Option<f64> {
    let turns = map.iter().map(|line| turn_between(seen.theta_rad, line.theta_rad));
    turns.min_by(|a, b| a.abs().total_cmp(&b.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use slamd_core::Pose2;

    fn corner(step_m: f64, count: i32) -> Vec<Point> {
        let along = (0..count).map(|i| -1.5 + step_m * f64::from(i));
        along.flat_map(|t| [Point::new(t, 1.5), Point::new(1.5, t)]).collect()
    }

    proptest! {
        #[test]
        fn a_turned_robot_sees_the_walls_turned_the_other_way(turn in -0.2..0.2f64, start in -3.0..3.0f64) {
            let robot_from_map = Pose2::new(0.0, 0.0, start + turn).inverse();
            let seen: Vec<Point> = corner(0.3, 10).into_iter().map(|p| robot_from_map.transform(p)).collect();
            let mut heading = Heading::new(4.0, Params::default());
            heading.set(start);
            let change = heading.update(&corner(0.01, 300), &seen, 0.25);
            prop_assert!((change.unwrap() - turn).abs() < 0.01, "{change:?}");
            prop_assert!(wrap_angle(heading.theta_rad() - start - turn).abs() < 0.01);
        }
    }

    #[test]
    fn an_impossible_turn_keeps_the_old_heading() {
        let robot_from_map = Pose2::new(0.0, 0.0, 0.4).inverse();
        let seen: Vec<Point> = corner(0.3, 10).into_iter().map(|p| robot_from_map.transform(p)).collect();
        let mut heading = Heading::new(4.0, Params::default());
        let before = heading.variance_rad2();
        assert_eq!(heading.update(&corner(0.01, 300), &seen, 0.25), None);
        assert!(heading.theta_rad() == 0.0 && heading.variance_rad2() > before);
    }

    #[test]
    fn without_lines_the_heading_is_kept() {
        let mut heading = Heading::new(4.0, Params::default());
        assert_eq!(heading.update(&[], &corner(0.3, 10), 0.25), None);
        assert_eq!(heading.update(&corner(0.01, 300), &[], 0.25), None);
    }
}
