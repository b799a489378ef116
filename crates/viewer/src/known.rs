//! The state that a sink keeps: enough to show everything to a viewer that joins late or reconnects.

use super::chart::Chart;
use super::snapshot::Snapshot;
use super::trail::Trail;
use slamd_core::{Pose2, RateMeter, Rates, Ring, Segment, SensorState, Timestamp, wrap_angle};
use slamd_metrics::AccuracyMeter;
use std::sync::Arc;

/// Everything that the next sweep does not replace.
#[derive(Debug, Default)]
pub(super) struct Known {
    /// The map.
    pub(super) chart: Chart,
    /// The paths: truth, odometry, estimate; map frame.
    pub(super) trails: [Trail; 3],
    /// The ring.
    pub(super) ring: Arc<Ring>,
    /// Each sensor's state, and whether it was ever faulty.
    pub(super) sensors: Vec<(SensorState, bool)>,
    /// True while the pose is lost; `None` before the first estimate.
    pub(super) is_lost: Option<bool>,
    /// The walls.
    pub(super) segments: Option<Arc<[Segment]>>,
    /// Unwrapped headings, radians: the estimate's and odometry's.
    pub(super) headings_rad: [f64; 2],
    /// Recent rates per second.
    pub(super) rates: Rates,
    /// The newest sweep.
    pub(super) newest: Option<Arc<Snapshot>>,
    meter: RateMeter,
    accuracy: AccuracyMeter,
    map_from_odom: Option<Pose2>,
    /// True poses before the first estimate, world frame.
    early: Vec<Pose2>,
}

/// Maximum number of true poses kept before the first estimate, which comes after seconds of driving.
const MAX_EARLY: usize = 2_000;

impl Known {
    /// Adds a sweep. The odometry's path begins at the first estimate and drifts from there.
    pub(super) fn take(&mut self, snapshot: &Arc<Snapshot>) {
        if let Some(estimate) = &snapshot.estimate {
            let map_from_odom = *self.map_from_odom.get_or_insert_with(|| estimate.pose * estimate.odometry.inverse());
            let odometry = map_from_odom * estimate.odometry;
            self.trails[1].push(odometry.position());
            self.trails[2].push(estimate.pose.position());
            for (heading_rad, pose) in self.headings_rad.iter_mut().zip([estimate.pose, odometry]) {
                *heading_rad += wrap_angle(pose.theta_rad - *heading_rad);
            }
            self.accuracy.estimate(estimate.at, estimate.pose);
            self.is_lost = Some(snapshot.is_lost);
            self.add_early();
        }
        if !snapshot.beams.is_empty() {
            self.rates = self.meter.rates(snapshot.at, snapshot.counters);
            self.newest = Some(Arc::clone(snapshot));
        }
        if let Some(segments) = &snapshot.segments {
            self.segments = Some(Arc::clone(segments));
        }
    }

    /// Adds a true pose, world frame. World and map are aligned at the first estimate, as for the
    /// accuracy figures.
    pub(super) fn truth(&mut self, at: Timestamp, pose: Pose2) {
        self.accuracy.truth(at, pose);
        if self.early.len() < MAX_EARLY {
            self.early.push(pose);
        }
        self.add_early();
    }

    fn add_early(&mut self) {
        if let Some(world_from_map) = self.accuracy.world_from_map() {
            let map_from_world = world_from_map.inverse();
            for pose in self.early.drain(..) {
                self.trails[0].push(map_from_world.transform(pose.position()));
            }
        }
    }
}
