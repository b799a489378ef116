//! Is the heading still the building's?
//!
//! Wheels that spin in place turn the pose by tens of degrees at once, farther than the axis near the heading is sought, and a sparse ring
//! then finds walls for the wrong heading. But the returns of the next window of the way still have an axis of their own
//! ([`crate::orientation::axis_tracker`]). Where two windows after one another agree on an axis that is not the map's, the heading was
//! wrong since the last window that agreed with the map's, and the robot is lost.

use super::params::Params;
use crate::sweep::Sweep;
use crate::time::Timestamp;
use std::f64::consts::FRAC_PI_2;

/// Compares the axes of windows of the way with the map's.
#[derive(Debug, Default)]
pub(super) struct AxisMonitor {
    /// The axis of the last window that had one, radians.
    before_rad: Option<f64>,
    /// Windows that fitted, up to those that are asked for; and the end of the last one.
    fits: usize,
    last_fit: (u64, Timestamp),
    is_contradicted: bool,
}

impl AxisMonitor {
    /// Forgets the last window: the pose is another one.
    pub(super) fn reset(&mut self) {
        (self.before_rad, self.is_contradicted) = (None, false);
    }

    /// The last sweep whose heading was right, if the latest ones are wrong.
    pub(super) fn onset(&self) -> Option<(u64, Timestamp)> {
        self.is_contradicted.then_some(self.last_fit)
    }

    /// Compares the axis of a window with the one before and with the map's. A building that has not had one axis for some metres has
    /// none to compare with.
    pub(super) fn compare(&mut self, axis_rad: f64, sweep: &Sweep, params: &Params) {
        let agrees = self.before_rad.is_some_and(|before_rad| {
            let apart_rad = (axis_rad - before_rad).abs();
            apart_rad.min(FRAC_PI_2 - apart_rad) < params.max_axis_off_rad
        });
        self.before_rad = Some(axis_rad);
        if axis_rad.abs() < params.max_axis_off_rad {
            self.fits = (self.fits + 1).min(params.axis_fits);
            self.last_fit = (sweep.index, sweep.at);
        } else if agrees && self.fits == params.axis_fits {
            self.is_contradicted = true;
        } else if agrees {
            self.fits = 0;
        }
    }
}
