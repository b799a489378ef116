//! The tracker's walls as pieces of lines.

use super::tracker::{Tracker, Wall};
use crate::geometry::Segment;

impl Tracker {
    /// Every wall, in the filter's sight or out of it.
    pub fn segments(&self) -> impl Iterator<Item = Segment> {
        let near = self.walls.iter().enumerate();
        let near = near.map(|(index, wall)| (wall, self.filter.offset_m(index), self.filter.wall_variance(index)));
        let far = self.parked.iter().map(|parked| (&parked.wall, parked.offset_m, parked.variance));
        near.chain(far).map(|(wall, offset_m, variance): (&Wall, f64, f64)| Segment {
            from: wall.side.join(offset_m, wall.lo_m),
            to: wall.side.join(offset_m, wall.hi_m),
            sigma_m: variance.max(0.0).sqrt(),
        })
    }
}
