//! What a drive cannot tell, and the verdict on a calibration.

use super::Report;
use super::drive::Drive;
use std::f64::consts::TAU;
use std::fmt;

/// What a drive cannot tell: the configured value is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unobservable {
    /// Wheel base and ratio: the robot hardly turns, or only one way, so that each explains the other.
    Wheels,
    /// The scale of the travel: no wall was mapped.
    Scale,
}

/// A turn less than this tells nothing of the base, radians.
const MIN_TURN_RAD: f64 = TAU;
/// Least share of the turns that go the other way.
const MIN_OTHER_WAY: f64 = 0.1;

/// What a drive cannot tell.
pub(super) fn unobservable(drive: &Drive) -> Vec<Unobservable> {
    let [left, right] = drive.turned_rad();
    let (more, less) = (left.max(right), left.min(right));
    let mut found = Vec::new();
    if drive.walls.is_empty() {
        found.push(Unobservable::Scale);
    }
    if drive.walls.is_empty() || more < MIN_TURN_RAD || less < MIN_OTHER_WAY * more {
        found.push(Unobservable::Wheels);
    }
    found
}

impl fmt::Display for Unobservable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Wheels => {
                "wheel base and wheel ratio cannot be told: the drive needs a full turn to the left and one to the right, between walls"
            }
            Self::Scale => "the scale of the wheels cannot be told: no wall was mapped",
        })
    }
}

impl Report {
    /// The verdict in one sentence.
    #[must_use]
    pub fn verdict(&self) -> String {
        let [before_cm, after_cm] = self.rms_m.map(|rms_m| format!("{:.2}", 100.0 * rms_m));
        if self.findings.iter().any(|(_, is_mended)| !is_mended) {
            return "verdict: the robot differs from its configuration; mend that first, and drive again".into();
        }
        let mended = if self.findings.is_empty() { "" } else { "the configuration is mended; " };
        let fit = if self.is_better {
            format!("the readings fit the walls to {after_cm} cm, before {before_cm} cm: the results are used")
        } else {
            format!("the readings fit the walls to {after_cm} cm, before {before_cm} cm: the old values are kept")
        };
        format!("verdict: {mended}{fit}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use slamd_core::{Calibration, Pose2, Sweep};

    fn drive(steps: impl Iterator<Item = [f64; 2]>) -> Drive {
        let sweep = |[left_m, right_m]: [f64; 2]| (Sweep { left_m, right_m, ..Sweep::default() }, Pose2::default());
        let wheels = Calibration { wheel_base_m: 0.26, ..Calibration::default() };
        let wall = slamd_core::saved_state::LandmarkState { side: 0, lo_m: 0.0, hi_m: 1.0, hits: 100 };
        Drive { steps: steps.map(sweep).collect(), wheels, walls: vec![(wall, 1.0)], ..Drive::default() }
    }

    #[test]
    fn a_drive_that_turns_one_way_tells_nothing_of_the_wheels() {
        let left = drive((0..400).map(|_| [-0.01, 0.01]));
        assert_eq!(unobservable(&left), [Unobservable::Wheels]);
        let both = drive((0..800).map(|step| if step < 400 { [-0.01, 0.01] } else { [0.01, -0.01] }));
        assert_eq!(unobservable(&both), []);
        let nowhere = Drive { walls: Vec::new(), ..both };
        assert_eq!(unobservable(&nowhere), [Unobservable::Scale, Unobservable::Wheels]);
    }
}
