//! How good a run was, against the truth: computed while the run goes on, in constant memory.

mod accuracy;
mod faults;

pub use accuracy::{Accuracy, AccuracyMeter};
pub use faults::{FaultMeter, FaultScore, Tally, TrueFault};
