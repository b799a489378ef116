//! The sweeps since the start, to begin again with another robot.

use crate::sweep::Sweep;

/// All sweeps of a drive so far, as long as they are few enough.
#[derive(Debug)]
pub(super) struct History {
    sweeps: Vec<Sweep>,
    max_sweeps: usize,
    is_whole: bool,
}

impl History {
    pub(super) const fn new(max_sweeps: usize) -> Self {
        Self { sweeps: Vec::new(), max_sweeps, is_whole: true }
    }

    /// Adds a sweep; a standing robot adds nothing after the first ones. The history of a long drive is given up.
    pub(super) fn push(&mut self, sweep: &Sweep, standing_sweeps: usize) {
        if !self.is_whole || (sweep.left_m == 0.0 && sweep.right_m == 0.0 && self.sweeps.len() >= standing_sweeps) {
            return;
        }
        if self.sweeps.len() == self.max_sweeps {
            self.give_up();
        } else {
            self.sweeps.push(sweep.clone());
        }
    }

    /// Frees the sweeps: they cannot be used.
    pub(super) fn give_up(&mut self) {
        self.is_whole = false;
        self.sweeps = Vec::new();
    }

    /// All sweeps; none if some are gone.
    pub(super) fn whole(&self) -> Option<&[Sweep]> {
        self.is_whole.then_some(&self.sweeps)
    }
}
