//! Orientation: where the robot looks, from the walls it sees.

pub mod heading;
pub mod hough;
