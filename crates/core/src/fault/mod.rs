//! Fault detection: which sensors' readings and which wheel encoders' counts are worth nothing.

pub mod detector;
pub mod encoder;
pub mod evidence;
pub mod fault_test;
pub mod neighbours;
pub mod params;
pub mod pca;
mod profile;
