//! How good a run was, against the truth: computed while the run goes on, in constant memory.

mod accuracy;
mod faults;
mod map_quality;
mod relations;

pub use accuracy::{Accuracy, AccuracyMeter};
pub use faults::{FaultMeter, FaultScore, TrueFault};
pub use map_quality::{MapMeter, MapQuality, Wall};
pub use relations::{Relation, RelationError, relation_error};
