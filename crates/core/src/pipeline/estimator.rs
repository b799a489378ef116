//! The methods to choose from, behind one trait.

use crate::config::{Config, Method};
use crate::event::{Calibration, Event, SensorState, Verdict};
use crate::geometry::{Ring, Segment};
use crate::localize::Localizer;
use crate::mapping::grid::MapChange;
use crate::mapping::raster::Raster;
use crate::params::Params;
use crate::robot_model::CheckedSlam;
use crate::saved_state::{InvalidState, SavedState};
use crate::sweep::Sweep;
use crate::time::Timestamp;

/// What a run begins with.
#[derive(Clone, Debug, Default)]
pub enum Start {
    /// An unknown building.
    #[default]
    Fresh,
    /// The saved building, the robot where it stood.
    Resume(Box<SavedState>),
    /// The saved building, which is not changed, the robot anywhere in it.
    Localize(Box<SavedState>),
}

/// What a method without a pose has so far: it waits for the robot to move, or for returns that agree on the building's axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Waiting {
    /// How far the wheels have rolled in the collected sweeps, metres; the farther of the two in each sweep.
    pub rolled_m: f64,
    /// Collected readings with an echo.
    pub returns: usize,
}

/// A method that turns sweeps into poses, faults and a map. What a method does not have keeps its default.
pub trait Estimator: std::fmt::Debug + Send {
    /// Uses one sweep; pushes an [`Event::Estimate`] for each sweep whose pose is known now, and what else has happened.
    fn update(&mut self, sweep: &Sweep, events: &mut Vec<Event>);

    /// Uses the sweeps that still wait: no more will come.
    fn end(&mut self, _events: &mut Vec<Event>) {}

    /// Forgets what it has mapped: nothing of it was right.
    fn begin_anew(&mut self, _at: Timestamp, _events: &mut Vec<Event>) {}

    /// The map.
    fn raster(&self) -> Raster;

    /// What has changed of the map in `revision` or later, and the newest revision; revision 0 asks for everything.
    fn map_since(&self, revision: u64) -> Option<(MapChange, u64)>;

    /// By sensor: its state.
    fn states(&self) -> &[SensorState];

    /// What became of a sensor's beam in the last sweep.
    fn verdict(&self, sensor: usize) -> Verdict;

    /// The evidence that a sensor is faulty, as a log-likelihood ratio, and the root of what PCA leaves unexplained of its
    /// readings, metres. NaN where the method has no such thing.
    fn fault_evidence(&self, sensor: usize) -> (f64, f64);

    /// The walls that are known, map frame.
    fn segments(&self) -> Vec<Segment>;

    /// What it waits for while there is no pose; none once there is one, or where the method does not say.
    fn waiting(&self) -> Option<Waiting> {
        None
    }

    /// Which encoders' counts to negate, left and right.
    fn reversed_encoders(&self) -> [bool; 2] {
        [false; 2]
    }

    /// The wheels as learnt so far.
    fn calibration(&self) -> Option<Calibration> {
        None
    }

    /// What the next run can go on from.
    fn saved_state(&self) -> Option<SavedState> {
        None
    }

    /// Normalised innovation squared of the last sweep, per measurement; NaN where nothing was measured.
    fn nis(&self) -> f64 {
        f64::NAN
    }
}

/// Makes the configured method for a ring and a start, with the given constants of the default method's stages.
///
/// # Errors
/// Where the saved state is invalid, or the method cannot use it.
pub type Methods = fn(&Config, &Ring, &Start, &Params) -> Result<Box<dyn Estimator>, InvalidState>;

/// The methods of this crate: the default one, and the search in a known map.
///
/// # Errors
/// As [`Methods`]; for [`Method::Paper`], which is a crate of its own.
pub fn built_in(
    config: &Config,
    ring: &Ring,
    start: &Start,
    params: &Params,
) -> Result<Box<dyn Estimator>, InvalidState> {
    if config.method == Method::Paper {
        return Err(InvalidState("the paper's method is not in this program"));
    }
    Ok(match start {
        Start::Fresh => Box::new(CheckedSlam::new(config, ring, params)),
        Start::Resume(state) => Box::new(CheckedSlam::resume(config, ring, state, params)?),
        Start::Localize(state) => Box::new(Localizer::with_params(config, ring, state, params)?),
    })
}
