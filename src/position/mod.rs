//! Position: one filter over the robot's pose, its wheels and the walls it has seen.

pub mod beam_model;
pub mod filter;
pub mod nursery;
pub mod tracker;
