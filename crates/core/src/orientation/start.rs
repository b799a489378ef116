//! The robot's first heading in the building, from its first sweeps, estimated together with its wheels.
//!
//! The robot moves while the first sweeps gather, on wheels that are not calibrated yet: one percent between them turns it by two
//! degrees per metre. An axis found with wrong wheels is the axis of the middle of the drive, not of its start. So the search varies
//! the wheels, too. Right wheels put all returns of a wall onto one line, and the votes of the Hough transform
//! ([`super::dominant_directions`]) gather best. It is a maximum a posteriori estimate by pattern search (Hooke and Jeeves, Journal of
//! the ACM 8, 1961) over the deviations u of wheel ratio and wheel base, in standard deviations:
//!
//! `maximize log strength(u) − prior · (u_ratio² + u_base²) / 2`

use super::dominant_directions::{Axis, DominantDirections};
use super::params::StartParams;
use crate::event::Calibration;
use crate::geometry::{Placement, Pose2};
use crate::sweep::Sweep;

/// The deviations of a round, in units of its reach.
const AROUND: [(f64, f64); 8] =
    [(-1.0, -1.0), (-1.0, 0.0), (-1.0, 1.0), (0.0, -1.0), (0.0, 1.0), (1.0, -1.0), (1.0, 0.0), (1.0, 1.0)];
/// The wheels' deviation from the configuration in standard deviations: ratio and base.
type Deviation = [f64; 2];

/// A search under way. It runs in steps so that no sweep waits for all of it.
#[derive(Clone, Debug)]
pub(crate) struct Search {
    /// Sweeps in use, from the first.
    sweeps: usize,
    first: Axis,
    /// The centre of this round.
    centre: Deviation,
    best: Deviation,
    /// Log strength at the best, less the prior.
    best_score: f64,
    /// Deviations tried so far.
    tried: usize,
    params: StartParams,
}

/// The result of a step.
#[derive(Clone, Debug)]
pub(crate) enum Step {
    /// More deviations are left.
    Running(Search),
    /// The building's axis in the frame of the robot at the first sweep; none without returns.
    Done(Option<Axis>),
}

impl Search {
    /// Begins a search over all of `sweeps`; none without returns.
    pub(crate) fn begin(finder: &mut DominantDirections, sweeps: &[Sweep], wheels: &Calibration) -> Option<Self> {
        lay_out(finder, sweeps, wheels, [0.0; 2]);
        let first = finder.find()?;
        Some(Self {
            sweeps: sweeps.len(),
            first,
            centre: [0.0; 2],
            best: [0.0; 2],
            best_score: libm::log(first.strength),
            tried: 0,
            params: finder.params().start,
        })
    }

    /// Tries one more deviation. The sweeps are those that the search began with, and any later ones.
    pub(crate) fn step(mut self, finder: &mut DominantDirections, sweeps: &[Sweep], wheels: &Calibration) -> Step {
        let sweeps = &sweeps[..self.sweeps.min(sweeps.len())];
        let Some(reach) = self.params.rounds.get(self.tried / AROUND.len()) else {
            lay_out(finder, sweeps, wheels, self.best);
            let axis = finder.find();
            finder.clear();
            return Step::Done(axis);
        };
        let (i, j) = AROUND[self.tried % AROUND.len()];
        self.tried += 1;
        let deviation = [self.centre[0] + i * reach, self.centre[1] + j * reach];
        lay_out(finder, sweeps, wheels, deviation);
        let prior = 0.5 * (deviation[0] * deviation[0] + deviation[1] * deviation[1]);
        let log_strength = finder.find_near(self.first.angle_rad).map_or(f64::NEG_INFINITY, libm::log);
        if log_strength - self.params.prior * prior > self.best_score {
            (self.best, self.best_score) = (deviation, log_strength - self.params.prior * prior);
        }
        if self.tried.is_multiple_of(AROUND.len()) {
            self.centre = self.best;
        }
        Step::Running(self)
    }
}

/// Lays the returns out along the path that wheels with this deviation roll.
fn lay_out(finder: &mut DominantDirections, sweeps: &[Sweep], wheels: &Calibration, deviation: Deviation) {
    let ratio = deviation[0] * wheels.wheel_ratio_sigma;
    let base_m = wheels.wheel_base_m + deviation[1] * wheels.wheel_base_sigma_m;
    let returns: usize = sweeps.iter().map(|sweep| sweep.beams.len()).sum();
    let stride = returns.div_ceil(finder.params().start.max_returns).max(1);
    finder.clear();
    let mut pose = Pose2::default();
    for (index, sweep) in sweeps.iter().enumerate() {
        if index > 0 {
            let [left_m, right_m] = [sweep.left_m * (1.0 - 0.5 * ratio), sweep.right_m * (1.0 + 0.5 * ratio)];
            pose = pose.rolled(left_m, right_m, base_m);
        }
        if index.is_multiple_of(stride) {
            let pose = Placement::from(pose);
            sweep.beams.iter().for_each(|beam| finder.add(pose, beam));
        }
    }
}
