//! Mapping: what the beams say about space.

pub mod binary_grid;
pub mod raster;
