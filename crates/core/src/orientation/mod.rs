//! Orientation: the directions of a building's walls, and from them the robot's heading.

pub mod dominant_directions;
pub mod params;
pub mod start;
