//! The configuration: defaults in the types, TOML texts that name only the differences, errors with origin, key and range.
//!
//! Every key is described in `configs/README.md`.

#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing, clippy::string_slice)]
#![deny(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)]
#![deny(clippy::allow_attributes, clippy::allow_attributes_without_reason)]

mod calibration;
mod effective;
mod keys;
mod layers;
mod nearest;
mod problem;
mod schema;
mod shape;

pub use calibration::CorrectionConfig;
pub use effective::Effective;
pub use keys::{Key, keys, values};
pub use layers::Layers;
pub use nearest::nearest;
pub use problem::{ConfigError, Origin, Problem};
pub use schema::schema;
pub use shape::Shape;

use crate::geometry::{Mounting, Pose2, Ring};
use serde::{Deserialize, Serialize};
use slamd_protocol::Setting;
use std::collections::BTreeMap;

/// The estimation method.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// The default: EKF-SLAM with the walls of a rectangular building as landmarks.
    #[default]
    Walls,
    /// The published method.
    Paper,
}

/// The whole configuration.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// The estimation method.
    pub method: Method,
    /// The drive.
    pub robot: RobotConfig,
    /// The sensors.
    pub ring: RingConfig,
    /// The map.
    pub map: MapConfig,
    /// Limits of what slamd commands to the motors.
    pub drive: DriveConfig,
    /// Settings of the board, by their names in the protocol. The board keeps its own value for the others.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub board: BTreeMap<String, SettingValue>,
}

/// Value of a board setting.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum SettingValue {
    /// False is 0, true is 1 on the wire.
    Flag(bool),
    /// A number.
    Number(i32),
}

impl SettingValue {
    /// The value on the wire.
    #[must_use]
    pub fn value(self) -> i32 {
        match self {
            Self::Flag(flag) => i32::from(flag),
            Self::Number(number) => number,
        }
    }
}

/// The drive.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RobotConfig {
    /// The robot's name.
    pub name: String,
    /// Radius of a driven wheel, metres.
    pub wheel_radius_m: f64,
    /// Distance between the driven wheels, metres.
    pub wheel_base_m: f64,
    /// Standard deviation of `wheel_base_m`, metres; 2.5 % of it if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wheel_base_sigma_m: Option<f64>,
    /// Radius of the right wheel divided by that of the left; the mean of both is `wheel_radius_m`.
    pub wheel_ratio: f64,
    /// Standard deviation of `wheel_ratio`.
    pub wheel_ratio_sigma: f64,
    /// Encoder ticks per wheel turn; the board's own value if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ticks_per_turn: Option<u32>,
    /// Maximum speed, metres per second.
    pub max_speed_m_s: f64,
    /// Maximum turn rate, radians per second.
    pub max_turn_rate_rad_s: f64,
}

impl Default for RobotConfig {
    fn default() -> Self {
        Self {
            name: "robot".into(),
            wheel_radius_m: 0.035,
            wheel_base_m: 0.26,
            wheel_base_sigma_m: None,
            wheel_ratio: 1.0,
            wheel_ratio_sigma: 0.012,
            ticks_per_turn: None,
            max_speed_m_s: 0.6,
            max_turn_rate_rad_s: 2.5,
        }
    }
}

/// The sensors. Their positions come from the board unless `sensors` or `circle` is given.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RingConfig {
    /// Nearest distance a sensor measures, metres.
    pub min_range_m: f64,
    /// Farthest distance a sensor measures, metres; beyond it is "nothing in range".
    pub max_range_m: f64,
    /// Standard deviation of a reading, metres; if absent slamd begins with 0.02.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range_sigma_m: Option<f64>,
    /// True over reported range: 2 for a board that reports the time of flight one way.
    pub range_scale: f64,
    /// Air temperature until the board reports one, degrees Celsius.
    pub temperature_c: f64,
    /// Sensors evenly around a circle.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub circle: Option<CircleConfig>,
    /// Sensors one by one.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sensors: Vec<SensorConfig>,
    /// Rotation of the whole ring against the geometry above or the board's, degrees counter-clockwise.
    pub rotation_deg: f64,
    /// True if left and right of that geometry are exchanged: the sensors are numbered the other way round.
    pub mirrored: bool,
    /// Corrections of single sensors, found by `slamd calibrate`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub corrections: Vec<CorrectionConfig>,
}

impl Default for RingConfig {
    fn default() -> Self {
        Self {
            min_range_m: 0.03,
            max_range_m: 3.0,
            range_sigma_m: None,
            range_scale: 1.0,
            temperature_c: 20.0,
            circle: None,
            sensors: Vec::new(),
            rotation_deg: 0.0,
            mirrored: false,
            corrections: Vec::new(),
        }
    }
}

/// Sensors evenly around a circle, facing outward.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CircleConfig {
    /// Number of sensors.
    pub count: u8,
    /// Radius of the circle, metres.
    pub radius_m: f64,
    /// Half the beam's opening angle, degrees.
    pub half_angle_deg: f64,
    /// Number of firing groups, interleaved around the ring.
    #[serde(default = "one")]
    pub groups: u8,
    /// True if the sensors are numbered clockwise from straight ahead.
    #[serde(default)]
    pub clockwise: bool,
}

/// One sensor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorConfig {
    /// Metres ahead of the axle's middle.
    #[serde(default)]
    pub x_m: f64,
    /// Metres to the left of the axle's middle.
    #[serde(default)]
    pub y_m: f64,
    /// Direction of the beam, degrees counter-clockwise from straight ahead.
    pub bearing_deg: f64,
    /// Half the beam's opening angle, degrees.
    pub half_angle_deg: f64,
    /// Firing group.
    #[serde(default)]
    pub group: u8,
}

/// The map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MapConfig {
    /// Side of a cell, metres. The paper's method always uses 0.01.
    pub cell_m: f64,
}

impl Default for MapConfig {
    fn default() -> Self {
        Self { cell_m: 0.05 }
    }
}

/// Limits of what slamd commands to the motors, with `--drive`. The board has limits of its own.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DriveConfig {
    /// Highest speed forward or backward, metres per second.
    pub max_speed_m_s: f64,
    /// Highest turn rate, radians per second.
    pub max_turn_rad_s: f64,
    /// Ramp of the speed, metres per second squared.
    pub acceleration_m_s2: f64,
    /// Ramp of the turn rate, radians per second squared.
    pub turn_acceleration_rad_s2: f64,
    /// So long after its last command a client remains the only one that may drive, seconds.
    pub lease_s: f64,
}

impl Default for DriveConfig {
    fn default() -> Self {
        Self {
            max_speed_m_s: 0.2,
            max_turn_rad_s: 1.0,
            acceleration_m_s2: 0.4,
            turn_acceleration_rad_s2: 3.0,
            lease_s: 3.0,
        }
    }
}

const fn one() -> u8 {
    1
}

impl Config {
    /// Reads a TOML text.
    ///
    /// # Errors
    /// Unknown keys, values of the wrong type and values out of range. Nothing is repaired silently.
    pub fn from_toml(text: &str) -> Result<Self, ConfigError> {
        let mut layers = Layers::default();
        layers.text(None, text);
        Ok(layers.finish()?.config)
    }

    /// The TOML text of this configuration; [`Config::from_toml`] reads it back.
    #[must_use]
    #[expect(clippy::expect_used, reason = "TOML has a form for each type that the configuration is made of")]
    pub fn to_toml(&self) -> String {
        toml::to_string(self).expect("plain numbers, strings and tables")
    }

    #[expect(clippy::expect_used, reason = "TOML has a form for each type that the configuration is made of")]
    fn to_table(&self) -> toml::Table {
        toml::Table::try_from(self).expect("plain numbers, strings and tables")
    }

    /// The board's settings that the configuration names.
    pub fn settings(&self) -> impl Iterator<Item = (Setting, i32)> {
        self.board.iter().filter_map(|(name, value)| Some((Setting::from_name(name)?, value.value())))
    }
}

impl RingConfig {
    /// The ring from the configuration, if it has one.
    #[must_use]
    pub fn ring(&self) -> Option<Ring> {
        if let Some(circle) = &self.circle {
            let mut ring =
                Ring::circle(circle.count, circle.radius_m, circle.half_angle_deg.to_radians(), circle.groups);
            if circle.clockwise {
                for mounting in &mut ring.mountings {
                    let pose = mounting.robot_from_sensor;
                    mounting.robot_from_sensor = Pose2::new(pose.x_m, -pose.y_m, -pose.theta_rad);
                }
            }
            return Some(self.mounted(ring));
        }
        let mountings = self.sensors.iter().map(|sensor| Mounting {
            robot_from_sensor: Pose2::new(sensor.x_m, sensor.y_m, sensor.bearing_deg.to_radians()),
            half_angle_rad: sensor.half_angle_deg.to_radians(),
            group: sensor.group,
        });
        (!self.sensors.is_empty()).then(|| self.mounted(Ring { mountings: mountings.collect() }))
    }

    /// A ring as it is mounted on the robot: mirrored and turned as configured.
    #[must_use]
    pub fn mounted(&self, mut ring: Ring) -> Ring {
        let turned = Pose2::new(0.0, 0.0, self.rotation_deg.to_radians());
        for mounting in &mut ring.mountings {
            let pose = mounting.robot_from_sensor;
            let mirrored = Pose2::new(pose.x_m, -pose.y_m, -pose.theta_rad);
            let sided = if self.mirrored { mirrored } else { pose };
            mounting.robot_from_sensor = if self.rotation_deg == 0.0 { sided } else { turned * sided };
        }
        ring
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_survive_the_round_trip() {
        let config = Config::default();
        assert_eq!(Config::from_toml(&config.to_toml()), Ok(config));
    }

    #[test]
    fn a_ring_is_mounted_mirrored_and_turned() {
        let circle = "[ring.circle]\ncount = 4\nradius_m = 0.2\nhalf_angle_deg = 10\n";
        let text = format!("[ring]\nrotation_deg = 30\nmirrored = true\n{circle}");
        let ring = Config::from_toml(&text).unwrap().ring.ring().unwrap();
        let degrees = |sensor: usize| ring.mountings[sensor].robot_from_sensor.theta_rad.to_degrees();
        assert!((degrees(0) - 30.0).abs() < 1e-9 && (degrees(1) + 60.0).abs() < 1e-9);
        let plain = Config::from_toml(circle).unwrap();
        assert_eq!(plain.ring.ring(), Some(Ring::circle(4, 0.2, 10f64.to_radians(), 1)));
    }

    #[test]
    fn a_clockwise_circle_turns_right() {
        let config =
            Config::from_toml("[ring.circle]\ncount = 24\nradius_m = 0.2\nhalf_angle_deg = 10\nclockwise = true\n")
                .unwrap();
        let ring = config.ring.ring().unwrap();
        assert!((ring.mountings[1].robot_from_sensor.theta_rad.to_degrees() + 15.0).abs() < 1e-9);
        assert!(ring.mountings[6].robot_from_sensor.y_m < -0.19);
    }
}
