//! The poses of the last seconds, to go back to when an encoder turns out to have been faulty.

use super::params::Params;
use crate::geometry::Pose2;
use crate::sweep::Sweep;
use crate::time::Timestamp;
use std::collections::VecDeque;

/// The last poses.
#[derive(Debug)]
pub(super) struct PoseHistory {
    steps: VecDeque<Step>,
    max_sweeps: usize,
}

/// One sweep's pose, and the motion that the encoders reported for it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Step {
    pub(super) sweep: u64,
    pub(super) at: Timestamp,
    pub(super) pose: Pose2,
    rolled_m: [f64; 2],
}

impl PoseHistory {
    pub(super) fn new(params: &Params) -> Self {
        let max_sweeps = params.history_sweeps;
        Self { steps: VecDeque::with_capacity(max_sweeps), max_sweeps }
    }

    pub(super) fn push(&mut self, sweep: &Sweep, pose: Pose2) {
        if self.steps.len() == self.max_sweeps {
            self.steps.pop_front();
        }
        let rolled_m = [sweep.left_m, sweep.right_m];
        self.steps.push_back(Step { sweep: sweep.index, at: sweep.at, pose, rolled_m });
    }

    pub(super) fn clear(&mut self) {
        self.steps.clear();
    }

    /// The last step up to a sweep, or the oldest one, and the motion reported after it.
    pub(super) fn since(&self, sweep: u64) -> Option<(Step, Vec<[f64; 2]>)> {
        let index = self.steps.partition_point(|step| step.sweep <= sweep).saturating_sub(1);
        let rolled = self.steps.iter().skip(index + 1).map(|step| step.rolled_m).collect();
        Some((*self.steps.get(index)?, rolled))
    }

    /// The last step before a wheel's sign flipped, at `sweep` or later, and the true motion after it.
    ///
    /// The flip is where the reported speed jumps most: no real wheel changes its speed that fast. Without such a jump the wheel
    /// flipped while it stood still.
    pub(super) fn before_reversal(&self, sweep: u64, wheel: usize, params: &Params) -> Option<(Step, Vec<[f64; 2]>)> {
        let first = self.steps.partition_point(|step| step.sweep <= sweep).max(1);
        let reported = |index: usize| self.steps.get(index).map_or(f64::NAN, |step| step.rolled_m[wheel]);
        let jump_m = |index: &usize| (reported(index + 1) - reported(index - 1)).abs();
        let candidates = first..self.steps.len().saturating_sub(1);
        let jump = candidates
            .clone()
            .max_by(|a, b| jump_m(a).total_cmp(&jump_m(b)))
            .filter(|index| jump_m(index) > params.sign_flip_jump_m);
        let standstill = || candidates.clone().min_by(|a, b| reported(*a).abs().total_cmp(&reported(*b).abs()));
        let flip = jump.or_else(standstill).unwrap_or(first);
        let mut rolled: Vec<[f64; 2]> = self.steps.iter().skip(flip).map(|step| step.rolled_m).collect();
        rolled.iter_mut().for_each(|rolled_m| rolled_m[wheel] = -rolled_m[wheel]);
        // The wheel flipped within this sweep, so its count is a mixture: the one before is the better guess.
        if let Some(mixed) = rolled.first_mut() {
            mixed[wheel] = reported(flip - 1);
        }
        Some((*self.steps.get(flip - 1)?, rolled))
    }
}
