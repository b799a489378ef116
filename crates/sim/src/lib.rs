//! The simulator: a true world, a robot with a ring of sensors, its board and the serial line. One
//! seed determines every random number.
//!
//! It shares geometry, time and the wire format with the estimator, but none of its models. Results
//! would otherwise be too good: the estimator's errors would also be in the simulated data.

pub mod board;
pub mod built_in;
pub mod encoder;
pub mod explore;
pub mod fault;
pub mod floor_plan;
pub mod home;
pub mod link;
pub mod misfit;
pub mod motors;
pub mod random;
pub mod robot;
pub mod robot_fault;
pub mod route;
pub mod simulation;
pub mod sonar;
pub mod world;
pub mod world_file;
