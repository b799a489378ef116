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

/// Follows both wheels.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct OneWheel {
    /// Travel since the robot stood still, whichever way, metres: left and right.
    rolled_m: [f64; 2],
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
        let step_m = [sweep.left_m.abs(), sweep.right_m.abs()];
        if step_m.iter().all(|m| *m < STILL_M) {
            self.rested_s += sweep.elapsed_s;
            if self.rested_s > REST_S {
                (self.rolled_m, self.has_rested) = ([0.0; 2], true);
            }
            return;
        }
        self.rested_s = 0.0;
        self.rolled_m.iter_mut().zip(step_m).for_each(|(sum, m)| *sum += m);
    }

    /// The wheel that has turned alone.
    pub(super) fn turned(&self) -> Option<Wheel> {
        let [left, right] = self.rolled_m;
        let is_alone = |one: f64, other: f64| self.has_rested && one > TURNED_M && other < MAX_OTHER * one;
        if is_alone(left, right) {
            Some(Wheel::Left)
        } else if is_alone(right, left) {
            Some(Wheel::Right)
        } else {
            None
        }
    }

    /// The farther of both wheels, metres.
    pub(super) fn counted_m(&self) -> f64 {
        if self.has_rested { self.rolled_m.iter().copied().fold(0.0, f64::max) } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(steps: &[(u32, f64, f64)]) -> Option<Wheel> {
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
        assert_eq!(after(&[(20, 0.0, 0.0), (9, -0.01, 0.0)]), Some(Wheel::Left));
        assert_eq!(after(&[(20, 0.0, 0.0), (9, 0.0, 0.01)]), Some(Wheel::Right));
        assert_eq!(after(&[(20, 0.0, 0.0), (9, 0.01, 0.01)]), None, "it drives");
        assert_eq!(after(&[(9, 0.01, 0.0)]), None, "an arc of a drive");
        assert_eq!(after(&[(20, 0.0, 0.0), (3, 0.01, 0.0)]), None, "hardly");
    }
}
