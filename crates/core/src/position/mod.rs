//! Position: EKF-SLAM over pose, wheels and wall offsets.

pub(crate) mod beam_model;
pub(crate) mod ekf_slam;
mod ekf_slam_state;
pub(crate) mod filter;
mod filter_heading;
mod filter_state;
pub(crate) mod heading_update;
mod inactive_landmarks;
mod innovation_whiteness;
pub(crate) mod landmark_initializer;
pub(crate) mod localization_monitor;
pub(crate) mod params;
mod predicted_ranges;
mod range_noise;
pub(crate) mod relocalize;
mod relocation;
mod segments;
mod stated_errors;
mod symmetric;
mod wheel_agreement;
