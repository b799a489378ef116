//! The building's axis, followed with the robot's way: how far the heading is off it.
//!
//! The returns of the last metre and a half are laid out along the way by the wheels, with what the filter knows of them. In a building
//! whose walls stand at right angles the histograms of their coordinates across and along the axis gather in the fewest bins where the
//! layout has the right turn. Of the turns near the heading that the filter has, the most probable one is taken:
//!
//! `maximize log(sum n_x² + sum n_y²) − turn² / (2 near²)`
//!
//! Without the second term a slanted wall turns the heading away, and a curved one turns it to the next quarter.
//!
//! | symbol | meaning |
//! |---|---|
//! | n | returns per bin; a return counts in two bins in proportion |
//! | u | coordinate of a return along a normal: `o + r cos(max(0, e − half angle))`, o of the sensor, r its range, e between its axis and the normal |
//!
//! A window of the way holds so many independent readings once, however often it is read: the variance of a turn is that of a
//! window times the readings in it. It grows with the share of the returns that no axis gathers, without limit.

use super::params::TrackParams;
use crate::geometry::{Placement, Point, Pose2};
use crate::sweep::Sweep;
use std::collections::VecDeque;
use std::f64::consts::FRAC_PI_4;

/// Bins of each histogram, around the robot. It sizes an array.
const BINS: usize = 256;

/// How far the heading is off the building's axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Turn {
    /// The axis's heading less the filter's, radians.
    pub(crate) angle_rad: f64,
    /// Its variance as one of the readings of a window, rad², if the wheels are right.
    pub(crate) variance: f64,
    /// Its variance as the only reading of the window, rad².
    pub(crate) window_variance: f64,
    /// The way ahead from the middle of the window to the robot, metres, and the turn on it, radians.
    pub(crate) lag: [f64; 2],
}

/// One return in the frame of the wheels.
#[derive(Clone, Copy, Debug)]
struct Return {
    origin: Point,
    /// Direction of the beam.
    cos: f64,
    sin: f64,
    /// Of half its opening angle.
    half: [f64; 2],
    range_m: f64,
    /// Way, way ahead and heading by the wheels where it was seen.
    way_m: f64,
    ahead_m: f64,
    heading_rad: f64,
}

/// Follows the axis.
#[derive(Clone, Debug)]
pub(crate) struct AxisTracker {
    returns: VecDeque<Return>,
    /// The robot by the wheels alone; its heading is not wrapped.
    pose: Pose2,
    heading_rad: f64,
    way_m: f64,
    ahead_m: f64,
    /// The way at the last sweep laid out, the last turn read and the last whole window read.
    laid_m: f64,
    read_m: f64,
    window_m: f64,
    /// The way where the oldest return may begin.
    since_m: f64,
    next_sensor: usize,
    votes: Box<[[f32; BINS]; 2]>,
    scores: Vec<f64>,
    params: TrackParams,
}

impl AxisTracker {
    pub(crate) fn new(params: TrackParams) -> Self {
        Self {
            returns: VecDeque::with_capacity(params.max_returns),
            pose: Pose2::default(),
            heading_rad: 0.0,
            way_m: 0.0,
            ahead_m: 0.0,
            laid_m: f64::NEG_INFINITY,
            read_m: 0.0,
            window_m: 0.0,
            since_m: 0.0,
            next_sensor: 0,
            votes: Box::new([[0.0; BINS]; 2]),
            scores: Vec::with_capacity(2 * params.near_steps.max(params.whole_steps()) + 1),
            params,
        }
    }

    /// Forgets the returns: the wheels were wrong, or the robot was carried.
    pub(crate) fn clear(&mut self) {
        self.returns.clear();
        (self.laid_m, self.read_m, self.window_m, self.since_m) =
            (f64::NEG_INFINITY, self.way_m, self.way_m, self.way_m);
    }

    /// Adds a sweep after a motion by the wheels.
    pub(crate) fn add(&mut self, sweep: &Sweep, step: Pose2, is_trusted: impl Fn(usize) -> bool) {
        let params = self.params;
        self.pose = self.pose * step;
        self.heading_rad += step.theta_rad;
        self.ahead_m += step.x_m;
        self.way_m += libm::hypot(step.x_m, step.y_m) + params.rim_m * step.theta_rad.abs();
        if self.way_m < self.laid_m + params.step_m {
            return;
        }
        // The sensors take turns, so that a large ring costs no more than a small one; where sweeps are sparse, more take part.
        let sensors = sweep.beams.len();
        let steps = ((self.way_m - self.laid_m) / params.step_m).min(sensors as f64);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "1 to the number of sensors")]
        let taken = sensors.min(params.sensors * steps as usize);
        self.laid_m = self.way_m;
        while self.returns.front().is_some_and(|oldest| oldest.way_m < self.way_m - params.window_m) {
            self.returns.pop_front();
        }
        let placement = Placement::from(self.pose);
        for offset in 0..taken {
            let sensor = (self.next_sensor + offset) % sensors;
            let Some(beam) = sweep.beams.get(sensor).filter(|beam| beam.has_range() && is_trusted(sensor)) else {
                continue;
            };
            if self.returns.len() == params.max_returns {
                self.returns.pop_front();
            }
            let seen = placement * beam.robot_from_sensor;
            let (sin, cos) = libm::sincos(seen.theta_rad);
            let (half_sin, half_cos) = libm::sincos(beam.half_angle_rad);
            self.returns.push_back(Return {
                origin: seen.position(),
                cos,
                sin,
                half: [half_cos, half_sin],
                range_m: beam.range_m,
                way_m: self.way_m,
                ahead_m: self.ahead_m,
                heading_rad: self.heading_rad,
            });
        }
        self.next_sensor = (self.next_sensor + taken) % sensors.max(1);
    }

    /// The turn from a robot's heading to the axis near it, if it is time to read it and the returns prefer one.
    pub(crate) fn read(&mut self, heading_rad: f64) -> Option<Turn> {
        let params = self.params;
        let is_due = self.way_m >= self.read_m + params.read_m
            && self.way_m >= self.since_m + params.min_window * params.window_m
            && self.returns.len() >= params.min_returns;
        if !is_due {
            return None;
        }
        self.read_m = self.way_m;
        self.score_all(heading_rad, params.near_steps);
        let middle = params.near_steps as f64;
        let off_rad = |index: usize| (index as f64 - middle) * params.turn_rad;
        let posterior = |index: usize| {
            let off = off_rad(index) / params.near_rad;
            self.scores.get(index).map_or(f64::NEG_INFINITY, |score| libm::log(*score) - 0.5 * off * off)
        };
        let best = (0..self.scores.len()).max_by(|a, b| posterior(*a).total_cmp(&posterior(*b)))?;
        if best == 0 || best + 1 >= self.scores.len() {
            return None;
        }
        let [before, at, after] = [self.scores[best - 1], self.scores[best], self.scores[best + 1]];
        let curvature = before - 2.0 * at + after;
        let vertex = if curvature < 0.0 { (0.5 * (before - after) / curvature).clamp(-1.0, 1.0) } else { 0.0 };
        // What the flattest layout gathers, any turn gathers.
        let base = self.scores.iter().copied().fold(f64::INFINITY, f64::min);
        let preference = (at / base - 1.0).max(params.min_preference);
        let readings = params.window_m / params.read_m;
        let sigma_rad = params.sigma_rad * (1.0 + (params.half_preference / preference).powi(2));
        let count = self.returns.len() as f64;
        let mean = |of: &dyn Fn(&Return) -> f64| self.returns.iter().map(of).sum::<f64>() / count;
        Some(Turn {
            angle_rad: off_rad(best) + vertex * params.turn_rad,
            variance: readings * sigma_rad * sigma_rad,
            window_variance: sigma_rad * sigma_rad,
            lag: [self.ahead_m - mean(&|seen| seen.ahead_m), self.heading_rad - mean(&|seen| seen.heading_rad)],
        })
    }

    /// At the end of a window of its own: the turn from the robot's heading to the axis that gathers its returns best, wherever it is,
    /// if one does.
    pub(crate) fn read_window(&mut self, heading_rad: f64) -> Option<f64> {
        let params = self.params;
        if self.way_m < self.window_m + params.window_m || self.returns.len() < params.min_returns {
            return None;
        }
        self.window_m = self.way_m;
        self.score_all(heading_rad, params.whole_steps());
        let best = (0..self.scores.len()).max_by(|a, b| self.scores[*a].total_cmp(&self.scores[*b]))?;
        let base = self.scores.iter().copied().fold(f64::INFINITY, f64::min);
        let is_clear = self.scores[best] > (1.0 + params.min_whole_preference) * base;
        is_clear.then(|| (best as f64 - params.whole_steps() as f64) * params.turn_rad)
    }

    /// Scores the turns around a heading.
    fn score_all(&mut self, heading_rad: f64, steps: usize) {
        self.scores.clear();
        for index in 0..=2 * steps {
            let off_rad = (index as f64 - steps as f64) * self.params.turn_rad;
            let score = self.score(heading_rad + off_rad - self.heading_rad);
            self.scores.push(score);
        }
    }

    /// How strongly the returns gather if the frame of the wheels is turned so.
    fn score(&mut self, turn_rad: f64) -> f64 {
        let (sin, cos) = libm::sincos(turn_rad);
        let (centre, per_m) = (self.pose, self.params.bin_m.recip());
        self.votes.iter_mut().for_each(|votes| votes.fill(0.0));
        for seen in &self.returns {
            let (x, y) = (seen.origin.x - centre.x_m, seen.origin.y - centre.y_m);
            let along = [cos * seen.cos - sin * seen.sin, sin * seen.cos + cos * seen.sin];
            let origin = [cos * x - sin * y, sin * x + cos * y];
            for (axis, votes) in self.votes.iter_mut().enumerate() {
                let (ahead, aside) = (along[axis], along[1 - axis].abs());
                let [half_cos, half_sin] = seen.half;
                // Half a cone nearer to the normal, as far as to the normal.
                let share = if ahead.abs() < half_cos { ahead.abs() * half_cos + aside * half_sin } else { 1.0 };
                let depth_m = (seen.range_m * share).copysign(ahead);
                let bin = (origin[axis] + depth_m) * per_m + 0.5 * BINS as f64;
                if bin >= 0.0 && bin < (BINS - 1) as f64 {
                    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the histogram")]
                    let lower = bin as usize;
                    #[expect(clippy::cast_possible_truncation, reason = "less than 1")]
                    let part = (bin - lower as f64) as f32;
                    votes[lower] += 1.0 - part;
                    votes[lower + 1] += part;
                }
            }
        }
        self.votes.iter().flatten().map(|votes| f64::from(votes * votes)).sum()
    }
}

impl TrackParams {
    /// Steps to either side that make a quarter turn.
    fn whole_steps(&self) -> usize {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small positive number")]
        let steps = (FRAC_PI_4 / self.turn_rad) as usize;
        steps
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sweep::Beam;
    use std::f64::consts::TAU;

    /// Distance to the walls of a room of 6 x 4 m around the origin, from a pose in it.
    fn room_m(pose: Pose2) -> f64 {
        let (sin, cos) = libm::sincos(pose.theta_rad);
        let along = |at: f64, direction: f64, half: f64| {
            if direction.abs() < 1e-9 { f64::INFINITY } else { (half.copysign(direction) - at) / direction }
        };
        along(pose.x_m, cos, 3.0).min(along(pose.y_m, sin, 2.0))
    }

    /// Distance to a round wall.
    fn rotunda_m(pose: Pose2) -> f64 {
        let (sin, cos) = libm::sincos(pose.theta_rad);
        let (b, c) = (pose.x_m * cos + pose.y_m * sin, pose.x_m.powi(2) + pose.y_m.powi(2) - 9.0);
        -b + (b * b - c).sqrt()
    }

    fn sweep(pose: Pose2, range_m: impl Fn(Pose2) -> f64) -> Sweep {
        let beam = |sensor: u32| {
            let robot_from_sensor = Pose2::new(0.0, 0.0, TAU * f64::from(sensor) / 16.0);
            let range_m = range_m(pose * robot_from_sensor);
            Beam { range_m, no_measurement: None, age_s: 0.0, robot_from_sensor, half_angle_rad: 0.0 }
        };
        Sweep { beams: (0..16).map(beam).collect(), ..Sweep::default() }
    }

    /// Drives 2 m, of which the wheels turn the robot by `drift_rad` per metre more than it turns. Returns the tracker and the true heading.
    fn drive(range_m: impl Fn(Pose2) -> f64, drift_rad: f64) -> (AxisTracker, f64) {
        let mut tracker = AxisTracker::new(TrackParams::default());
        let (mut pose, ahead_m) = (Pose2::new(-1.0, -0.4, 0.3), 0.02);
        for _ in 0..100 {
            pose = pose * Pose2::new(ahead_m, 0.0, 0.001);
            let step = Pose2::new(ahead_m, 0.0, 0.001 + drift_rad * ahead_m);
            tracker.add(&sweep(pose, &range_m), step, |_| true);
        }
        (tracker, pose.theta_rad)
    }

    #[test]
    fn a_heading_that_is_off_is_found() {
        let (tracker, heading_rad) = drive(room_m, 0.0);
        for off_deg in [-9.0f64, -3.0, 0.0, 0.4, 6.0] {
            let off_rad = off_deg.to_radians();
            let turn = tracker.clone().read(heading_rad + off_rad).unwrap();
            assert!((turn.angle_rad + off_rad).abs() < turn.window_variance.sqrt(), "{off_deg}: {turn:?}");
            assert!(turn.window_variance.sqrt() < 1f64.to_radians(), "{turn:?}");
            assert!((turn.lag[0] - 0.75).abs() < 0.1, "{turn:?}");
        }
    }

    #[test]
    fn wheels_that_drift_are_off_by_their_lag() {
        let drift_rad = 0.03;
        let (mut tracker, heading_rad) = drive(room_m, drift_rad);
        let turn = tracker.read(heading_rad).unwrap();
        let by_lag_rad = turn.angle_rad - turn.lag[0] * drift_rad;
        assert!(by_lag_rad.abs() < 0.6f64.to_radians(), "{turn:?}");
    }

    #[test]
    fn a_round_building_has_no_axis() {
        let (mut tracker, heading_rad) = drive(rotunda_m, 0.0);
        assert_eq!(tracker.clone().read_window(heading_rad), None);
        let sigma_rad = tracker.read(heading_rad).map_or(f64::INFINITY, |turn| turn.window_variance.sqrt());
        assert!(sigma_rad > 5f64.to_radians(), "{} degrees", sigma_rad.to_degrees());
    }

    #[test]
    fn a_window_tells_an_axis_far_off() {
        let (mut tracker, heading_rad) = drive(room_m, 0.0);
        let off_rad = tracker.read_window(heading_rad + 0.5).unwrap();
        assert!((off_rad + 0.5).abs() < 2f64.to_radians(), "{off_rad}");
        assert_eq!(tracker.read_window(heading_rad), None, "a window of its own");
    }

    #[test]
    fn nothing_is_read_twice_or_after_it_was_forgotten() {
        let (mut tracker, heading_rad) = drive(room_m, 0.0);
        assert!(tracker.read(heading_rad).is_some() && tracker.read(heading_rad).is_none());
        tracker.clear();
        tracker.add(&sweep(Pose2::default(), room_m), Pose2::new(0.2, 0.0, 0.0), |_| true);
        assert_eq!(tracker.read(heading_rad), None);
    }
}
