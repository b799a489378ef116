//! What a person may want to see of the walls method beside its results.

use super::WallSlam;
use crate::event::Verdict;
use crate::geometry::Segment;
use crate::mapping::grid::OccupancyGrid;
use crate::position::ekf_slam::Association;

impl WallSlam {
    /// What became of a sensor's beam in the last sweep.
    #[must_use]
    pub fn verdict(&self, sensor: usize) -> Verdict {
        match self.associations().get(sensor) {
            _ if !self.detector.is_trusted(sensor) => Verdict::Ignored,
            Some(Association::Wall(_)) => Verdict::Used,
            Some(Association::Unexplained) => Verdict::Unexplained,
            Some(Association::Unused) | None => Verdict::Silent,
        }
    }

    /// The evidence that a sensor is broken, as [`crate::fault::detector::Detector::score`], and the root of what PCA leaves
    /// unexplained of its readings, metres.
    #[must_use]
    pub fn suspicion(&self, sensor: usize) -> (f64, f64) {
        (self.detector.score(sensor), self.detector.residual_m(sensor))
    }

    /// Every wall known, in the map frame.
    #[must_use]
    pub fn segments(&self) -> Vec<Segment> {
        self.tracker.as_ref().map(|tracker| tracker.segments().collect()).unwrap_or_default()
    }

    /// The map's cells.
    #[must_use]
    pub fn grid(&self) -> &OccupancyGrid {
        &self.grid
    }
}
