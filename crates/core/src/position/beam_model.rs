//! The measurement model of a sonar return against a wall of the building frame.
//!
//! | symbol | meaning |
//! |---|---|
//! | r, d | measured range, perpendicular distance from sensor to wall (m) |
//! | w | half angle of the cone, 0 for a point beam (rad) |
//! | o | angle from the beam's axis to the wall's normal (rad) |
//! | e | max(\|o\| − w, 0): how far the normal lies outside the cone (rad) |
//!
//! A cone that holds the wall's normal returns the perpendicular distance (region of constant depth: Leonard and Durrant-Whyte,
//! Directed Sonar Sensing for Mobile Robot Navigation, 1992). A cone that misses the normal returns the distance along its nearer
//! edge. So a return measures
//!
//! `d = r cos(e)`, with variance `(sigma_r cos(e))² + (r sin(e) sigma_e)²`
//!
//! The second term is there because the edge of a cone is not sharp. Beyond a limit a wall is a mirror and returns nothing.

use super::filter::ROBOT;
use super::params::BeamParams;
use crate::geometry::{Placement, Point, nearest_quarter, wrap_angle};
use crate::sweep::Beam;
use nalgebra::SVector;
use std::f64::consts::FRAC_PI_2;

/// The side from which a wall is observed, named by the direction from the robot to the wall.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Side(u8);

impl Side {
    /// +x, +y, −x, −y.
    pub const ALL: [Self; 4] = [Self(0), Self(1), Self(2), Self(3)];

    /// Its index in [`Self::ALL`].
    #[must_use]
    pub const fn index(self) -> u8 {
        self.0
    }

    /// Direction from the robot to the wall, radians.
    #[must_use]
    pub fn normal_rad(self) -> f64 {
        wrap_angle(f64::from(self.0) * FRAC_PI_2)
    }

    /// +1 where the wall lies toward larger coordinates, else −1.
    #[must_use]
    pub const fn sign(self) -> f64 {
        if self.0 < 2 { 1.0 } else { -1.0 }
    }

    /// The index (0 for x, 1 for y) of the coordinate that the wall's offset is of.
    #[must_use]
    pub const fn axis(self) -> usize {
        (self.0 % 2) as usize
    }

    /// A point's coordinate across the wall and along it.
    #[must_use]
    pub fn split(self, point: Point) -> (f64, f64) {
        if self.axis() == 0 { (point.x, point.y) } else { (point.y, point.x) }
    }

    /// The point with these coordinates across and along the wall.
    #[must_use]
    pub fn join(self, across_m: f64, along_m: f64) -> Point {
        if self.axis() == 0 { Point::new(across_m, along_m) } else { Point::new(along_m, across_m) }
    }
}

/// What a return measures if it came from a wall on one side.
#[derive(Clone, Copy, Debug)]
pub struct WallObservation {
    /// The side.
    pub side: Side,
    /// Perpendicular distance from the sensor to the wall, metres.
    pub depth_m: f64,
    /// The sensor's coordinate across the wall, metres.
    pub sensor_across_m: f64,
    /// The sensor's coordinate along the wall, metres.
    pub sensor_along_m: f64,
    /// The coordinate along the wall of the point that echoed.
    pub along_m: f64,
    /// How far the wall's normal lies outside the cone, radians.
    pub oblique_rad: f64,
    /// True for a point beam, whose edge is its axis.
    pub is_sharp: bool,
    /// Error of `depth_m` that comes from the beam's edge, standard deviation, metres.
    pub edge_m: f64,
    /// Variance of `depth_m` for a known pose.
    pub variance: f64,
    /// Derivative of (expected − measured depth) by the robot's state.
    pub h_robot: SVector<f64, ROBOT>,
}

/// Narrower cones are point beams: a definition, not tuned.
pub(crate) const POINT_RAD: f64 = 1.0 * std::f64::consts::PI / 180.0;
impl WallObservation {
    /// The offset of the wall that would explain the return.
    #[must_use]
    pub fn offset_m(&self) -> f64 {
        self.sensor_across_m + self.side.sign() * self.depth_m
    }

    /// The point that echoed, building frame.
    #[must_use]
    pub fn point(&self) -> Point {
        self.side.join(self.offset_m(), self.along_m)
    }
}

/// What a beam observes if its return came from a wall; none without a range, or where no side faces the beam.
#[must_use]
pub fn observe_wall(params: &BeamParams, at: impl Into<Placement>, beam: &Beam) -> Option<WallObservation> {
    if !beam.has_range() {
        return None;
    }
    let placement = at.into();
    let sensor = placement * beam.robot_from_sensor;
    let (quarter, off_rad) = nearest_quarter(sensor.theta_rad);
    if off_rad.abs() > params.max_incidence_rad {
        return None;
    }
    let side = Side::ALL[quarter];
    let oblique_rad = (off_rad.abs() - beam.half_angle_rad).max(0.0);
    let (sin, cos) = if oblique_rad > 0.0 { libm::sincos(oblique_rad) } else { (0.0, 1.0) };
    let depth_m = beam.range_m * cos;
    let (sensor_across_m, sensor_along_m) = side.split(sensor.position());
    // A positive rotation moves the normal of +x toward +y, and that of +y toward −x: these are the tangents.
    let tangent_sign = if side.axis() == 0 { side.sign() } else { -side.sign() };
    let along_m = sensor_along_m + tangent_sign * off_rad.signum() * beam.range_m * sin;
    let is_sharp = beam.half_angle_rad < POINT_RAD;
    let edge_m = beam.range_m * sin * if is_sharp { params.point_sigma_rad } else { params.edge_sigma_rad };
    let lever = sensor.position() - placement.pose().position();
    // The sensor moves by (−lever_y, lever_x) per radian.
    let across_by_theta = if side.axis() == 0 { -lever.y } else { lever.x };
    let mut h_robot = SVector::<f64, ROBOT>::zeros();
    h_robot[side.axis()] = -side.sign();
    h_robot[2] = -side.sign() * across_by_theta;
    if oblique_rad > 0.0 {
        h_robot[2] += beam.range_m * sin * off_rad.signum();
    }
    Some(WallObservation {
        side,
        depth_m,
        sensor_across_m,
        sensor_along_m,
        along_m,
        oblique_rad,
        is_sharp,
        edge_m,
        variance: (params.range_sigma_m * cos).powi(2) + edge_m * edge_m,
        h_robot,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pose2;
    use proptest::prelude::*;

    fn beam(bearing_rad: f64, half_angle_rad: f64, range_m: f64) -> Beam {
        let robot_from_sensor = Pose2::new(0.12, 0.07, bearing_rad);
        Beam { range_m, no_measurement: None, age_s: 0.0, robot_from_sensor, half_angle_rad }
    }

    proptest! {
        #[test]
        fn derivatives_equal_finite_differences(
            x in -1.0..1.0f64, theta in -3.0..3.0f64, bearing in -3.0..3.0f64, half in prop::sample::select(vec![0.0, 0.2])
        ) {
            let beam = beam(bearing, half, 1.8);
            let offset = 2.5;
            // Expected minus measured depth of a wall at `offset`.
            let misfit = |pose: Pose2, side: Side| {
                observe_wall(&BeamParams::default(), pose, &beam).filter(|s| s.side == side).map(|s| side.sign() * (offset - s.sensor_across_m) - s.depth_m)
            };
            let pose = Pose2::new(x, 0.4, theta);
            let Some(observation) = observe_wall(&BeamParams::default(), pose, &beam) else { return Ok(()) };
            let h = 1e-6;
            for (index, (dx, dy, dt)) in [(h, 0.0, 0.0), (0.0, h, 0.0), (0.0, 0.0, h)].into_iter().enumerate() {
                let plus = misfit(Pose2::new(x + dx, 0.4 + dy, theta + dt), observation.side);
                let minus = misfit(Pose2::new(x - dx, 0.4 - dy, theta - dt), observation.side);
                if let (Some(plus), Some(minus), true) = (plus, minus, observation.oblique_rad == 0.0 || observation.oblique_rad > 1e-5) {
                    prop_assert!(((plus - minus) / (2.0 * h) - observation.h_robot[index]).abs() < 1e-4);
                }
            }
        }

        #[test]
        fn a_point_beam_echoes_at_its_end(theta in -3.0..3.0f64, bearing in -3.0..3.0f64) {
            let beam = beam(bearing, 0.0, 1.8);
            let pose = Pose2::new(0.3, -0.2, theta);
            if let Some(observation) = observe_wall(&BeamParams::default(), pose, &beam) {
                let end = (pose * beam.robot_from_sensor).ahead(1.8);
                prop_assert!((observation.point() - end).norm() < 1e-9);
            }
        }
    }
}
