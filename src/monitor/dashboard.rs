//! What the screen shows: a session's state, the link, rates and the map; small enough to be copied ten times a second.

use crate::monitor::track::Track;
use slamd_core::{Point, Pose2, Raster, Rates, SensorState, Snapshot, Waiting, link::LinkState};
use std::sync::Arc;

/// What one screen shows.
#[derive(Clone, Debug, Default)]
pub struct Dashboard {
    /// The session's state.
    pub session: Snapshot,
    /// The link's health, or what a replay does.
    pub line: Line,
    /// What is counted per second, lately.
    pub rates: Rates,
    /// The farthest that a sensor measures, metres.
    pub max_range_m: f64,
    /// The map, which is renewed less often than the rest.
    pub plan: Arc<Plan>,
    /// Where the robot has been.
    pub track: Track,
    /// What the method waits for, while it has no pose.
    pub waiting: Option<Waiting>,
}

/// A robot that has rolled less has not moved: an encoder may tremble by a tick. Metres.
const STANDSTILL_M: f64 = 0.02;

impl Dashboard {
    /// Why there is no map yet, and what to do; none once there is one.
    pub(super) fn no_map(&self) -> Option<String> {
        let Snapshot { counters, ring, .. } = &self.session;
        if self.plan.known.is_some() {
            return None;
        }
        Some(if counters.frames == 0 {
            "no map yet: no frame has come from the board".into()
        } else if ring.is_empty() {
            "no map yet: the board has not described its sensors".into()
        } else if counters.sweeps == 0 {
            "no map yet: no sweep is complete".into()
        } else {
            match self.waiting {
                Some(Waiting { rolled_m, .. }) if rolled_m < STANDSTILL_M => {
                    "no map yet: the robot has not moved; drive it".into()
                }
                Some(Waiting { returns: 0, .. }) => {
                    format!("no map yet: no sensor has measured a wall within {:.1} m", self.max_range_m)
                }
                Some(Waiting { rolled_m, .. }) => format!(
                    "no map yet: {rolled_m:.1} m driven, and the walls' direction is not clear; drive on along the walls"
                ),
                None => "no map yet: no echo has come often enough from one place".into(),
            }
        })
    }

    /// The last sweep on the ring as it is mounted, by sensor; empty while no ring is known.
    pub(super) fn beams(&self) -> impl Iterator<Item = Beam> {
        let Snapshot { ring, ranges_m, states, .. } = &self.session;
        ring.mountings.iter().enumerate().map(|(sensor, mounting)| {
            let range_m = ranges_m.get(sensor).copied().unwrap_or(f64::NAN);
            let state = match states.get(sensor) {
                Some(SensorState::Faulty(_)) => BeamState::Faulty,
                _ if range_m.is_nan() => BeamState::Silent,
                _ => BeamState::Healthy,
            };
            Beam { robot_from_sensor: mounting.robot_from_sensor, range_m, state }
        })
    }
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
pub(super) struct Beam {
    /// Where it sits; its x axis is the beam's.
    pub(super) robot_from_sensor: Pose2,
    /// Metres, or as in REP-117.
    pub(super) range_m: f64,
    /// What it is worth.
    pub(super) state: BeamState,
}

/// What a sensor's beam is worth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum BeamState {
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

#[cfg(test)]
mod tests {
    use super::*;
    use slamd_core::{Counters, Ring};

    #[test]
    fn the_first_thing_that_a_map_lacks_is_told() {
        let told = |counters, ring, waiting| {
            let session = Snapshot { counters, ring, ..Snapshot::default() };
            Dashboard { session, waiting, max_range_m: 4.0, ..Dashboard::default() }.no_map().unwrap()
        };
        let none = Counters::default();
        let frames = Counters { frames: 9, ..none };
        let sweeps = Counters { sweeps: 9, ..frames };
        let ring = || Ring::circle(8, 0.1, 0.2, 1);
        assert!(told(none, Ring::default(), None).contains("no frame"));
        assert!(told(frames, Ring::default(), None).contains("not described"));
        assert!(told(frames, ring(), None).contains("no sweep"));
        let waiting = |rolled_m, returns| told(sweeps, ring(), Some(Waiting { rolled_m, returns }));
        assert!(waiting(0.0, 0).contains("has not moved"));
        assert!(waiting(1.0, 0).contains("within 4.0 m"));
        assert!(waiting(1.0, 50).contains("1.0 m driven"));
        assert!(told(sweeps, ring(), None).contains("no echo"));
    }
}
