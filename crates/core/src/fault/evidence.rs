//! The evidence of one sweep on one sensor, and the reason text of a fault.

use super::neighbours::Seen;
use super::params::Params;
use crate::event::{FaultKind, SensorState};
use crate::sweep::NoMeasurement;

/// The evidence of one sweep on one sensor.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Evidence {
    /// The reading, as REP-117.
    pub range_m: f64,
    /// Why there is none.
    pub no_measurement: Option<NoMeasurement>,
    /// Root of what PCA leaves unexplained, metres; NaN where unknown.
    pub residual_m: f64,
    /// What the sensor must hear according to the map; set only where it hears nothing.
    pub expected: Option<Expected>,
    /// The surface on which the neighbours on both sides agree.
    pub neighbours: Option<Seen>,
    /// How far the robot has moved since the last sweep, metres.
    pub moved_m: f64,
    /// A change of the reading by more is a leap, metres.
    pub leap_m: f64,
    /// A residual above is unexplained, metres.
    pub unexplained_m: f64,
    /// How far the point the sensor looks at has moved across its beam since then, metres.
    pub passed_m: f64,
}

/// What a healthy sensor hears by the map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expected {
    /// The nearest surface that answers, metres.
    pub range_m: f64,
    /// How surely it is heard, from 0 to 1.
    pub detection_probability: f64,
}

/// The reason names the neighbours where the reading lies this far beyond theirs, metres. It changes the text only.
const BEYOND_M: f64 = 0.2;

impl Evidence {
    /// How new the readings are: from 0 for a standing robot to 1.
    pub(super) fn novelty(&self, params: &Params) -> f64 {
        (self.moved_m / params.moved_m).min(1.0)
    }

    /// Why a sensor's state is what it is; `last_m` is the last range that it measured.
    pub(super) fn reason(&self, sensor: usize, state: SensorState, last_m: f64) -> String {
        match state {
            SensorState::Healthy => format!("sensor {sensor} measures again"),
            SensorState::Faulty(FaultKind::Saturated) => match (self.expected, self.neighbours) {
                (Some(Expected { range_m, .. }), None) => {
                    format!("sensor {sensor} repeatedly reports no echo where the map has a wall at {range_m:.1} m")
                }
                (_, Some(seen)) => format!(
                    "sensor {sensor} repeatedly reports no echo where {} neighbours see a wall at {:.1} m",
                    number(seen.witnesses),
                    seen.range_m
                ),
                (None, None) => format!("sensor {sensor} repeatedly reports no echo where there are walls"),
            },
            SensorState::Faulty(FaultKind::Missing) => {
                let why = match self.no_measurement {
                    Some(NoMeasurement::EchoPinStuck) => "its echo pin is stuck",
                    Some(NoMeasurement::HighAtTrigger) => "its echo pin is high before the trigger",
                    Some(NoMeasurement::Disabled) => "it is switched off on the board",
                    Some(NoMeasurement::Blanked) => "the board blanks it",
                    _ => "it never answers",
                };
                format!("sensor {sensor} gives no measurement: {why}")
            }
            SensorState::Faulty(FaultKind::Noisy) => {
                let against = match self.neighbours {
                    Some(seen) if self.range_m > seen.range_m + BEYOND_M => {
                        format!("{} neighbours see a wall at {:.1} m", number(seen.witnesses), seen.range_m)
                    }
                    _ => "its readings jump from sweep to sweep as no surface does".into(),
                };
                format!("sensor {sensor} scatters: it reads {:.1} m, and {against}", self.range_m)
            }
            SensorState::Faulty(FaultKind::Stuck) => {
                format!("sensor {sensor} reads {last_m:.3} m however the robot moves")
            }
        }
    }
}

/// A small number in words.
fn number(count: usize) -> String {
    const WORDS: [&str; 7] = ["no", "one", "two", "three", "four", "five", "six"];
    WORDS.get(count).map_or_else(|| count.to_string(), ToString::to_string)
}
