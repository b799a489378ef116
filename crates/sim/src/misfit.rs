//! Calibration errors of sensors: a turned mounting and a range bias.

use super::random::Random;
use super::sonar::{MAX_RANGE_M, MIN_RANGE_M};
use slamd_core::Pose2;

/// The difference between one sensor and its drawing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Misfit {
    /// Added to every range, metres.
    pub range_bias_m: f64,
    /// Rotation of the mounting, counter-clockwise, radians.
    pub bearing_offset_rad: f64,
}

impl Misfit {
    /// A random misfit with these standard deviations.
    pub fn draw(range_bias_m: f64, bearing_offset_rad: f64, random: &mut Random) -> Self {
        Self { range_bias_m: range_bias_m * random.normal(), bearing_offset_rad: bearing_offset_rad * random.normal() }
    }

    /// The true pose of a sensor that the drawing puts at `robot_from_sensor`.
    #[must_use]
    pub fn turned(&self, robot_from_sensor: Pose2) -> Pose2 {
        robot_from_sensor * Pose2::new(0.0, 0.0, self.bearing_offset_rad)
    }

    /// The reading of a true distance; `None`: no echo.
    #[must_use]
    pub fn read(&self, distance_m: Option<f64>) -> Option<f64> {
        let read_m = (distance_m? + self.range_bias_m).max(MIN_RANGE_M);
        (read_m <= MAX_RANGE_M).then_some(read_m)
    }
}
