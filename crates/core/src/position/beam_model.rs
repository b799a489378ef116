//! A sonar return against a wall of the building frame.
//!
//! A cone that holds the wall's normal returns the perpendicular distance; one that misses it by `eps` returns the distance along its
//! nearer edge, `d / cos(eps)`. A point beam is a cone of no width. So a return of range r says the perpendicular distance is
//! `r cos(eps)`, with an error that grows with `r sin(eps)` because the cone's edge is not sharp. Beyond a limit a wall is
//! a mirror and returns nothing.

use super::filter::ROBOT;
use crate::geometry::{Placement, Point, nearest_quarter, wrap_angle};
use crate::sweep::Beam;
use nalgebra::SVector;
use std::f64::consts::FRAC_PI_2;

/// The side a wall is seen from, named by the direction from the robot to the wall.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Side(u8);

impl Side {
    /// +x, +y, −x, −y.
    pub const ALL: [Self; 4] = [Self(0), Self(1), Self(2), Self(3)];

    /// Its number in [`Self::ALL`].
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

/// What a return says if it came from a wall on one side.
#[derive(Clone, Copy, Debug)]
pub struct WallObservation {
    /// The side.
    pub side: Side,
    /// Perpendicular distance from the sensor to the wall, metres.
    pub depth_m: f64,
    /// The sensor's coordinate across the wall.
    pub sensor_across_m: f64,
    /// The sensor's coordinate along the wall.
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

/// Noise of a range, metres.
pub const RANGE_SIGMA_M: f64 = 0.02;
/// The edge of a cone is known to this, and the direction of a point beam to this.
const EDGE_SIGMA_RAD: f64 = 1.5 * std::f64::consts::PI / 180.0;
const POINT_SIGMA_RAD: f64 = 0.5 * std::f64::consts::PI / 180.0;
/// Narrower cones are point beams.
pub const POINT_RAD: f64 = 1.0 * std::f64::consts::PI / 180.0;
/// Normals farther from a beam's axis than this are not heard (and beyond 45 degrees another side is nearer).
const HEARD_RAD: f64 = 42.0 * std::f64::consts::PI / 180.0;

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

/// What the beam's return says if it came from a wall; none without a distance, or where no side faces the beam.
#[must_use]
pub fn observe_wall(at: impl Into<Placement>, beam: &Beam) -> Option<WallObservation> {
    if !beam.has_range() {
        return None;
    }
    let place = at.into();
    let sensor = place * beam.robot_from_sensor;
    let (quarter, off_rad) = nearest_quarter(sensor.theta_rad);
    if off_rad.abs() > HEARD_RAD {
        return None;
    }
    let side = Side::ALL[quarter];
    let oblique_rad = (off_rad.abs() - beam.half_angle_rad).max(0.0);
    let (sin, cos) = if oblique_rad > 0.0 { libm::sincos(oblique_rad) } else { (0.0, 1.0) };
    let depth_m = beam.range_m * cos;
    let (sensor_across_m, sensor_along_m) = side.split(sensor.position());
    // Positive turns lead toward +y for ±x sides' normals as seen along the axis: the tangent of +x is +y, of +y is −x.
    let tangent_sign = if side.axis() == 0 { side.sign() } else { -side.sign() };
    let along_m = sensor_along_m + tangent_sign * off_rad.signum() * beam.range_m * sin;
    let is_sharp = beam.half_angle_rad < POINT_RAD;
    let edge_m = beam.range_m * sin * if is_sharp { POINT_SIGMA_RAD } else { EDGE_SIGMA_RAD };
    let lever = sensor.position() - place.pose().position();
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
        variance: (RANGE_SIGMA_M * cos).powi(2) + edge_m * edge_m,
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
                observe_wall(pose, &beam).filter(|s| s.side == side).map(|s| side.sign() * (offset - s.sensor_across_m) - s.depth_m)
            };
            let pose = Pose2::new(x, 0.4, theta);
            let Some(observation) = observe_wall(pose, &beam) else { return Ok(()) };
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
            if let Some(observation) = observe_wall(pose, &beam) {
                let end = (pose * beam.robot_from_sensor).ahead(1.8);
                prop_assert!((observation.point() - end).norm() < 1e-9);
            }
        }
    }
}
