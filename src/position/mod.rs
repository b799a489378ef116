//! Position: the filters that follow the robot.

pub mod beam_model;
pub mod filter;
pub mod lock;
pub mod nursery;
pub mod paper_ekf;
pub mod relock;
pub mod tracker;
