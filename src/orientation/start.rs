//! The robot's first heading in the building, from its first sweeps, together with its wheels.
//!
//! While the first sweeps gather, the robot moves, and it does so on wheels that nobody has measured yet: one percent between them turns
//! it by two degrees per metre. An axis found as if they were right is the axis of the middle of the drive, not of its start. So the
//! wheels are searched along with the axis: the right ones lay all returns of a wall onto one line, and the votes of the
//! Hough transform ([`super::axis`]) gather best.

use super::axis::{Axis, AxisFinder};
use crate::event::Calibration;
use crate::geometry::{Placement, Pose2};
use crate::sweep::Sweep;

/// Logarithm of the votes' strength that a deviation of one sigma must gain twice over.
const PRIOR: f64 = 0.02;
/// The search looks this many sigmas around the best so far: first far, then between.
const ROUNDS: [f64; 4] = [1.5, 1.0, 0.5, 0.25];
/// More returns than this are thinned by whole sweeps.
const MOST_RETURNS: usize = 1_600;

/// The wheels' deviation from the configuration in standard deviations: ratio and base.
type Deviation = [f64; 2];

/// The building's axis in the frame of the robot at the first of `sweeps`; none without returns.
pub fn find(finder: &mut AxisFinder, sweeps: &[Sweep], wheels: &Calibration) -> Option<Axis> {
    lay_out(finder, sweeps, wheels, [0.0; 2]);
    let first = finder.find()?;
    let (mut best, mut most) = ([0.0; 2], libm::log(first.strength));
    for reach in ROUNDS {
        let [ratio, base] = best;
        for (i, j) in [-1.0, 0.0, 1.0].into_iter().flat_map(|i| [-1.0, 0.0, 1.0].map(|j| (i, j))) {
            if (i, j) == (0.0, 0.0) {
                continue;
            }
            let deviation = [ratio + i * reach, base + j * reach];
            lay_out(finder, sweeps, wheels, deviation);
            let prior = 0.5 * (deviation[0] * deviation[0] + deviation[1] * deviation[1]);
            let worth = libm::log(finder.find_near(first.angle_rad)?) - PRIOR * prior;
            if worth > most {
                (best, most) = (deviation, worth);
            }
        }
    }
    lay_out(finder, sweeps, wheels, best);
    let axis = finder.find();
    finder.clear();
    axis
}

/// Lays the returns out along the path that wheels with this deviation roll.
fn lay_out(finder: &mut AxisFinder, sweeps: &[Sweep], wheels: &Calibration, deviation: Deviation) {
    let ratio = deviation[0] * wheels.wheel_ratio_sigma;
    let base_m = wheels.wheel_base_m + deviation[1] * wheels.wheel_base_sigma_m;
    let returns: usize = sweeps.iter().map(|sweep| sweep.beams.len()).sum();
    let stride = returns.div_ceil(MOST_RETURNS).max(1);
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
