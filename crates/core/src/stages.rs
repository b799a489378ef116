//! The stages of the default method, one by one: for a method of your own, for calibration and for benches.
//!
//! A program that maps does not need them. They change more often than the rest of the crate.
//! [`Params`] holds the constants of all of them.

pub use crate::align::Aligner;
pub use crate::align::clock::{ClockMap, Widener};
pub use crate::align::params::Params as AlignParams;
pub use crate::align::track::Wheels;
pub use crate::align::trouble::{What, WheelTrouble};
pub use crate::align::wheel_steps::WheelSteps;
pub use crate::fault::detector::Detector;
pub use crate::fault::params::Params as FaultParams;
pub use crate::fault::pca::{INSTANTS, PcaBlock};
pub use crate::localize::params::Params as LocalizeParams;
pub use crate::localize::search::Searcher;
pub use crate::mapping::cone::{ReturnKind, integrate_beam, mark_wall};
pub use crate::mapping::grid::{OccupancyGrid, percents};
pub use crate::mapping::params::Params as MappingParams;
pub use crate::mapping::raster::MAX_CELLS;
pub use crate::orientation::dominant_directions::DominantDirections;
pub use crate::orientation::params::{DirectionsParams, Params as OrientationParams, StartParams, TrackParams};
pub use crate::params::Params;
pub use crate::position::beam_model::observe_wall;
pub use crate::position::ekf_slam::EkfSlam;
pub use crate::position::filter::Filter;
pub use crate::position::params::{
    AgreementParams, BeamParams, FilterParams, InactiveParams, InitializerParams, MonitorParams, NoiseParams,
    Params as PositionParams, RelocalizeParams, SlamParams, WhitenessParams,
};
pub use crate::robot_model::params::Params as RobotModelParams;
pub use crate::wall_slam::WallSlam;
pub use crate::wall_slam::params::Params as WallSlamParams;
pub use crate::wall_slam::place::params::{Params as PlaceParams, SearchParams};
