//! Fault detection: which sensors' readings and which wheel encoders' counts are worth nothing.

pub(crate) mod detector;
pub(crate) mod encoder;
pub(crate) mod evidence;
pub(crate) mod fault_test;
pub(crate) mod neighbours;
pub(crate) mod params;
pub(crate) mod pca;
mod profile;
