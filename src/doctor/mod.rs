//! Diagnosis of link, sensors, wheels and clock, with remedies.
//!
//! `bytes → Examination → findings`. Like the pipeline, an examination has no clock and no port, so it handles a capture and a live board in
//! the same way.

mod clock;
mod drill;
mod drill_findings;
mod examination;
mod finding;
mod line;
mod sensors;
mod troubles;
mod wheels;

pub use drill::{Drill, DrillResult, Mistake, simple_factor};
pub use examination::Examination;
pub use finding::{Finding, Level, Report, Summary};
pub use sensors::SensorStatistics;
