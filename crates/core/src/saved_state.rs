//! The state that a run saves at its end: plain numbers, in the order of a session file.
//!
//! Each stage writes and reads its own part, and refuses impossible numbers with [`InvalidState`] when it restores the part. The
//! types here check nothing but their form. The daemon's session file stores the bytes.

#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing, clippy::string_slice)]
#![deny(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)]
#![deny(clippy::allow_attributes, clippy::allow_attributes_without_reason)]

use crate::event::{Calibration, Event, FaultEvent, SensorState};
use crate::time::Timestamp;
use serde::{Deserialize, Serialize};

/// Saved state of the default method.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SavedState {
    /// Pose, wheels and the walls near the robot.
    pub filter: FilterState,
    /// The walls in the filter, in its order.
    pub walls: Vec<LandmarkState>,
    /// The walls that are not in the filter.
    pub inactive: Vec<InactiveLandmarkState>,
    /// The map.
    pub map: MapState,
    /// Each sensor's state, by id.
    pub sensors: Vec<SensorHistory>,
    /// In what the robot was found to differ from its configuration. Files of version 1 lack it.
    pub robot: FoundRobot,
}

/// A robot that the walls showed to differ from its configuration: true over reported values.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FoundRobot {
    /// True over reported travel; negative: backward.
    pub travel: f64,
    /// True over reported rotation; negative: the other way.
    pub turn: f64,
    /// Rotation of the ring of sensors against the configured one, radians.
    pub ring_rad: f64,
    /// True over reported range.
    pub range: f64,
    /// The configured values that it differs from: it holds only for these.
    pub configured: Vec<f64>,
}

impl Default for FoundRobot {
    /// The robot of any configuration.
    fn default() -> Self {
        Self { travel: 1.0, turn: 1.0, ring_rad: 0.0, range: 1.0, configured: Vec::new() }
    }
}

impl SavedState {
    /// The saved faults of a ring of `sensors`, as events.
    pub fn faults(&self, at: Timestamp, sensors: usize) -> impl Iterator<Item = Event> {
        self.sensors.iter().take(sensors).enumerate().filter_map(move |(sensor, SensorHistory { state, .. })| {
            match state {
                SensorState::Healthy => None,
                SensorState::Faulty(kind) => {
                    let reason = format!("sensor {sensor} was {} when the session was saved", kind.word());
                    Some(Event::Fault(FaultEvent { at, sensor, state: *state, reason }))
                }
            }
        })
    }
}

/// The filter's state x and covariance P.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FilterState {
    /// The robot's part of x: x, y (m), theta (rad), relative errors of the nominal wheel ratio, wheel base and
    /// travel; older files lack the last.
    pub robot: Vec<f64>,
    /// The walls' part of x: offsets, metres.
    pub offsets_m: Vec<f64>,
    /// The lower triangle of P, row by row, the robot's part first.
    pub covariance: Vec<f64>,
    /// Nominal wheels; the wheel errors in `robot` are relative to these.
    pub nominal: Calibration,
}

/// A wall.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LandmarkState {
    /// The side it is seen from: 0 for +x, then +y, −x, −y.
    pub side: u8,
    /// Start of its seen extent along the wall, metres.
    pub lo_m: f64,
    /// End of its seen extent, metres.
    pub hi_m: f64,
    /// Sweeps that have seen it.
    pub hits: u32,
}

/// A wall that is not in the filter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct InactiveLandmarkState {
    /// The wall.
    pub wall: LandmarkState,
    /// Its offset, metres.
    pub offset_m: f64,
    /// The offset's variance, m².
    pub variance: f64,
}

/// The occupancy grid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MapState {
    /// Side of a cell, metres.
    pub cell_m: f64,
    /// The tiles, ordered by position.
    pub tiles: Vec<TileState>,
}

/// One tile of the grid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TileState {
    /// Its position along x, in tiles from the origin.
    pub column: i32,
    /// The same along y.
    pub row: i32,
    /// Log-odds in hundredths, row by row.
    pub log_odds: Vec<i16>,
    /// Per row two sets of 32 bits, bit i for column i: the wall there faces along x, along y.
    pub normal: Vec<[u32; 2]>,
}

/// One sensor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SensorHistory {
    /// Its state.
    pub state: SensorState,
    /// Number of faults, reduced by fault-free time. The more, the longer a recovery must last before the sensor is used again.
    pub recurrences: f64,
}

/// A part of the saved state is impossible.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct InvalidState(pub &'static str);
