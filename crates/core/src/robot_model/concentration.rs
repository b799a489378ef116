//! How sharp the walls are that a hypothesis lays out.
//!
//! Every return is an arc: the nearest surface of its cone is at its range, in an unknown direction. Each arc votes for all lines that
//! may have returned it, as in the Hough transform for the building's axis, but over all directions and without a right angle: lines
//! that touch it, and lines whose normal the cone misses, which its edge meets ([`crate::position::beam_model`]). One of them is its
//! wall: the one that most other arcs support. Under the right motion the arcs of one wall agree; under a wrong one each has few friends.
//!
//! `sharpness = mean over the arcs of ln(1 + support of the arc's best line)`
//!
//! The mean is a log likelihood with one line per arc. A sum over all cells instead, as in the axis finder, would count what an arc
//! votes for besides its wall: a robot that hardly moves would be the sharpest.

use super::params::Params;
use crate::geometry::Pose2;
use crate::position::beam_model::POINT_RAD;
use std::f64::consts::{FRAC_PI_2, TAU};

/// One return in the frame of a window.
#[derive(Clone, Copy, Debug)]
pub(super) struct Arc {
    /// The sensor at its ping.
    pub(super) sensor: Pose2,
    /// Cosine and sine of its heading.
    pub(super) axis: (f64, f64),
    pub(super) opening: Opening,
    /// The measured range, metres.
    pub(super) range_m: f64,
}

/// Half the opening angle of a beam, radians, with its cosine and sine.
#[derive(Clone, Copy, Debug)]
pub(super) struct Opening {
    half_angle_rad: f64,
    cos: f64,
    sin: f64,
}

impl Opening {
    pub(super) fn new(half_angle_rad: f64) -> Self {
        let (sin, cos) = libm::sincos(half_angle_rad);
        Self { half_angle_rad, cos, sin }
    }
}

/// Directions in a full turn: one per 2.5 degrees, by which the line of a wall of 3 m bends by less than a bin. It sizes an array.
const DIRECTIONS: usize = 144;
/// Bins of the distance between line and origin. It sizes an array.
const RHO_BINS: usize = 256;
/// Angle between two directions, radians.
pub(super) const STEP_RAD: f64 = TAU / DIRECTIONS as f64;

/// The accumulator.
#[derive(Clone, Debug)]
pub(super) struct Concentration {
    votes: Vec<f32>,
    /// Cosine and sine of each direction.
    normals: Vec<(f64, f64)>,
    /// What the arcs voted for: the lower of two cells, and the part of the upper one.
    ballots: Vec<(u32, f32)>,
    /// The number of ballots after each arc.
    ends: Vec<usize>,
}

impl Concentration {
    pub(super) fn new(params: &Params) -> Self {
        let normal = |direction: usize| {
            let (sin, cos) = libm::sincos(direction as f64 * STEP_RAD);
            (cos, sin)
        };
        let arcs = (params.max_keys + 1) * params.returns_per_key;
        Self {
            votes: vec![0.0; DIRECTIONS * RHO_BINS],
            normals: (0..DIRECTIONS).map(normal).collect(),
            ballots: Vec::with_capacity(arcs * (DIRECTIONS / 2 + 2)),
            ends: Vec::with_capacity(arcs),
        }
    }

    /// Forgets all arcs.
    pub(super) fn clear(&mut self) {
        self.votes.fill(0.0);
        self.ballots.clear();
        self.ends.clear();
    }

    /// The sharpness of the walls of the arcs so far, nats; 0 without any.
    pub(super) fn log_sharpness(&self) -> f64 {
        let (mut sum, mut first) = (0.0, 0);
        for &end in &self.ends {
            let mut best = 0.0_f32;
            for &(cell, part) in &self.ballots[first..end] {
                let cell = cell as usize;
                best = best.max((1.0 - part) * self.votes[cell] + part * self.votes[cell + 1]);
            }
            first = end;
            sum += libm::log1p(f64::from(best));
        }
        sum / self.ends.len().max(1) as f64
    }

    /// Lets an arc vote for the lines that may have returned it.
    pub(super) fn add(&mut self, arc: Arc, params: &Params) {
        let Arc { sensor, axis, opening, range_m } = arc;
        let half_rad = opening.half_angle_rad;
        let edge = if half_rad < POINT_RAD { 1.0 } else { params.edge_vote };
        let reach_rad = (half_rad + params.max_incidence_rad).min(FRAC_PI_2);
        #[expect(clippy::cast_possible_truncation, reason = "an angle of a few turns")]
        let index = |angle_rad: f64| libm::round(angle_rad / STEP_RAD) as i64;
        let (first, last) = (index(sensor.theta_rad - reach_rad), index(sensor.theta_rad + reach_rad));
        // Where the echo came from if the normal lies outside the cone: the end of the cone's nearer edge.
        let end = |sin: f64| {
            let (cos, sin) = (axis.0 * opening.cos - axis.1 * sin, axis.1 * opening.cos + axis.0 * sin);
            (sensor.x_m + range_m * cos, sensor.y_m + range_m * sin)
        };
        let (right, left) = (end(-opening.sin), end(opening.sin));
        // Walls lie ahead of the sensors more often than behind the origin.
        let (per_m, origin) = (1.0 / params.rho_step_m, 0.25 * RHO_BINS as f64);
        let mut direction = usize::try_from(first.rem_euclid(DIRECTIONS as i64)).unwrap_or(0);
        for step in first..=last {
            let (cos, sin) = self.normals[direction];
            let off_rad = step as f64 * STEP_RAD - sensor.theta_rad;
            let (rho_m, weight) = if off_rad > half_rad {
                (left.0 * cos + left.1 * sin, edge)
            } else if off_rad < -half_rad {
                (right.0 * cos + right.1 * sin, edge)
            } else {
                (sensor.x_m * cos + sensor.y_m * sin + range_m, 1.0)
            };
            let bin = rho_m * per_m + origin;
            if bin >= 0.0 && bin < (RHO_BINS - 1) as f64 {
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the accumulator")]
                let lower = bin as u32;
                #[expect(clippy::cast_possible_truncation, reason = "a part of one")]
                let part = (bin - f64::from(lower)) as f32;
                #[expect(clippy::cast_possible_truncation, reason = "below DIRECTIONS * RHO_BINS")]
                let cell = (direction * RHO_BINS) as u32 + lower;
                self.votes[cell as usize] += weight * (1.0 - part);
                self.votes[cell as usize + 1] += weight * part;
                self.ballots.push((cell, part));
            }
            direction = if direction + 1 == DIRECTIONS { 0 } else { direction + 1 };
        }
        self.ends.push(self.ballots.len());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(arcs: impl Iterator<Item = Arc>) -> f64 {
        let params = Params::default();
        let mut concentration = Concentration::new(&params);
        arcs.for_each(|arc| concentration.add(arc, &params));
        concentration.log_sharpness()
    }

    fn arc(sensor: Pose2, range_m: f64) -> Arc {
        let (sin, cos) = libm::sincos(sensor.theta_rad);
        Arc { sensor, axis: (cos, sin), opening: Opening::new(0.2), range_m }
    }

    fn towards_a_wall(scale: f64) -> impl Iterator<Item = Arc> {
        (0..40).map(move |step| {
            let x_m = 0.03 * f64::from(step);
            arc(Pose2::new(scale * x_m, 0.0, 0.0), 2.5 - x_m)
        })
    }

    #[test]
    fn a_wall_is_sharpest_for_the_true_travel() {
        let right = of(towards_a_wall(1.0));
        assert!(right > 0.3 + of(towards_a_wall(0.6)) && right > 0.3 + of(towards_a_wall(1.6)));
    }

    #[test]
    fn a_wall_beside_the_robot_says_nothing_of_its_travel() {
        // The sensors look to the side: at 90 degrees and, with the cone's edge, at 60.
        let along = |scale: f64| {
            (0..40).flat_map(move |step| {
                let sensor = |bearing_rad: f64| Pose2::new(0.03 * scale * f64::from(step), 0.0, bearing_rad);
                let edge_rad = 0.524 - 0.2;
                [arc(sensor(FRAC_PI_2), 1.0), arc(sensor(FRAC_PI_2 - 0.524), 1.0 / libm::cos(edge_rad))]
            })
        };
        assert!((of(along(1.0)) - of(along(0.25))).abs() < 0.02, "{} {}", of(along(1.0)), of(along(0.25)));
    }

    #[test]
    fn no_arc_is_no_wall() {
        assert!(of(std::iter::empty()).abs() < 1e-12);
    }
}
