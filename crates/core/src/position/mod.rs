//! Position: EKF-SLAM over pose, wheels and wall offsets.

pub mod beam_model;
pub mod ekf_slam;
mod ekf_slam_state;
pub mod filter;
mod filter_state;
mod inactive_landmarks;
mod innovation_whiteness;
pub mod landmark_initializer;
pub mod localization_monitor;
pub mod params;
pub mod relocalize;
mod relocation;
mod segments;
mod symmetric;
