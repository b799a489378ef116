//! Position: the filters that follow the robot.

pub mod beam_model;
pub mod filter;
mod filter_memory;
pub mod nursery;
pub mod paper_ekf;
pub mod tracker;
mod tracker_memory;
