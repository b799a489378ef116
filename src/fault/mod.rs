//! Fault detection: which sensors' readings are worth nothing.

pub mod detector;
pub mod evidence;
pub mod neighbours;
pub mod paper_detector;
pub mod pca;
pub mod suspicion;
