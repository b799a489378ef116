//! Finds a robot after an encoder fault: its returns are collected along the wheels' path until they fit the known walls at one pose.
//!
//! The filter goes on meanwhile. It is moved only if another pose explains the returns distinctly better.

use super::odometry_outage::unknown_within;
use super::params::Params;
use crate::geometry::Pose2;
use crate::orientation::dominant_directions::{Axis, DominantDirections};
use crate::position;
use crate::position::relocalize::{self, KnownWall};
use crate::sweep::{Beam, Sweep};
use crate::time::Timestamp;
use nalgebra::Matrix3;

/// The returns since the pose came into doubt.
#[derive(Debug)]
pub(super) struct Relocalizer {
    /// Start of the uncertain poses.
    pub(super) since: Timestamp,
    /// Its first sweep: walls learnt from it on may be wrong.
    pub(super) since_sweep: u64,
    map_from_odom: Pose2,
    returns: Vec<(Pose2, Beam)>,
    sweeps: u32,
    cause: Cause,
}

/// Why the pose is in doubt.
#[derive(Clone, Copy, Debug)]
enum Cause {
    /// An encoder was reversed.
    Reversal,
    /// An encoder was dead while the robot moved up to `travel_m`.
    Outage { travel_m: f64 },
}

impl Relocalizer {
    /// Begins with the robot at `pose`, as far as is known, after the motion since an encoder's reversal was computed anew.
    pub(super) fn new(since: Timestamp, since_sweep: u64, pose: Pose2, odometry: Pose2, params: &Params) -> Self {
        let map_from_odom = pose * odometry.inverse();
        let returns = Vec::with_capacity(params.relocalize_max_returns);
        Self { since, since_sweep, map_from_odom, returns, sweeps: 0, cause: Cause::Reversal }
    }

    /// After an outage of the odometry in which the robot moved up to `travel_m`.
    pub(super) fn after_outage(self, travel_m: f64) -> Self {
        Self { cause: Cause::Outage { travel_m }, ..self }
    }

    /// True if the pose is only a guess around which the robot may have moved far.
    pub(super) fn is_after_outage(&self) -> bool {
        matches!(self.cause, Cause::Outage { .. })
    }

    /// The pose's covariance, if the filter's does not hold.
    pub(super) fn covariance(&self, params: &Params) -> Option<Matrix3<f64>> {
        match self.cause {
            Cause::Outage { travel_m } => Some(unknown_within(travel_m, params)),
            Cause::Reversal => None,
        }
    }

    /// Collects the returns of the trusted sensors, at the pose that the wheels alone give.
    pub(super) fn add(&mut self, sweep: &Sweep, is_trusted: impl Fn(usize) -> bool, params: &Params) {
        self.sweeps += 1;
        let pose = self.map_from_odom * sweep.odometry;
        let excess = (self.returns.len() + sweep.beams.len()).saturating_sub(params.relocalize_max_returns);
        self.returns.drain(..excess.min(self.returns.len()));
        let returns = sweep.beams.iter().enumerate().filter(|(sensor, beam)| is_trusted(*sensor) && beam.has_range());
        self.returns.extend(returns.map(|(_, beam)| (pose, *beam)));
    }

    /// The pose at the sweep with this odometry, once it is found.
    pub(super) fn find(
        &self,
        odometry: Pose2,
        finder: &mut DominantDirections,
        position: &position::params::Params,
        walls: impl Iterator<Item = KnownWall>,
        params: &Params,
    ) -> Option<Pose2> {
        if self.sweeps < params.relocalize_first_sweeps || !self.sweeps.is_multiple_of(params.relocalize_every_sweeps) {
            return None;
        }
        finder.clear();
        self.returns.iter().for_each(|(pose, beam)| finder.add(*pose, beam));
        let axis = finder.find().filter(Axis::is_believed);
        finder.clear();
        let found = relocalize::find(position, &self.returns, walls, axis?.angle_rad)?;
        Some(found.correction * self.map_from_odom * odometry)
    }
}
