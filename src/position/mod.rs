//! Position: where the robot stands.

pub mod paper_ekf;
