//! What a person may want to see of the estimator beside its results. Nothing here changes anything.

use super::{Pipeline, Waiting};
use crate::event::Verdict;
use crate::geometry::Segment;
use crate::mapping::grid::MapChange;

impl Pipeline {
    /// What became of a sensor's beam in the last sweep.
    #[must_use]
    pub fn verdict(&self, sensor: usize) -> Verdict {
        self.estimator.as_ref().map_or(Verdict::Silent, |estimator| estimator.verdict(sensor))
    }

    /// The evidence that a sensor is faulty, declared from 6 on, and the root of what PCA leaves unexplained of its readings, metres.
    /// NaN where the method has no such thing.
    #[must_use]
    pub fn fault_evidence(&self, sensor: usize) -> (f64, f64) {
        self.estimator.as_ref().map_or((f64::NAN, f64::NAN), |estimator| estimator.fault_evidence(sensor))
    }

    /// What the method waits for while there is no pose; none once there is one, before the ring is known, or where the method does not say.
    #[must_use]
    pub fn waiting(&self) -> Option<Waiting> {
        self.estimator.as_ref()?.waiting()
    }

    /// The walls that are known, or the lines of the paper's last Hough transform; map frame.
    #[must_use]
    pub fn segments(&self) -> Vec<Segment> {
        self.estimator.as_ref().map(|estimator| estimator.segments()).unwrap_or_default()
    }

    /// What has changed of the map in `revision` or later, and the revision to ask for the next time; none where nothing has.
    /// Revision 0 asks for everything.
    #[must_use]
    pub fn map_since(&self, revision: u64) -> Option<(MapChange, u64)> {
        let (change, newest) = self.estimator.as_ref()?.map_since(revision)?;
        let is_empty = matches!(&change, MapChange::Patches(_, patches) if patches.is_empty());
        (!is_empty).then_some((change, newest + 1))
    }
}
