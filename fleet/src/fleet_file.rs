//! `fleet.toml`: the robots of a site, and the start pose of each, if known.

use crate::name::Name;
use serde::Deserialize;
use slamd_core::Pose2;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The file.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FleetFile {
    /// Side of a cell of the merged map, metres.
    #[serde(default = "cell_m")]
    cell_m: f64,
    /// The robots. Others are refused.
    robots: BTreeMap<Name, Robot>,
}

/// A robot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Robot {
    /// Start pose of its drives. If it is missing, its map is aligned with the others'.
    pub start: Option<StartPose>,
}

/// A robot's start pose on the site.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StartPose {
    /// Metres.
    pub x_m: f64,
    /// Metres.
    pub y_m: f64,
    /// Counter-clockwise from the site's x axis.
    pub heading_deg: f64,
}

/// A fleet file that cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("{}: {cause}", path.display())]
pub struct FleetFileError {
    /// The file.
    pub path: PathBuf,
    /// Why, and what is expected.
    pub cause: String,
}

/// Metres from the site's origin.
const FARTHEST_M: f64 = 10_000.0;
const MAX_ROBOTS: usize = 1_000;

const fn cell_m() -> f64 {
    0.05
}

impl StartPose {
    /// As a pose.
    #[must_use]
    pub fn pose(&self) -> Pose2 {
        Pose2::new(self.x_m, self.y_m, self.heading_deg.to_radians())
    }
}

impl FleetFile {
    /// Reads the file.
    ///
    /// # Errors
    /// Where it cannot be read or says what cannot be, with the line.
    pub fn read(path: &Path) -> Result<Self, FleetFileError> {
        let text =
            std::fs::read_to_string(path).map_err(|error| format!("{error}; name an existing file with --fleet"));
        text.and_then(|text| Self::from_toml(&text)).map_err(|cause| FleetFileError { path: path.into(), cause })
    }

    /// From its text.
    ///
    /// # Errors
    /// Where it says what cannot be.
    pub fn from_toml(text: &str) -> Result<Self, String> {
        let file: Self = toml::from_str(text).map_err(|error| error.to_string())?;
        if !(0.01..=1.0).contains(&file.cell_m) {
            return Err(format!("cell_m = {} must be from 0.01 to 1 m", file.cell_m));
        }
        if !(1..=MAX_ROBOTS).contains(&file.robots.len()) {
            return Err(format!("{} robots: name 1 to {MAX_ROBOTS}, each as [robots.NAME]", file.robots.len()));
        }
        for (name, robot) in &file.robots {
            let is_good = |start: &StartPose| {
                let StartPose { x_m, y_m, heading_deg } = start;
                x_m.abs() <= FARTHEST_M && y_m.abs() <= FARTHEST_M && heading_deg.abs() <= 360.0
            };
            if !robot.start.as_ref().is_none_or(is_good) {
                return Err(format!(
                    "robots.{name}.start must lie within {FARTHEST_M} m of the origin, its heading from -360 to 360 degrees"
                ));
            }
        }
        Ok(file)
    }

    /// The robots, by name.
    #[must_use]
    pub const fn robots(&self) -> &BTreeMap<Name, Robot> {
        &self.robots
    }

    /// Side of a cell of the merged map, micrometres.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0.01 to 1 m")]
    pub fn cell_um(&self) -> u32 {
        libm::round(self.cell_m * 1e6) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_example_is_good() {
        let file = FleetFile::from_toml(include_str!("../fleet.example.toml")).unwrap();
        let starts: Vec<_> = file.robots().iter().map(|(name, robot)| (name.as_ref(), robot.start.is_some())).collect();
        assert_eq!(starts, [("attic", false), ("hall", true), ("kitchen", true)]);
        assert_eq!(file.cell_um(), 50_000);
    }

    #[test]
    fn errors_name_the_invalid_value() {
        let words = |text: &str| FleetFile::from_toml(text).unwrap_err();
        assert!(words("[robots]").contains("0 robots"));
        assert!(words("cell_m = 3.0\n[robots.a]").contains("0.01 to 1"));
        assert!(words("[robots.a]\nstrat = 1").contains("strat"));
        assert!(words("[robots.\"a/b\"]").contains("a-z"));
        assert!(words("[robots.a]\nstart = { x_m = nan, y_m = 0.0, heading_deg = 0.0 }").contains("robots.a.start"));
    }
}
