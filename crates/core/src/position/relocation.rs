//! What a tracker does when its place is in doubt.

use super::ekf_slam::{EkfSlam, WELL_KNOWN, WallLandmark};
use super::localization_monitor::LocalizationMonitor;
use super::relocalize::KnownWall;
use crate::geometry::Pose2;

/// What a place found anew is worth.
const RELOCALIZED_SIGMA_M: f64 = 0.05;
const RELOCALIZED_SIGMA_RAD: f64 = 2.0 * std::f64::consts::PI / 180.0;

impl EkfSlam {
    /// Whether what is heard agrees with the walls.
    #[must_use]
    pub fn monitor(&self) -> &LocalizationMonitor {
        &self.monitor
    }

    /// Every well-known wall that was learnt before the sweep `until`, or by an earlier run.
    pub fn known_walls(&self, until: u64) -> impl Iterator<Item = KnownWall> {
        let known = move |wall: &WallLandmark, offset_m| KnownWall {
            side: wall.side,
            offset_m,
            lo_m: wall.lo_m,
            hi_m: wall.hi_m,
        };
        self.every_wall()
            .filter(move |(wall, ..)| wall.hits >= WELL_KNOWN && !wall.is_since(until))
            .map(move |(wall, offset_m, _)| known(wall, offset_m))
    }

    /// The robot is elsewhere: what was learnt from the sweep `since` on is void.
    pub fn relocate(&mut self, pose: Pose2, since: u64) {
        for wall in (0..self.walls.len()).rev() {
            if self.walls[wall].is_since(since) {
                self.walls.swap_remove(wall);
                self.filter.remove(wall);
            }
        }
        self.initializer.clear();
        self.associations.clear();
        self.filter.relocate(pose, RELOCALIZED_SIGMA_M, RELOCALIZED_SIGMA_RAD);
    }

    /// Forgets what contradicted the map.
    pub fn reset_monitor(&mut self) {
        self.monitor = LocalizationMonitor::default();
    }
}

impl WallLandmark {
    /// True where this run has learnt it from this sweep on.
    fn is_since(&self, sweep: u64) -> bool {
        self.first_sweep.is_some_and(|first| first >= sweep)
    }
}
