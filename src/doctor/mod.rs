//! What is wrong with the line, the sensors, the wheels and the clock, and what to do about each.
//!
//! `bytes → Examination → findings`. Like the pipeline, an examination has no clock and no port: a recorded capture and a live
//! board are examined alike.

mod clock;
mod examination;
mod finding;
mod line;
mod sensors;
mod wheels;

pub use examination::Examination;
pub use finding::{Finding, Level, Report, Summary};
pub use sensors::SensorStatistics;
