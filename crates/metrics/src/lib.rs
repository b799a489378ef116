//! Measures the accuracy of a run against the truth: trajectory, map and fault detection.

mod accuracy;
mod consistency;
mod detection;
mod faults;
mod map_quality;
mod pairing;
mod quantile;
mod relations;
mod relative;

pub use accuracy::{Accuracy, AccuracyMeter};
pub use consistency::{building_frame, mean_nees};
pub use detection::{Detection, FaultMeter, FaultScore, KindSums};
pub use faults::TrueFault;
pub use map_quality::{MapMeter, MapQuality, Wall};
pub use pairing::{Pair, Pairing};
pub use quantile::quantile;
pub use relations::{Relation, RelationError, relation_error};
pub use relative::{RelativeError, relative_error};
