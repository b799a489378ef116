//! Which wheel is which, shown by a person who turns one of them by hand: walls cannot tell swapped wheels from sensors that are numbered the
//! other way round.

use slamd_core::{Sweep, Wheel};

/// Travel of a wheel within a sweep that is none, metres.
const STILL_M: f64 = 0.0015;
/// The robot stands this long before a wheel is turned, seconds.
const REST_S: f64 = 0.8;
/// A wheel that was turned by hand has rolled this far, metres, and the other no more than this part of it.
const TURNED_M: f64 = 0.08;
const MAX_OTHER: f64 = 0.15;
/// A wheel turns one way if this part of its travel goes there.
const ONE_WAY: f64 = 0.7;

/// Follows both wheels.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct OneWheel {
    /// Travel since the robot stood still, whichever way, metres: left and right.
    rolled_m: [f64; 2],
    /// The same, forward less backward, metres.
    forward_m: [f64; 2],
    rested_s: f64,
    has_rested: bool,
    last: Option<u64>,
}

impl OneWheel {
    /// Takes the newest sweep; one that was taken before changes nothing.
    pub(super) fn sweep(&mut self, sweep: &Sweep) {
        if self.last.replace(sweep.index) == Some(sweep.index) {
            return;
        }
        let step_m = [sweep.left_m, sweep.right_m];
        if step_m.iter().all(|m| m.abs() < STILL_M) {
            self.rested_s += sweep.elapsed_s;
            if self.rested_s > REST_S {
                (self.rolled_m, self.forward_m, self.has_rested) = ([0.0; 2], [0.0; 2], true);
            }
            return;
        }
        self.rested_s = 0.0;
        self.rolled_m.iter_mut().zip(step_m).for_each(|(sum, m)| *sum += m.abs());
        self.forward_m.iter_mut().zip(step_m).for_each(|(sum, m)| *sum += m);
    }

    /// The wheel that has turned alone, and whether it counted forward; none while it goes to and fro.
    pub(super) fn turned(&self) -> Option<(Wheel, bool)> {
        let ([left, right], [left_forward, right_forward]) = (self.rolled_m, self.forward_m);
        let is_alone = |one: f64, other: f64| self.has_rested && one > TURNED_M && other < MAX_OTHER * one;
        let (wheel, rolled_m, forward_m) = if is_alone(left, right) {
            (Wheel::Left, left, left_forward)
        } else if is_alone(right, left) {
            (Wheel::Right, right, right_forward)
        } else {
            return None;
        };
        (forward_m.abs() > ONE_WAY * rolled_m).then_some((wheel, forward_m > 0.0))
    }

    /// The farther of both wheels, metres.
    pub(super) fn counted_m(&self) -> f64 {
        if self.has_rested { self.rolled_m.iter().copied().fold(0.0, f64::max) } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(steps: &[(u32, f64, f64)]) -> Option<(Wheel, bool)> {
        let (mut wheels, mut index) = (OneWheel::default(), 0);
        for &(count, left_m, right_m) in steps {
            for _ in 0..count {
                index += 1;
                wheels.sweep(&Sweep { index, left_m, right_m, elapsed_s: 0.1, ..Sweep::default() });
            }
        }
        wheels.turned()
    }

    #[test]
    fn only_a_wheel_that_turns_alone_after_a_rest_counts() {
        assert_eq!(after(&[(20, 0.0, 0.0), (9, -0.01, 0.0)]), Some((Wheel::Left, false)));
        assert_eq!(after(&[(20, 0.0, 0.0), (9, 0.0, 0.01)]), Some((Wheel::Right, true)));
        assert_eq!(after(&[(20, 0.0, 0.0), (9, 0.01, 0.01)]), None, "it drives");
        assert_eq!(after(&[(9, 0.01, 0.0)]), None, "an arc of a drive");
        assert_eq!(after(&[(20, 0.0, 0.0), (3, 0.01, 0.0)]), None, "hardly");
        assert_eq!(after(&[(20, 0.0, 0.0), (9, 0.01, 0.0), (8, -0.01, 0.0)]), None, "to and fro");
    }
}
