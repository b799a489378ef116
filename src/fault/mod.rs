//! Fault detection: which sensors' readings are worth using.

pub mod paper_detector;
pub mod pca;
