//! Is the heading still the building's?
//!
//! Wheels that spin in place turn the pose by tens of degrees at once, and a sparse ring then finds walls for the wrong heading. But the
//! returns of the next metre, laid out along the path, still have an axis of their own. Where two windows after one another agree on an
//! axis that is not the map's, the heading was wrong since the last window that agreed with the map's, and the robot is lost.

use super::params::Params;
use crate::geometry::{Placement, Pose2, wrap_angle};
use crate::orientation::dominant_directions::{Axis, DominantDirections};
use crate::sweep::Sweep;
use crate::time::Timestamp;
use std::f64::consts::FRAC_PI_2;

/// Compares the axis of the latest returns with the map's.
#[derive(Debug)]
pub(super) struct AxisMonitor {
    directions: DominantDirections,
    /// The pose of the last sweep, and the way since the window began, metres.
    last: Option<Pose2>,
    way_m: f64,
    next_sensor: usize,
    /// The axis of the last window that had one, radians.
    before_rad: Option<f64>,
    /// Windows that fitted, up to those that are asked for; and the end of the last one.
    fits: usize,
    last_fit: (u64, Timestamp),
    is_contradicted: bool,
}

impl AxisMonitor {
    pub(super) fn new(directions: DominantDirections) -> Self {
        Self {
            directions,
            last: None,
            way_m: 0.0,
            next_sensor: 0,
            before_rad: None,
            fits: 0,
            last_fit: (0, Timestamp::default()),
            is_contradicted: false,
        }
    }

    /// Forgets everything: the pose is another one.
    pub(super) fn reset(&mut self) {
        self.directions.clear();
        (self.last, self.way_m, self.before_rad, self.is_contradicted) = (None, 0.0, None, false);
    }

    /// The last sweep whose heading was right, if the latest ones are wrong.
    pub(super) fn onset(&self) -> Option<(u64, Timestamp)> {
        self.is_contradicted.then_some(self.last_fit)
    }

    /// Adds a corrected sweep; at the end of a window compares its axis.
    pub(super) fn add(&mut self, sweep: &Sweep, pose: Pose2, is_trusted: impl Fn(usize) -> bool, params: &Params) {
        let step_m = self.last.map_or(0.0, |last| {
            let moved = last.inverse() * pose;
            libm::hypot(moved.x_m, moved.y_m) + params.axis_window_rim_m * wrap_angle(moved.theta_rad).abs()
        });
        if self.last.is_some() && step_m < params.axis_window_step_m {
            return;
        }
        (self.last, self.way_m) = (Some(pose), self.way_m + step_m);
        self.lay_out(sweep, pose, is_trusted, params);
        if self.way_m >= params.axis_window_m {
            if let Some(axis) = self.directions.find().filter(Axis::is_believed) {
                self.compare(axis.angle_rad, sweep, params);
            }
            self.directions.clear();
            self.way_m = 0.0;
        }
    }

    /// The sensors take turns, so that a large ring costs no more than a small one.
    fn lay_out(&mut self, sweep: &Sweep, pose: Pose2, is_trusted: impl Fn(usize) -> bool, params: &Params) {
        let (placement, sensors) = (Placement::from(pose), sweep.beams.len());
        for sensor in (0..sensors.min(params.axis_window_sensors)).map(|offset| (self.next_sensor + offset) % sensors) {
            if let Some(beam) = sweep.beams.get(sensor).filter(|_| is_trusted(sensor)) {
                self.directions.add(placement, beam);
            }
        }
        self.next_sensor = (self.next_sensor + params.axis_window_sensors) % sensors.max(1);
    }

    /// Compares the axis of a window with the one before and with the map's. A building that has not had one axis for some metres has
    /// none to compare with.
    fn compare(&mut self, axis_rad: f64, sweep: &Sweep, params: &Params) {
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
