//! Mapping: what the beams say about space.

pub(crate) mod cone;
pub(crate) mod grid;
pub(crate) mod params;
pub(crate) mod raster;
