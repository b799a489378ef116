//! How sharp the walls are that a hypothesis lays out.
//!
//! Every return is an arc: the nearest surface of its cone is at its range, in an unknown direction. Each arc votes for the lines that
//! touch it, as in the Hough transform for the building's axis, but over all directions and without a right angle. Under the right
//! motion the arcs of one wall meet in one cell; under a wrong one they miss each other.
//!
//! `concentration = sum v² / n` for n arcs with a vote of 1 each: more where votes gather in fewer cells.

use super::params::Params;
use crate::geometry::Pose2;
use crate::position::beam_model::POINT_RAD;
use std::f64::consts::TAU;

/// One return in the frame of a window.
#[derive(Clone, Copy, Debug)]
pub(super) struct Arc {
    /// The sensor at its ping.
    pub(super) sensor: Pose2,
    /// Half the beam's opening angle, radians.
    pub(super) half_angle_rad: f64,
    /// The measured range, metres.
    pub(super) range_m: f64,
}

/// Directions in a full turn: one per 5 degrees. It sizes an array.
const DIRECTIONS: usize = 72;
/// Bins of the distance between line and origin. It sizes an array.
const RHO_BINS: usize = 256;
const STEP_RAD: f64 = TAU / DIRECTIONS as f64;

/// The accumulator.
#[derive(Clone, Debug)]
pub(super) struct Concentration {
    votes: Vec<f32>,
    /// Cosine and sine of each direction.
    normals: Vec<(f64, f64)>,
    /// `sum v²`, kept with each vote.
    squares: f64,
    arcs: f64,
}

impl Concentration {
    pub(super) fn new() -> Self {
        let normal = |direction: usize| {
            let (sin, cos) = libm::sincos(direction as f64 * STEP_RAD);
            (cos, sin)
        };
        let normals = (0..DIRECTIONS).map(normal).collect();
        Self { votes: vec![0.0; DIRECTIONS * RHO_BINS], normals, squares: 0.0, arcs: 0.0 }
    }

    /// Forgets all arcs.
    pub(super) fn clear(&mut self) {
        self.votes.fill(0.0);
        (self.squares, self.arcs) = (0.0, 0.0);
    }

    /// The concentration of the arcs so far; 0 without any.
    pub(super) fn value(&self) -> f64 {
        if self.arcs > 0.0 { self.squares / self.arcs } else { 0.0 }
    }

    /// Lets an arc vote for the lines that touch it. A point beam is returned by a wall at any angle; a cone by one it faces.
    pub(super) fn add(&mut self, arc: Arc, params: &Params) {
        self.arcs += 1.0;
        let is_point = arc.half_angle_rad < POINT_RAD;
        let half_rad = if is_point { params.point_incidence_rad } else { arc.half_angle_rad };
        #[expect(clippy::cast_possible_truncation, reason = "an angle of a few turns")]
        let index = |angle_rad: f64| libm::round(angle_rad / STEP_RAD) as i64;
        let (first, last) = (index(arc.sensor.theta_rad - half_rad), index(arc.sensor.theta_rad + half_rad));
        let weight = ((last - first + 1) as f64).recip();
        for step in first..=last {
            let direction = usize::try_from(step.rem_euclid(DIRECTIONS as i64)).unwrap_or(0);
            let (cos, sin) = self.normals[direction];
            let depth_m = if is_point {
                arc.range_m * libm::cos(step as f64 * STEP_RAD - arc.sensor.theta_rad)
            } else {
                arc.range_m
            };
            let rho_m = arc.sensor.x_m * cos + arc.sensor.y_m * sin + depth_m;
            // Walls lie ahead of the sensors more often than behind the origin.
            let bin = rho_m / params.rho_step_m + 0.25 * RHO_BINS as f64;
            if bin >= 0.0 && bin < (RHO_BINS - 1) as f64 {
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the accumulator")]
                let lower = bin as usize;
                let part = bin - lower as f64;
                self.vote(direction * RHO_BINS + lower, weight * (1.0 - part));
                self.vote(direction * RHO_BINS + lower + 1, weight * part);
            }
        }
    }

    fn vote(&mut self, cell: usize, weight: f64) {
        let before = f64::from(self.votes[cell]);
        self.squares += weight * (2.0 * before + weight);
        #[expect(clippy::cast_possible_truncation, reason = "a sum of a few hundred")]
        {
            self.votes[cell] = (before + weight) as f32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(arcs: impl Iterator<Item = Arc>) -> f64 {
        let mut concentration = Concentration::new();
        arcs.for_each(|arc| concentration.add(arc, &Params::default()));
        concentration.value()
    }

    fn towards_a_wall(scale: f64) -> impl Iterator<Item = Arc> {
        (0..40).map(move |step| {
            let x_m = 0.03 * f64::from(step);
            Arc { sensor: Pose2::new(scale * x_m, 0.0, 0.0), half_angle_rad: 0.2, range_m: 2.5 - x_m }
        })
    }

    #[test]
    fn a_wall_is_sharpest_for_the_true_travel() {
        let right = of(towards_a_wall(1.0));
        assert!(right > 2.0 * of(towards_a_wall(0.6)) && right > 2.0 * of(towards_a_wall(1.6)));
    }

    #[test]
    fn no_arc_is_no_wall() {
        assert!(of(std::iter::empty()).abs() < 1e-12);
    }
}
