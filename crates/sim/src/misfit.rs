//! Sensors that are not as drawn: mounted askew, and reading too long or too short.

use super::random::Random;
use super::sonar::{MAX_RANGE_M, MIN_RANGE_M};
use slamd_core::geometry::Pose2;

/// How one sensor differs from its drawing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Misfit {
    /// How much too long it reads, metres.
    pub range_bias_m: f64,
    /// How far it is turned counter-clockwise in its place, radians.
    pub bearing_offset_rad: f64,
}

impl Misfit {
    /// One drawn with these standard deviations.
    pub fn draw(range_bias_m: f64, bearing_offset_rad: f64, random: &mut Random) -> Self {
        Self { range_bias_m: range_bias_m * random.normal(), bearing_offset_rad: bearing_offset_rad * random.normal() }
    }

    /// Where the sensor truly looks that the drawing puts at `robot_from_sensor`.
    #[must_use]
    pub fn turned(&self, robot_from_sensor: Pose2) -> Pose2 {
        robot_from_sensor * Pose2::new(0.0, 0.0, self.bearing_offset_rad)
    }

    /// What it reads of a distance; none for no echo.
    #[must_use]
    pub fn read(&self, distance_m: Option<f64>) -> Option<f64> {
        let read_m = (distance_m? + self.range_bias_m).max(MIN_RANGE_M);
        (read_m <= MAX_RANGE_M).then_some(read_m)
    }
}
