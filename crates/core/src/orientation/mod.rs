//! Orientation: the directions of a building's walls, and from them the robot's heading.

pub(crate) mod axis_tracker;
pub(crate) mod dominant_directions;
pub(crate) mod params;
pub(crate) mod start;
