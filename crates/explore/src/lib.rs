//! Where a robot drives that explores its own map.
//!
//! `pose, echoes, map → frontiers → goal → way → velocity`
//!
//! A state machine: it opens no port and reads no clock, and the same observations give the same commands. It drives by the estimate
//! alone. [`Explorer::command`] is the strategy; [`Params`] has its constants.

#![forbid(unsafe_code)]
#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing, clippy::string_slice)]
#![deny(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)]
#![deny(clippy::allow_attributes, clippy::allow_attributes_without_reason)]

mod choice;
mod costmap;
mod explorer;
mod follow;
mod frontier;
mod goal;
mod memory;
mod params;
mod plan;
mod reaction;
mod report;

pub use explorer::{Explorer, Observation, echo};
pub use follow::Twist;
pub use params::Params;
pub use report::{Command, Report, Status};

#[cfg(test)]
mod tests;
