//! Mapping: what the beams say about space.

pub mod cone;
pub mod grid;
pub mod params;
pub mod raster;
