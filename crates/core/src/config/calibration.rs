//! Calibration of a robot: its wheels with their uncertainty, and corrections of single sensors.

use super::{Config, RobotConfig};
use crate::event::Calibration;
use serde::{Deserialize, Serialize};

/// Correction of one sensor against its nominal geometry.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CorrectionConfig {
    /// The sensor's id.
    pub sensor: u8,
    /// Excess of its readings, metres.
    #[serde(default)]
    pub range_bias_m: f64,
    /// Its rotation against the ring's geometry, degrees counter-clockwise.
    #[serde(default)]
    pub bearing_offset_deg: f64,
}

/// Relative standard deviation of a wheel base measured with a ruler.
const BASE_SIGMA: f64 = 0.025;

impl RobotConfig {
    /// The configured wheels with their uncertainty.
    #[must_use]
    pub fn wheels(&self) -> Calibration {
        Calibration {
            wheel_ratio: self.wheel_ratio,
            wheel_ratio_sigma: self.wheel_ratio_sigma,
            wheel_base_m: self.wheel_base_m,
            wheel_base_sigma_m: self.wheel_base_sigma_m.unwrap_or(BASE_SIGMA * self.wheel_base_m),
        }
    }

    /// Sets the wheels, rounded to six decimals: nobody can measure more.
    pub fn set_wheels(&mut self, wheels: &Calibration) {
        let rounded = |value: f64| (1e6 * value).round() / 1e6;
        self.wheel_ratio = rounded(wheels.wheel_ratio);
        self.wheel_ratio_sigma = rounded(wheels.wheel_ratio_sigma).max(SIGMA_FLOOR);
        self.wheel_base_m = rounded(wheels.wheel_base_m);
        self.wheel_base_sigma_m = Some(rounded(wheels.wheel_base_sigma_m).max(SIGMA_FLOOR));
    }
}

/// Lower bound of the configured standard deviations.
pub(super) const SIGMA_FLOOR: f64 = 1e-5;

impl Config {
    /// TOML text of the keys with other values than the defaults: the content of a robot's file.
    ///
    /// # Panics
    /// Never: every configuration has a TOML form.
    #[must_use]
    #[expect(clippy::expect_used, reason = "TOML has a form for each type that the configuration is made of")]
    pub fn to_toml_differences(&self) -> String {
        let mut differences = self.to_table();
        remove_equal(&mut differences, &Self::default().to_table());
        toml::to_string(&differences).expect("a table made of a table")
    }
}

fn remove_equal(table: &mut toml::Table, default: &toml::Table) {
    table.retain(|key, value| match (value, default.get(key)) {
        (toml::Value::Table(inner), Some(toml::Value::Table(default))) => {
            remove_equal(inner, default);
            !inner.is_empty()
        }
        (value, Some(default)) => value != default,
        (_, None) => true,
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_differences_read_back_as_the_whole() {
        let mut config = Config::default();
        assert_eq!(config.to_toml_differences(), "");
        config.robot.set_wheels(&Calibration {
            wheel_ratio: 1.012_345_678,
            wheel_ratio_sigma: 0.000_4,
            wheel_base_m: 0.2512,
            wheel_base_sigma_m: 0.000_9,
        });
        config.ring.corrections = vec![CorrectionConfig { sensor: 3, range_bias_m: -0.02, bearing_offset_deg: 1.5 }];
        let text = config.to_toml_differences();
        assert!(text.contains("wheel_ratio = 1.012346") && !text.contains("max_range_m"), "{text}");
        assert_eq!(Config::from_toml(&text), Ok(config));
    }
}
