//! The readings of the last metres, at the poses that the wheels alone give.

use super::params::Params;
use crate::geometry::Pose2;
use crate::sweep::{Beam, Sweep};
use std::collections::VecDeque;

/// The last metres.
#[derive(Clone, Debug)]
pub(in crate::wall_slam) struct Trail {
    steps: VecDeque<Step>,
    pose: Pose2,
    way_m: f64,
    capacity: usize,
    params: Params,
}

/// The readings of one sweep.
#[derive(Clone, Debug, Default)]
pub(super) struct Step {
    pub(super) sweep: u64,
    /// `trail_from_robot`.
    pub(super) pose: Pose2,
    /// The way up to here, metres; turns count, too.
    pub(super) way_m: f64,
    pub(super) beams: Vec<Beam>,
}

impl Trail {
    pub(in crate::wall_slam) fn new(params: &Params) -> Self {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "some dozens")]
        let capacity = (params.search.trail_m / params.search.spacing_m).max(2.0) as usize;
        Self { steps: VecDeque::with_capacity(capacity), pose: Pose2::default(), way_m: 0.0, capacity, params: *params }
    }

    /// Forgets the readings: the way to the next ones is unknown.
    pub(in crate::wall_slam) fn clear(&mut self) {
        self.steps.clear();
    }

    /// Adds a sweep after the robot moved by `step`, as its wheels say. Returns the way of it, metres.
    pub(in crate::wall_slam) fn add(&mut self, sweep: &Sweep, step: Pose2, is_trusted: impl Fn(usize) -> bool) -> f64 {
        let way_m = step.position().coords.norm() + self.params.turn_m_per_rad * step.theta_rad.abs();
        self.pose = self.pose * step;
        self.way_m += way_m;
        let newest_m = self.steps.back().map_or(f64::NEG_INFINITY, |newest| newest.way_m);
        if self.way_m - newest_m >= self.params.search.spacing_m {
            let oldest = if self.steps.len() == self.capacity { self.steps.pop_front() } else { None };
            let mut kept = oldest.unwrap_or_default();
            kept.beams.clear();
            let beams = sweep.beams.iter().enumerate().filter(|(sensor, _)| is_trusted(*sensor));
            kept.beams.extend(beams.map(|(_, beam)| *beam).filter(|beam| beam.has_range() || beam.is_clear()));
            (kept.sweep, kept.pose, kept.way_m) = (sweep.index, self.pose, self.way_m);
            self.steps.push_back(kept);
        }
        way_m
    }

    /// The robot's pose in the trail's frame.
    pub(in crate::wall_slam) const fn pose(&self) -> Pose2 {
        self.pose
    }

    /// The way so far, metres.
    pub(in crate::wall_slam) const fn way_m(&self) -> f64 {
        self.way_m
    }

    /// The steps after a sweep that lie within the trail's length, oldest first.
    pub(super) fn since(&self, sweep: u64) -> impl Iterator<Item = &Step> + Clone {
        let from_m = self.way_m - self.params.search.trail_m;
        self.steps.iter().filter(move |step| step.sweep > sweep && step.way_m >= from_m)
    }
}
