//! Where the robot goes now.

use super::report::Status;
use slamd_core::{Point, Timestamp};

/// Why the robot goes there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Purpose {
    /// To see the frontier with this middle.
    Frontier(Point),
    /// To look at known walls.
    Revisit,
    /// To end where it started.
    Home,
}

/// Where the robot goes now.
#[derive(Clone, Debug)]
pub(crate) struct Goal {
    pub(crate) purpose: Purpose,
    /// Where it shall stand.
    pub(crate) stand: Point,
    /// When it is given up.
    pub(crate) until: Timestamp,
    /// The way there; empty before it was planned.
    pub(crate) way: Vec<Point>,
    /// How often something stood in the way.
    pub(crate) blocks: u32,
    /// Since when the robot faces the frontier from there.
    pub(crate) faced: Option<Timestamp>,
    /// It has arrived and looks.
    pub(crate) is_looking: bool,
}

impl Goal {
    pub(crate) fn new(purpose: Purpose, stand: Point, until: Timestamp) -> Self {
        Self { purpose, stand, until, way: Vec::new(), blocks: 0, faced: None, is_looking: false }
    }

    /// The frontier that it shall see.
    pub(crate) fn frontier(&self) -> Option<Point> {
        match self.purpose {
            Purpose::Frontier(middle) => Some(middle),
            Purpose::Revisit | Purpose::Home => None,
        }
    }

    pub(crate) fn status(&self) -> Status {
        match self.purpose {
            Purpose::Frontier(middle) if self.is_looking => Status::Looking(middle),
            Purpose::Frontier(middle) => Status::Exploring(middle),
            Purpose::Revisit => Status::Revisiting,
            Purpose::Home => Status::GoingHome,
        }
    }
}
