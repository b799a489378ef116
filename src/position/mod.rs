//! Position: the filters that follow the robot.

pub mod beam_model;
pub mod filter;
mod filter_memory;
mod insistence;
pub mod lock;
pub mod nursery;
pub mod paper_ekf;
mod parking;
pub mod relock;
mod segments;
mod symmetric;
pub mod tracker;
mod tracker_lock;
mod tracker_memory;
