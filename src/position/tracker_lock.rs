//! What becomes of a tracker that has lost its place.

use super::lock::LockWatch;
use super::relock::KnownWall;
use super::tracker::{Tracker, WELL_KNOWN, Wall};
use crate::geometry::Pose2;

/// What a place found anew is worth.
const RELOCK_SIGMA_M: f64 = 0.05;
const RELOCK_SIGMA_RAD: f64 = 2.0 * std::f64::consts::PI / 180.0;

impl Tracker {
    /// Whether what is heard agrees with the walls.
    #[must_use]
    pub fn watch(&self) -> &LockWatch {
        &self.watch
    }

    /// Every well-known wall.
    #[must_use]
    pub fn known_walls(&self) -> Vec<KnownWall> {
        let known = |wall: &Wall, offset_m| KnownWall { side: wall.side, offset_m, lo_m: wall.lo_m, hi_m: wall.hi_m };
        let active = self.walls.iter().enumerate().map(|(index, wall)| (wall, self.filter.offset_m(index)));
        let all = active.chain(self.parked.iter().map(|parked| (&parked.wall, parked.offset_m)));
        all.filter(|(wall, _)| wall.hits >= WELL_KNOWN).map(|(wall, offset_m)| known(wall, offset_m)).collect()
    }

    /// The lock is lost: what was learnt from the sweep `since` on is void, and the pose is uncertain.
    pub fn lose(&mut self, since: u64) {
        for wall in (0..self.walls.len())
            .rev()
            .filter(|&wall| self.walls[wall].first_sweep.is_some_and(|first| first >= since))
            .collect::<Vec<_>>()
        {
            self.walls.swap_remove(wall);
            self.filter.remove(wall);
        }
        self.nursery.clear();
        self.uses.clear();
        self.watch = LockWatch::default();
        self.nis = f64::NAN;
        self.filter.inflate(0.5, 0.5);
    }

    /// The place is known again.
    pub fn relocate(&mut self, pose: Pose2) {
        self.filter.relocate(pose, RELOCK_SIGMA_M, RELOCK_SIGMA_RAD);
    }

    /// No wall is known any more.
    pub fn forget_walls(&mut self) {
        self.filter.forget_walls();
        self.walls.clear();
        self.parked.clear();
    }
}
