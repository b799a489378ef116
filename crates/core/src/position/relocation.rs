//! What the filter does when the robot may be lost.

use super::ekf_slam::{EkfSlam, WallLandmark};
use super::localization_monitor::LocalizationMonitor;
use super::relocalize::KnownWall;
use crate::geometry::Pose2;

impl EkfSlam {
    /// Whether readings and map agree.
    #[must_use]
    pub fn monitor(&self) -> &LocalizationMonitor {
        &self.monitor
    }

    /// Every well-known wall from before the sweep `until` or from a saved state.
    pub fn known_walls(&self, until: u64) -> impl Iterator<Item = KnownWall> {
        let well_known = self.params.slam.well_known_hits;
        let known = move |wall: &WallLandmark, offset_m| KnownWall {
            side: wall.side,
            offset_m,
            lo_m: wall.lo_m,
            hi_m: wall.hi_m,
        };
        self.every_wall()
            .filter(move |(wall, ..)| wall.hits >= well_known && !wall.is_since(until))
            .map(move |(wall, offset_m, _)| known(wall, offset_m))
    }

    /// Moves the robot to `pose` and removes the walls that were initialized from the sweep `since` on.
    pub fn relocate(&mut self, pose: Pose2, since: u64) {
        let params = &self.params.slam;
        self.return_to(pose, since, [params.relocalized_sigma_m, params.relocalized_sigma_rad]);
        self.agreement.reset();
    }

    /// The same, with the pose known to `sigmas`: metres and radians.
    pub(super) fn return_to(&mut self, pose: Pose2, since: u64, sigmas: [f64; 2]) {
        for wall in (0..self.walls.len()).rev() {
            if self.walls[wall].is_since(since) {
                self.walls.swap_remove(wall);
                self.filter.remove(wall);
            }
        }
        self.initializer.clear();
        self.associations.clear();
        self.filter.relocate(pose, sigmas[0], sigmas[1]);
    }

    /// Nothing of a sweep is used: the pose is the wheels'.
    pub fn ignore_sweep(&mut self) {
        self.associations.clear();
        self.agreement.reset();
    }

    /// Unlearns the walls that most readings since [`EkfSlam::reset_monitor`] contradict: the pose is right, so they are not there.
    pub fn unlearn_contradicted_walls(&mut self) {
        let limit = self.params.slam.unlearnt_readings;
        self.walls.iter_mut().filter(|wall| wall.against >= limit).for_each(|wall| wall.hits = 0);
    }

    /// Forgets the readings that contradicted the map, and what the walls did to the pose meanwhile.
    pub fn reset_monitor(&mut self) {
        self.walls.iter_mut().for_each(|wall| wall.against = 0);
        self.monitor.reset();
        self.agreement.reset();
    }
}

impl WallLandmark {
    /// True where this run initialized it in this sweep or later.
    fn is_since(&self, sweep: u64) -> bool {
        self.first_sweep.is_some_and(|first| first >= sweep)
    }
}
