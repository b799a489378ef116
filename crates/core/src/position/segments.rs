//! All walls as line segments.

use super::ekf_slam::{EkfSlam, WallLandmark};
use crate::geometry::Segment;

impl EkfSlam {
    /// Every wall, in the filter or out of it, with its offset (metres) and the offset's variance.
    pub(super) fn every_wall(&self) -> impl Iterator<Item = (&WallLandmark, f64, f64)> {
        let near = self.walls.iter().enumerate();
        let near = near.map(|(index, wall)| (wall, self.filter.offset_m(index), self.filter.wall_variance(index)));
        let far = self.inactive.iter().map(|inactive| (&inactive.wall, inactive.offset_m, inactive.variance));
        near.chain(far)
    }

    /// Every wall as far as it has been observed.
    pub fn segments(&self) -> impl Iterator<Item = Segment> {
        self.every_wall().map(|(wall, offset_m, variance)| Segment {
            from: wall.side.join(offset_m, wall.lo_m),
            to: wall.side.join(offset_m, wall.hi_m),
            sigma_m: variance.max(0.0).sqrt(),
        })
    }
}
