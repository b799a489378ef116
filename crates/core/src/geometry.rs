//! Planar geometry in REP-103 axes: x forward, y left, angles counter-clockwise in radians.
//!
//! Transforms read right to left: `world_from_robot * robot_from_sensor`.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::ops::Mul;

/// Degrees to radians, for constants.
pub(crate) const fn degrees(angle: f64) -> f64 {
    angle * PI / 180.0
}

/// Wraps an angle to (−π, π].
#[must_use]
pub fn wrap_angle(angle_rad: f64) -> f64 {
    match angle_rad {
        _ if angle_rad > -PI && angle_rad <= PI => angle_rad,
        _ if angle_rad > PI && angle_rad <= 3.0 * PI => angle_rad - TAU,
        _ if angle_rad > -3.0 * PI && angle_rad <= -PI => angle_rad + TAU,
        _ => {
            let turned = angle_rad - TAU * libm::floor(angle_rad / TAU);
            if turned > PI { turned - TAU } else { turned }
        }
    }
}

/// The quarter turn nearest to an angle between −2π and 2π, 0 to 3 counter-clockwise, and the rest of the angle, radians.
#[must_use]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 8 as floats are whole")]
pub fn nearest_quarter(angle_rad: f64) -> (usize, f64) {
    // A cast rounds toward zero, cheaper than a call of floor.
    let quarter = (angle_rad / FRAC_PI_2 + 4.5) as usize;
    (quarter & 3, angle_rad - (quarter as f64 - 4.0) * FRAC_PI_2)
}

/// A point in metres.
pub type Point = nalgebra::Point2<f64>;

/// A rigid motion of the plane: the pose of one frame in another.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pose2 {
    /// Metres along x.
    pub x_m: f64,
    /// Metres along y.
    pub y_m: f64,
    /// Radians in (−π, π].
    pub theta_rad: f64,
}

impl Pose2 {
    /// The pose at (`x_m`, `y_m`) turned by `theta_rad`, which is wrapped.
    #[must_use]
    pub fn new(x_m: f64, y_m: f64, theta_rad: f64) -> Self {
        Self { x_m, y_m, theta_rad: wrap_angle(theta_rad) }
    }

    /// The inverse transform.
    #[must_use]
    pub fn inverse(self) -> Self {
        let (sin, cos) = libm::sincos(self.theta_rad);
        Self::new(-cos * self.x_m - sin * self.y_m, sin * self.x_m - cos * self.y_m, -self.theta_rad)
    }

    /// Maps a point from the inner frame to the outer one.
    #[must_use]
    pub fn transform(self, point: Point) -> Point {
        Placement::from(self).transform(point)
    }

    /// The origin of the inner frame.
    #[must_use]
    pub fn position(self) -> Point {
        Point::new(self.x_m, self.y_m)
    }

    /// The point `distance_m` ahead on the inner frame's x axis.
    #[must_use]
    pub fn ahead(self, distance_m: f64) -> Point {
        self.transform(Point::new(distance_m, 0.0))
    }

    /// The pose after rolling the wheels by `left_m` and `right_m` on a base of `base_m` metres: an exact arc.
    #[must_use]
    pub fn rolled(self, left_m: f64, right_m: f64, base_m: f64) -> Self {
        let turn = (right_m - left_m) / base_m;
        let chord = 0.5 * (left_m + right_m) * sinc(0.5 * turn);
        let (sin, cos) = libm::sincos(self.theta_rad + 0.5 * turn);
        Self::new(self.x_m + chord * cos, self.y_m + chord * sin, self.theta_rad + turn)
    }
}

impl Mul for Pose2 {
    type Output = Self;

    /// `outer_from_middle * middle_from_inner`.
    fn mul(self, inner: Self) -> Self {
        Placement::from(self) * inner
    }
}

/// A pose with the sine and cosine of its heading, computed once for many transforms.
#[derive(Clone, Copy, Debug)]
pub struct Placement {
    pose: Pose2,
    sin: f64,
    cos: f64,
}

impl From<Pose2> for Placement {
    fn from(pose: Pose2) -> Self {
        let (sin, cos) = libm::sincos(pose.theta_rad);
        Self { pose, sin, cos }
    }
}

impl Placement {
    /// The pose.
    #[must_use]
    pub const fn pose(&self) -> Pose2 {
        self.pose
    }

    fn transform(self, point: Point) -> Point {
        let Self { pose, sin, cos } = self;
        Point::new(pose.x_m + cos * point.x - sin * point.y, pose.y_m + sin * point.x + cos * point.y)
    }
}

impl Mul<Pose2> for Placement {
    type Output = Pose2;

    /// `outer_from_middle * middle_from_inner`.
    #[expect(clippy::suspicious_arithmetic_impl, reason = "headings add where transforms multiply")]
    fn mul(self, inner: Pose2) -> Pose2 {
        let origin = self.transform(inner.position());
        Pose2::new(origin.x, origin.y, self.pose.theta_rad + inner.theta_rad)
    }
}

/// sin(x) / x.
#[must_use]
pub fn sinc(x: f64) -> f64 {
    if x.abs() < 1e-6 { 1.0 - x * x / 6.0 } else { libm::sin(x) / x }
}

/// A straight piece of a wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// One end.
    pub from: Point,
    /// The other.
    pub to: Point,
    /// Standard deviation of its offset along its normal, metres.
    pub sigma_m: f64,
}

/// One sensor's pose on the robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mounting {
    /// The sensor in the robot frame; its x axis is the beam's axis.
    pub robot_from_sensor: Pose2,
    /// Half the beam's opening angle, radians; 0 for a point beam.
    pub half_angle_rad: f64,
    /// The firing group: sensors of one group fire together.
    pub group: u8,
}

/// The robot's sensors in the order of their ids.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ring {
    /// One mounting per sensor.
    pub mountings: Vec<Mounting>,
}

impl Ring {
    /// `count` sensors evenly around a circle, counter-clockwise from straight ahead, fired in `groups` interleaved groups.
    #[must_use]
    pub fn circle(count: u8, radius_m: f64, half_angle_rad: f64, groups: u8) -> Self {
        let mountings = (0..count)
            .map(|sensor| {
                let bearing = TAU * f64::from(sensor) / f64::from(count);
                let (sin, cos) = libm::sincos(bearing);
                Mounting {
                    robot_from_sensor: Pose2::new(radius_m * cos, radius_m * sin, bearing),
                    half_angle_rad,
                    group: sensor % groups.max(1),
                }
            })
            .collect();
        Self { mountings }
    }

    /// The number of sensors n.
    #[must_use]
    pub fn len(&self) -> usize {
        self.mountings.len()
    }

    /// True if the ring has no sensors.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.mountings.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn pose() -> impl Strategy<Value = Pose2> {
        (-9.0..9.0, -9.0..9.0, -4.0..4.0).prop_map(|(x, y, theta)| Pose2::new(x, y, theta))
    }

    proptest! {
        #[test]
        fn a_pose_times_its_inverse_is_nothing(p in pose()) {
            let id = p * p.inverse();
            prop_assert!(id.x_m.abs() < 1e-9 && id.y_m.abs() < 1e-9 && id.theta_rad.abs() < 1e-9);
        }

        #[test]
        fn composing_equals_transforming_twice(a in pose(), b in pose(), x in -5.0..5.0f64) {
            let point = Point::new(x, 1.0);
            prop_assert!(((a * b).transform(point) - a.transform(b.transform(point))).norm() < 1e-9);
        }

        #[test]
        fn angles_wrap_into_the_half_open_turn(angle in -100.0..100.0f64) {
            let wrapped = wrap_angle(angle);
            prop_assert!(wrapped > -PI && wrapped <= PI);
            prop_assert!((libm::sin(wrapped) - libm::sin(angle)).abs() < 1e-9);
        }

        #[test]
        fn an_arc_is_the_limit_of_small_steps(left in -0.2..0.2f64, right in -0.2..0.2f64) {
            let whole = Pose2::default().rolled(left, right, 0.3);
            let steps = (0..1000).fold(Pose2::default(), |p, _| p.rolled(left / 1000.0, right / 1000.0, 0.3));
            prop_assert!((whole.position() - steps.position()).norm() < 1e-9);
        }
    }

    #[test]
    fn pi_stays_pi() {
        assert!((wrap_angle(PI) - PI).abs() < 1e-15 && (wrap_angle(-PI) - PI).abs() < 1e-15);
    }
}
