//! Makes ROS 2 messages, in metres and radians. The frames are `map`, `odom`, `base_link` and
//! `sonar_0`, `sonar_1`, ...
//!
//! The robot drives on a plane, so only x, y and yaw have covariances.

use super::cdr::Cdr;
use nalgebra::Matrix3;
use slamd_core::{Mounting, Pose2, Raster};

/// The frames of REP-105.
pub(super) const MAP: &str = "map";
pub(super) const ODOM: &str = "odom";
pub(super) const BASE: &str = "base_link";

/// Nanoseconds since 1970.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Stamp(pub(super) u64);

/// Pose and velocity from odometry at one instant.
#[derive(Clone, Copy, Debug)]
pub(super) struct Odometry {
    /// `odom_from_robot`.
    pub(super) pose: Pose2,
    /// Covariance of x, y (metres) and theta (radians).
    pub(super) covariance: Matrix3<f64>,
    /// Forward speed, metres per second.
    pub(super) speed_m_s: f64,
    /// Turn rate, counter-clockwise, radians per second.
    pub(super) turn_rad_s: f64,
    /// Covariance of the forward and left velocities and of the turn rate.
    pub(super) velocity_covariance: Matrix3<f64>,
}

/// The pose of the frame `inner` in the frame `outer`.
#[derive(Clone, Debug)]
pub(super) struct Transform {
    pub(super) at: Stamp,
    pub(super) outer: &'static str,
    pub(super) inner: String,
    pub(super) pose: Pose2,
}

/// The frame of a sensor; with a slash before it, the name of its topic.
pub(super) fn sonar(sensor: usize) -> String {
    format!("sonar_{sensor}")
}

/// `nav_msgs/msg/OccupancyGrid`.
#[expect(clippy::cast_possible_truncation, reason = "the message has it in single precision")]
pub(super) fn occupancy_grid(at: Stamp, raster: &Raster) -> Vec<u8> {
    let mut cdr = with_header(at, MAP);
    stamp(&mut cdr, at);
    cdr.f32(raster.cell_m as f32);
    cdr.count(raster.width);
    cdr.count(raster.height);
    pose(&mut cdr, Pose2::new(raster.origin.x, raster.origin.y, 0.0));
    cdr.i8s(&raster.occupancy);
    cdr.finish()
}

/// `geometry_msgs/msg/PoseWithCovarianceStamped`.
pub(super) fn map_pose(at: Stamp, map_from_robot: Pose2, covariance: &Matrix3<f64>) -> Vec<u8> {
    let mut cdr = with_header(at, MAP);
    pose(&mut cdr, map_from_robot);
    cdr.f64s(&planar(covariance));
    cdr.finish()
}

/// `nav_msgs/msg/Odometry`.
pub(super) fn odometry(at: Stamp, odometry: &Odometry) -> Vec<u8> {
    let mut cdr = with_header(at, ODOM);
    cdr.text(BASE);
    pose(&mut cdr, odometry.pose);
    cdr.f64s(&planar(&odometry.covariance));
    cdr.f64s(&[odometry.speed_m_s, 0.0, 0.0]);
    cdr.f64s(&[0.0, 0.0, odometry.turn_rad_s]);
    cdr.f64s(&planar(&odometry.velocity_covariance));
    cdr.finish()
}

/// `tf2_msgs/msg/TFMessage`.
pub(super) fn transforms(transforms: &[Transform]) -> Vec<u8> {
    let mut cdr = Cdr::new();
    cdr.count(transforms.len());
    for transform in transforms {
        header(&mut cdr, transform.at, transform.outer);
        cdr.text(&transform.inner);
        pose(&mut cdr, transform.pose);
    }
    cdr.finish()
}

/// `sensor_msgs/msg/Range` of a sensor with the range limits `limits_m`; the range as in REP-117.
#[expect(clippy::cast_possible_truncation, reason = "the message has them in single precision")]
pub(super) fn range(at: Stamp, sensor: usize, mounting: &Mounting, limits_m: [f64; 2], range_m: f64) -> Vec<u8> {
    let mut cdr = with_header(at, &sonar(sensor));
    cdr.u8(ULTRASOUND);
    cdr.f32((2.0 * mounting.half_angle_rad) as f32);
    limits_m.iter().for_each(|&limit_m| cdr.f32(limit_m as f32));
    cdr.f32(range_m as f32);
    cdr.f32(UNKNOWN_VARIANCE);
    cdr.finish()
}

const ULTRASOUND: u8 = 0;
const UNKNOWN_VARIANCE: f32 = 0.0;

/// `std_msgs/msg/String`.
pub(super) fn text(text: &str) -> Vec<u8> {
    let mut cdr = Cdr::new();
    cdr.text(text);
    cdr.finish()
}

/// A message with its header.
pub(super) fn with_header(at: Stamp, frame: &str) -> Cdr {
    let mut cdr = Cdr::new();
    header(&mut cdr, at, frame);
    cdr
}

/// A header within a message.
pub(super) fn stamped(cdr: &mut Cdr, at: Stamp, frame: &str) {
    header(cdr, at, frame);
}

fn header(cdr: &mut Cdr, at: Stamp, frame: &str) {
    stamp(cdr, at);
    cdr.text(frame);
}

fn stamp(cdr: &mut Cdr, Stamp(ns): Stamp) {
    // ROS's 32-bit seconds end in 2038.
    cdr.i32(i32::try_from(ns / 1_000_000_000).unwrap_or(i32::MAX));
    cdr.u32(u32::try_from(ns % 1_000_000_000).unwrap_or_default());
}

/// A position and a quaternion: a pose or a transform.
pub(super) fn pose(cdr: &mut Cdr, pose: Pose2) {
    let (qz, qw) = libm::sincos(0.5 * pose.theta_rad);
    cdr.f64s(&[pose.x_m, pose.y_m, 0.0]);
    cdr.f64s(&[0.0, 0.0, qz, qw]);
}

/// The 6 x 6 covariance of x, y, z, roll, pitch and yaw, row by row.
fn planar(covariance: &Matrix3<f64>) -> [f64; 36] {
    let mut all = [0.0; 36];
    for (row, outer) in PLANAR.into_iter().enumerate() {
        for (column, inner) in PLANAR.into_iter().enumerate() {
            all[6 * outer + inner] = covariance[(row, column)];
        }
    }
    all
}

/// The indices of x, y and yaw among the six.
const PLANAR: [usize; 3] = [0, 1, 5];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_covariance_is_spread_over_x_y_and_yaw() {
        let all = planar(&Matrix3::new(1.0, 2.0, 3.0, 2.0, 4.0, 5.0, 3.0, 5.0, 6.0));
        let filled: Vec<(usize, f64)> = all.into_iter().enumerate().filter(|(_, value)| *value != 0.0).collect();
        let expected = [(0, 1.0), (1, 2.0), (5, 3.0), (6, 2.0), (7, 4.0), (11, 5.0), (30, 3.0), (31, 5.0), (35, 6.0)];
        assert_eq!(filled, expected);
    }

    #[test]
    fn a_stamp_is_seconds_and_nanoseconds() {
        let mut cdr = Cdr::new();
        stamp(&mut cdr, Stamp(3_999_999_999));
        assert_eq!(cdr.finish()[4..], [3, 0, 0, 0, 0xff, 0xc9, 0x9a, 0x3b]);
        let mut cdr = Cdr::new();
        stamp(&mut cdr, Stamp(u64::MAX));
        assert_eq!(cdr.finish()[4..8], [0xff, 0xff, 0xff, 0x7f]);
    }
}
