//! Orientation: the directions of a building's walls, and from them the robot's heading.

pub mod axis;
pub mod heading;
pub mod hough;
pub mod start;
