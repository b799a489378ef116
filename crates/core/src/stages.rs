//! The stages of the default method, one by one: for a method of your own, for calibration and for benches.
//!
//! A program that maps does not need them. They change more often than the rest of the crate.

pub use crate::align::Aligner;
pub use crate::align::clock::{ClockMap, Widener};
pub use crate::align::track::Wheels;
pub use crate::fault::detector::Detector;
pub use crate::fault::pca::{INSTANTS, PcaBlock};
pub use crate::localize::search::Searcher;
pub use crate::mapping::cone::{ReturnKind, integrate_beam, mark_wall};
pub use crate::mapping::grid::{OccupancyGrid, percents};
pub use crate::mapping::raster::MAX_CELLS;
pub use crate::orientation::dominant_directions::DominantDirections;
pub use crate::position::beam_model::observe_wall;
pub use crate::position::ekf_slam::EkfSlam;
pub use crate::position::filter::Filter;
pub use crate::position::params::BeamParams;
pub use crate::wall_slam::WallSlam;
