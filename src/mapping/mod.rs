//! Mapping: what the beams say about space.

pub mod binary_grid;
pub mod cone;
pub mod grid;
pub mod raster;
