//! What is shown: one moment of a session, small enough to be copied ten times a second.

use slamd_core::event::{Calibration, Counters, EncoderState, Estimate, FaultEvent};
use slamd_core::geometry::{Point, Pose2};
use slamd_core::link::LinkState;
use slamd_core::mapping::raster::Raster;
use slamd_core::rates::Rates;
use slamd_core::time::Timestamp;
use std::sync::Arc;

/// One moment of a session.
#[derive(Clone, Debug, Default)]
pub struct Snapshot {
    /// The robot's name.
    pub robot: String,
    /// Session time.
    pub at: Timestamp,
    /// How the bytes come.
    pub line: Line,
    /// What has been counted.
    pub counters: Counters,
    /// The same per second, lately.
    pub rates: Rates,
    /// The last sweep, one beam per sensor, by id; empty while no ring is known.
    pub beams: Vec<Beam>,
    /// The farthest that a sensor measures, metres.
    pub max_range_m: f64,
    /// The faulty sensors with the reason in words.
    pub faults: Vec<FaultEvent>,
    /// The left and the right wheel's encoder.
    pub encoders: [EncoderState; 2],
    /// The newest pose.
    pub estimate: Option<Estimate>,
    /// The wheels as learnt so far, where the method learns them.
    pub calibration: Option<Calibration>,
    /// The map, which is renewed less often than the rest.
    pub plan: Arc<Plan>,
}

/// The state of the line in words.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Line {
    /// One word.
    pub word: &'static str,
    /// Why, and what to do about it.
    pub cause: String,
    /// How good that is.
    pub tone: Tone,
}

/// How good something is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tone {
    /// As it should be.
    Good,
    /// On its way there.
    #[default]
    Busy,
    /// Somebody should look.
    Bad,
}

impl Line {
    /// The state of a live line.
    #[must_use]
    pub fn new(state: LinkState, cause: String) -> Self {
        let tone = match state {
            LinkState::Streaming => Tone::Good,
            LinkState::Listening | LinkState::Handshake => Tone::Busy,
            LinkState::Searching | LinkState::Stale | LinkState::Lost => Tone::Bad,
        };
        Self { word: state.word(), cause, tone }
    }
}

/// One sensor in the last sweep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beam {
    /// Where it sits; its x axis is the beam's.
    pub robot_from_sensor: Pose2,
    /// Metres, or as in REP-117.
    pub range_m: f64,
    /// What it is worth.
    pub state: BeamState,
}

/// What a sensor's beam is worth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BeamState {
    /// It is used.
    Healthy,
    /// It is ignored.
    Faulty,
    /// It measured nothing this time.
    Silent,
}

/// A map and the part of it that is known.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plan {
    /// The cells.
    pub raster: Raster,
    /// Lower left and upper right corner of the known cells, metres; none while all are unknown.
    pub known: Option<(Point, Point)>,
}

impl Plan {
    /// Finds what is known.
    #[must_use]
    pub fn new(raster: Raster) -> Self {
        let (mut left, mut right, mut bottom, mut top) = (usize::MAX, 0, usize::MAX, 0);
        for (row, cells) in raster.occupancy.chunks_exact(raster.width.max(1)).enumerate() {
            let is_known = |cell: &i8| *cell != Raster::UNKNOWN;
            if let (Some(first), Some(last)) = (cells.iter().position(is_known), cells.iter().rposition(is_known)) {
                (left, right) = (left.min(first), right.max(last + 1));
                (bottom, top) = (bottom.min(row), row + 1);
            }
        }
        let corner = |column: usize, row: usize| {
            Point::new(raster.origin.x + raster.cell_m * column as f64, raster.origin.y + raster.cell_m * row as f64)
        };
        let known = (left < right).then(|| (corner(left, bottom), corner(right, top)));
        Self { raster, known }
    }
}
