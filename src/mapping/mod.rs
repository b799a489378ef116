//! Mapping: what the beams say about space.

pub mod raster;
