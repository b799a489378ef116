//! Position: the filters that follow the robot.

pub mod beam_model;
pub mod filter;
pub mod nursery;
pub mod paper_ekf;
pub mod tracker;
