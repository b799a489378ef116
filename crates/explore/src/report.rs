//! What the explorer does, and what it says at the end.

use super::follow::Twist;
use slamd_core::Point;
use std::fmt;

/// What the robot shall do now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command {
    /// The velocity.
    pub twist: Twist,
    /// It follows from the estimated pose; otherwise from the newest echoes alone.
    pub uses_pose: bool,
    /// Why.
    pub status: Status,
}

/// What the explorer does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Status {
    /// No pose, or an uncertain one: it stands, then looks around slowly by its echoes alone.
    FindingPose,
    /// It waits for a map, or for something to go away.
    Waiting,
    /// It drives to where this frontier can be seen.
    Exploring(Point),
    /// It looks at this frontier.
    Looking(Point),
    /// Something is in the way: it drives back a little.
    BackingOff,
    /// Nothing leads home by the map: it drives by its echoes for a while.
    LeavingTrap,
    /// It returns to known walls before it goes on: the pose became uncertain on a long way.
    Revisiting,
    /// No frontier is left: it drives to where it started.
    GoingHome,
    /// It stands, for good.
    Done,
}

/// The end of an exploration.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    /// Free floor that the robot can reach, square metres.
    pub explored_m2: f64,
    /// Frontiers that it could not reach, map frame.
    pub unreachable: Vec<Point>,
    /// It stands where it started.
    pub is_home: bool,
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "explored {:.0} m2", self.explored_m2)?;
        match self.unreachable.len() {
            0 => {}
            1 => write!(f, ", one place not reachable:")?,
            2 => write!(f, ", two places not reachable:")?,
            count => write!(f, ", {count} places not reachable:")?,
        }
        for (index, place) in self.unreachable.iter().enumerate() {
            let comma = if index == 0 { "" } else { "," };
            write!(f, "{comma} ({:.1}, {:.1})", place.x, place.y)?;
        }
        if self.is_home { Ok(()) } else { write!(f, "; no way home was found") }
    }
}
