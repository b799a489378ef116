//! What the walls say about the robot, and the configuration key that mends it.

use crate::time::Timestamp;

/// One way in which a robot differs from its configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ModelAspect {
    /// Both wheels report another travel than the walls show: straight and turning by the same factor.
    WheelScale,
    /// The wheels turn the robot by another angle than the walls show; straight travel is right.
    TurnScale,
    /// The ranges are in another unit: straight travel differs, turning does not.
    RangeScale,
    /// The wheels turn left where the walls say right: wheels swapped, or sensors numbered the other way round.
    TurnSign,
    /// The wheels drive forward where the walls say backward, and turn the wrong way: both count backwards.
    WheelSigns,
    /// The sensors are mounted at an angle to what the configuration says.
    RingRotation,
    /// One sensor looks in another direction.
    SensorBearing(usize),
    /// The readings scatter more than is assumed.
    RangeNoise,
    /// The echoes fit no robot and no map: wheels and walls tell different motions.
    Inconsistent,
}

impl ModelAspect {
    /// The word used in files.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::WheelScale => "wheel_scale",
            Self::TurnScale => "turn_scale",
            Self::RangeScale => "range_scale",
            Self::TurnSign => "turn_sign",
            Self::WheelSigns => "wheel_signs",
            Self::RingRotation => "ring_rotation",
            Self::SensorBearing(_) => "sensor_bearing",
            Self::RangeNoise => "range_noise",
            Self::Inconsistent => "inconsistent",
        }
    }
}

/// What differs, by how much, and what mends it.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelFinding {
    /// What differs.
    pub aspect: ModelAspect,
    /// Its measure: a factor (reported over true), or degrees for bearings, or metres for noise.
    pub measured: f64,
    /// One standard deviation of `measured`.
    pub sigma: f64,
    /// What the walls show, for people: one clause without the remedy.
    pub clause: String,
    /// The configuration key that mends it, and its value as in TOML; several where they explain the echoes alike.
    pub remedies: Vec<(&'static str, String)>,
}

/// Whether slamd corrects a difference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ModelState {
    /// It is not corrected: poses are uncertain.
    Doubted,
    /// It is corrected from here on, and the map was begun anew with it.
    Corrected,
    /// It is gone.
    Resolved,
}

impl ModelState {
    /// The word used in files.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Doubted => "doubted",
            Self::Corrected => "corrected",
            Self::Resolved => "resolved",
        }
    }
}

/// A finding began, changed or ended.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelEvent {
    /// The sweep's reference instant.
    pub at: Timestamp,
    /// The first instant whose data show it.
    pub since: Timestamp,
    /// What differs. A later event of the same aspect replaces this one.
    pub finding: ModelFinding,
    /// What slamd does about it.
    pub state: ModelState,
}

impl ModelEvent {
    /// The event as one sentence for people.
    #[must_use]
    pub fn sentence(&self) -> String {
        let ModelFinding { clause, remedies, .. } = &self.finding;
        if self.state == ModelState::Resolved {
            return format!("no longer: {clause}");
        }
        let remedies: Vec<String> = remedies.iter().map(|(key, value)| format!("{key} = {value}")).collect();
        let effect = match self.state {
            ModelState::Corrected => "; corrected for this run",
            ModelState::Doubted | ModelState::Resolved => "; poses are uncertain",
        };
        if remedies.is_empty() {
            format!("{clause}{effect}")
        } else {
            format!("{clause}: {}?{effect}", remedies.join(" or "))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sentence_names_the_key_and_the_value_that_mend_it() {
        let finding = ModelFinding {
            aspect: ModelAspect::WheelScale,
            measured: 4.0,
            sigma: 0.1,
            clause: "the wheels report 4.0 times the travel that the walls show".into(),
            remedies: vec![("robot.ticks_per_turn", "1440".into())],
        };
        let at = Timestamp::default();
        let event = ModelEvent { at, since: at, finding, state: ModelState::Doubted };
        let expected = "the wheels report 4.0 times the travel that the walls show: robot.ticks_per_turn = 1440?; poses are uncertain";
        assert_eq!(event.sentence(), expected);
        let resolved = ModelEvent { state: ModelState::Resolved, ..event };
        assert!(resolved.sentence().starts_with("no longer: "));
    }
}
