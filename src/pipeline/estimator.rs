//! The methods to choose from, behind one face.

use crate::config::{Config, Method};
use crate::event::{Calibration, Event, SensorState};
use crate::geometry::Ring;
use crate::localize::Localizer;
use crate::mapping::raster::Raster;
use crate::paper::Paper;
use crate::saved_state::{InvalidState, SavedState};
use crate::sweep::Sweep;
use crate::wall_slam::WallSlam;

/// What a run begins with.
#[derive(Clone, Debug, Default)]
pub enum Start {
    /// An unknown building.
    #[default]
    Fresh,
    /// The remembered building, the robot where it stood.
    Resume(Box<SavedState>),
    /// The remembered building, which is not changed, the robot anywhere in it.
    Localize(Box<SavedState>),
}

/// The chosen method at work.
#[derive(Debug)]
pub(super) enum Estimator {
    Walls(Box<WallSlam>),
    Paper(Box<Paper>),
    Localizer(Box<Localizer>),
}

impl Estimator {
    pub(super) fn new(config: &Config, ring: &Ring, start: &Start) -> Result<Self, InvalidState> {
        Ok(match (config.method, start) {
            (Method::Walls, Start::Fresh) => Self::Walls(Box::new(WallSlam::new(config, ring))),
            (Method::Walls, Start::Resume(memory)) => Self::Walls(Box::new(WallSlam::resume(config, ring, memory)?)),
            (Method::Walls, Start::Localize(memory)) => {
                Self::Localizer(Box::new(Localizer::new(config, ring, memory)?))
            }
            (Method::Paper, Start::Fresh) => Self::Paper(Box::new(Paper::new(config, ring))),
            (Method::Paper, _) => return Err(InvalidState("the paper's method cannot begin with a known map")),
        })
    }

    pub(super) fn update(&mut self, sweep: &Sweep, events: &mut Vec<Event>) {
        match self {
            Self::Walls(walls) => walls.update(sweep, events),
            Self::Paper(paper) => paper.update(sweep, events),
            Self::Localizer(localizer) => localizer.update(sweep, events),
        }
    }

    pub(super) fn end(&mut self, events: &mut Vec<Event>) {
        match self {
            Self::Walls(walls) => walls.end(events),
            // In a known map nothing waits once the place is found.
            Self::Paper(_) | Self::Localizer(_) => {}
        }
    }

    pub(super) fn raster(&self) -> Raster {
        match self {
            Self::Walls(walls) => walls.raster(),
            Self::Paper(paper) => paper.raster(),
            Self::Localizer(localizer) => localizer.raster(),
        }
    }

    pub(super) fn states(&self) -> &[SensorState] {
        match self {
            Self::Walls(walls) => walls.states(),
            Self::Paper(paper) => paper.states(),
            Self::Localizer(localizer) => localizer.states(),
        }
    }

    /// Which encoders' counts are to be taken with the sign turned over, left and right.
    pub(super) fn reversed_encoders(&self) -> [bool; 2] {
        match self {
            Self::Walls(walls) => walls.reversed_encoders(),
            Self::Paper(_) => [false; 2],
            Self::Localizer(localizer) => localizer.walls().reversed_encoders(),
        }
    }

    pub(super) fn calibration(&self) -> Option<Calibration> {
        match self {
            Self::Walls(walls) => Some(walls.calibration()),
            Self::Paper(_) => None,
            Self::Localizer(localizer) => Some(localizer.calibration()),
        }
    }

    pub(super) fn saved_state(&self) -> Option<SavedState> {
        match self {
            Self::Walls(walls) => walls.saved_state(),
            Self::Paper(_) | Self::Localizer(_) => None,
        }
    }

    pub(super) fn nis(&self) -> f64 {
        match self {
            Self::Walls(walls) => walls.nis(),
            Self::Paper(_) | Self::Localizer(_) => f64::NAN,
        }
    }
}
