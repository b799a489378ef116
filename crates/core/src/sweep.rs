//! One sweep: one reading of every sensor of the ring, moved to a common reference instant.
//!
//! This is the paper's reading vector V\[k\] = \[x_1..x_n, y_1..y_n, X, Y, theta\] (equation 1) before it is flattened, with the
//! age and the validity of each element beside it. Ranges follow REP-117: a finite value is a measurement, +∞ is "nothing
//! within range", −∞ is "too close to measure" and NaN is "no measurement".

#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing, clippy::string_slice)]
#![deny(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)]
#![deny(clippy::allow_attributes, clippy::allow_attributes_without_reason)]

use crate::geometry::{Point, Pose2};
use crate::time::Timestamp;

/// Why there is no time of flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoMeasurement {
    /// Its message did not arrive: this says nothing about the sensor.
    Lost,
    /// The sensor's group fired, but the message has no entry for the sensor: it did not answer.
    Absent,
    /// The echo pin is stuck.
    EchoPinStuck,
    /// The echo pin was already high at the trigger.
    HighAtTrigger,
    /// The sensor is switched off in the board's configuration.
    Disabled,
    /// The reading was blanked, for example because of crosstalk.
    Blanked,
}

/// One beam of a sweep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beam {
    /// Metres from the sensor, or ±∞ or NaN as in REP-117.
    pub range_m: f64,
    /// Why `range_m` is NaN.
    pub no_measurement: Option<NoMeasurement>,
    /// Seconds from the ping to the sweep's reference instant, at least 0.
    pub age_s: f64,
    /// The sensor at the instant of its ping, in the robot frame of the reference instant.
    pub robot_from_sensor: Pose2,
    /// Half the beam's opening angle, radians.
    pub half_angle_rad: f64,
}

impl Beam {
    /// True if the beam measured a distance.
    #[must_use]
    pub fn has_range(&self) -> bool {
        self.range_m.is_finite()
    }

    /// True if the beam received no echo within its range.
    #[must_use]
    pub fn is_clear(&self) -> bool {
        self.range_m > 0.0 && self.range_m.is_infinite()
    }

    /// The endpoint on the beam's axis, in the robot frame of the reference instant; none without a distance.
    #[must_use]
    pub fn endpoint(&self) -> Option<Point> {
        self.has_range().then(|| self.robot_from_sensor.ahead(self.range_m))
    }
}

/// The clock-aligned vector V\[k\].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sweep {
    /// Counts the sweeps of a session from 0.
    pub index: u64,
    /// The reference instant: the last ping of the sweep.
    pub at: Timestamp,
    /// Seconds since the previous sweep's reference instant by the board's clock; 0 for the first.
    pub elapsed_s: f64,
    /// One beam per sensor, by sensor id.
    pub beams: Vec<Beam>,
    /// The pose from the encoders alone, odom frame: X, Y, theta.
    pub odometry: Pose2,
    /// Metres the left wheel has rolled since the previous sweep, by the configured wheel size.
    pub left_m: f64,
    /// The same for the right wheel.
    pub right_m: f64,
}
