//! The sweeps since the start, to begin again with another robot.

use crate::sweep::Sweep;

/// All sweeps of a drive so far, as long as they are few enough.
#[derive(Debug)]
pub(super) struct History {
    /// None once some are gone.
    sweeps: Option<Vec<Sweep>>,
    max_sweeps: usize,
}

impl History {
    pub(super) const fn new(max_sweeps: usize) -> Self {
        Self { sweeps: Some(Vec::new()), max_sweeps }
    }

    /// Adds a sweep; a standing robot adds nothing after the first ones. The history of a long drive is given up.
    pub(super) fn push(&mut self, sweep: &Sweep, standing_sweeps: usize) {
        let Some(sweeps) = &mut self.sweeps else { return };
        if sweep.left_m == 0.0 && sweep.right_m == 0.0 && sweeps.len() >= standing_sweeps {
            return;
        }
        if sweeps.len() == self.max_sweeps {
            self.sweeps = None;
        } else {
            sweeps.push(sweep.clone());
        }
    }

    /// All sweeps; none if some are gone.
    pub(super) fn whole(&self) -> Option<&[Sweep]> {
        self.sweeps.as_deref()
    }
}
