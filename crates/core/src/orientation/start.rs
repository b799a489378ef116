//! The robot's first heading in the building, from its first sweeps, together with its wheels.
//!
//! While the first sweeps gather, the robot moves, and it does so on wheels that nobody has measured yet: one percent between them turns
//! it by two degrees per metre. An axis found as if they were right is the axis of the middle of the drive, not of its start. So the
//! wheels are searched along with the axis: the right ones lay all returns of a wall onto one line, and the votes of the
//! Hough transform ([`super::dominant_directions`]) gather best.

use super::dominant_directions::{Axis, DominantDirections};
use crate::event::Calibration;
use crate::geometry::{Placement, Pose2};
use crate::sweep::Sweep;

/// Logarithm of the votes' strength that a deviation of one sigma must gain twice over.
const PRIOR: f64 = 0.02;
/// The search looks this many sigmas around the best so far: first far, then between.
const ROUNDS: [f64; 4] = [1.5, 1.0, 0.5, 0.25];
/// The deviations of a round, in units of its reach.
const AROUND: [(f64, f64); 8] =
    [(-1.0, -1.0), (-1.0, 0.0), (-1.0, 1.0), (0.0, -1.0), (0.0, 1.0), (1.0, -1.0), (1.0, 0.0), (1.0, 1.0)];
/// More returns than this are thinned by whole sweeps.
const MAX_RETURNS: usize = 1_600;

/// The wheels' deviation from the configuration in standard deviations: ratio and base.
type Deviation = [f64; 2];

/// A search under way. It is done in steps, for a sweep must not wait for all of it.
#[derive(Clone, Debug)]
pub struct Search {
    /// How many of the sweeps are looked at.
    sweeps: usize,
    first: Axis,
    /// What this round looks around.
    centre: Deviation,
    best: Deviation,
    /// Logarithm of the votes' strength for the best, less the prior.
    most: f64,
    /// Deviations tried so far.
    tried: usize,
}

/// What a step has brought.
#[derive(Clone, Debug)]
pub enum Step {
    /// There is more to be tried.
    Running(Search),
    /// The building's axis in the frame of the robot at the first sweep; none without returns.
    Done(Option<Axis>),
}

impl Search {
    /// Begins a search over all of `sweeps`; none without returns.
    pub fn begin(finder: &mut DominantDirections, sweeps: &[Sweep], wheels: &Calibration) -> Option<Self> {
        lay_out(finder, sweeps, wheels, [0.0; 2]);
        let first = finder.find()?;
        Some(Self {
            sweeps: sweeps.len(),
            first,
            centre: [0.0; 2],
            best: [0.0; 2],
            most: libm::log(first.strength),
            tried: 0,
        })
    }

    /// Tries one more deviation. The sweeps are those that the search began with, and any later ones.
    pub fn step(mut self, finder: &mut DominantDirections, sweeps: &[Sweep], wheels: &Calibration) -> Step {
        let sweeps = &sweeps[..self.sweeps.min(sweeps.len())];
        let Some(reach) = ROUNDS.get(self.tried / AROUND.len()) else {
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
        let strength = finder.find_near(self.first.angle_rad).map_or(f64::NEG_INFINITY, libm::log);
        if strength - PRIOR * prior > self.most {
            (self.best, self.most) = (deviation, strength - PRIOR * prior);
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
    let stride = returns.div_ceil(MAX_RETURNS).max(1);
    finder.clear();
    let mut pose = Pose2::default();
    for (place, sweep) in sweeps.iter().enumerate() {
        if place > 0 {
            let [left_m, right_m] = [sweep.left_m * (1.0 - 0.5 * ratio), sweep.right_m * (1.0 + 0.5 * ratio)];
            pose = pose.rolled(left_m, right_m, base_m);
        }
        if place.is_multiple_of(stride) {
            let place = Placement::from(pose);
            sweep.beams.iter().for_each(|beam| finder.add(place, beam));
        }
    }
}
