//! What a person may want to see of the estimator beside its results. Nothing here changes anything.

use super::Pipeline;
use super::estimator::Estimator;
use crate::event::Verdict;
use crate::geometry::Segment;
use crate::mapping::grid::MapChange;

impl Pipeline {
    /// What became of a sensor's beam in the last sweep.
    #[must_use]
    pub fn verdict(&self, sensor: usize) -> Verdict {
        match &self.estimator {
            Some(Estimator::Walls(walls)) => walls.verdict(sensor),
            Some(Estimator::Localizer(localizer)) => localizer.walls().verdict(sensor),
            Some(Estimator::Paper(paper)) => paper.verdict(sensor),
            None => Verdict::Silent,
        }
    }

    /// The evidence that a sensor is broken, proven from 6 on, and the root of what PCA leaves unexplained of its readings, metres.
    /// NaN where the method has no such thing.
    #[must_use]
    pub fn suspicion(&self, sensor: usize) -> (f64, f64) {
        match &self.estimator {
            Some(Estimator::Walls(walls)) => walls.suspicion(sensor),
            Some(Estimator::Localizer(localizer)) => localizer.walls().suspicion(sensor),
            Some(Estimator::Paper(paper)) => paper.suspicion(sensor),
            None => (f64::NAN, f64::NAN),
        }
    }

    /// The walls that are known, or the lines of the paper's last Hough transform; map frame.
    #[must_use]
    pub fn segments(&self) -> Vec<Segment> {
        match &self.estimator {
            Some(Estimator::Walls(walls)) => walls.segments(),
            Some(Estimator::Localizer(localizer)) if localizer.is_found() => localizer.walls().segments(),
            Some(Estimator::Paper(paper)) => paper.segments(),
            Some(Estimator::Localizer(_)) | None => Vec::new(),
        }
    }

    /// What has changed of the map in `revision` or later, and the revision to ask for the next time; none where nothing has.
    /// Revision 0 asks for everything.
    #[must_use]
    pub fn map_since(&self, revision: u64) -> Option<(MapChange, u64)> {
        let (change, newest) = match self.estimator.as_ref()? {
            Estimator::Walls(walls) => {
                let grid = walls.grid();
                (MapChange::Patches(grid.cell_m(), grid.patches_since(revision)), grid.revision())
            }
            // A known map does not change.
            Estimator::Localizer(_) if revision > 0 => return None,
            Estimator::Localizer(localizer) => (MapChange::Whole(localizer.raster()), 0),
            Estimator::Paper(paper) if paper.revision() < revision => return None,
            Estimator::Paper(paper) => (MapChange::Whole(paper.raster()), paper.revision()),
        };
        let is_empty = matches!(&change, MapChange::Patches(_, patches) if patches.is_empty());
        (!is_empty).then_some((change, newest + 1))
    }
}
