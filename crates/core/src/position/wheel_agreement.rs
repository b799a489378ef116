//! Do the walls' corrections stay within what the wheels' errors allow?
//!
//! Wheels err slowly: over a few metres their pose is off by no more than their sizes, their slip and the heading at the start
//! explain. Walls err at once: a return that is taken for the wrong wall moves the pose, the walls learnt from there move the next one,
//! and all of them agree with their own consequence. So over a stretch of the way the corrections are summed in the robot's frame. If the
//! sum is far more than the wheels' errors allow while the known walls explain few of the returns, the walls are wrong: the pose
//! goes back to where the stretch began, and from there with the wheels alone.
//!
//! | symbol | meaning |
//! |---|---|
//! | L, a | length of the stretch (m), angle turned in it (rad), both as sums of magnitudes |
//! | `sigma_theta` | heading at its start, and what ratio and base of the wheels add: `(L sigma_ratio / base)² + (a sigma_base)²` |
//! | `sigma_m` | position: `(L sigma_theta)²`, and the noise of the walls |

use super::ekf_slam::EkfSlam;
use super::filter::Filter;
use crate::event::Calibration;
use crate::geometry::{Pose2, wrap_angle};

/// Constants of `wheel_agreement`.
///
/// | name | value | unit | how chosen | what breaks when it is wrong |
/// |---|---|---|---|---|
/// | `stretch_m` | 3.0 | m | by hand: a room's length | too small: a slow drag stays below the floor; too large: it is found late |
/// | `stretch_rad` | 9.0 | rad | by hand: a turn and a half on the spot | as `stretch_m` |
/// | `sigmas` | 3.0 | sigma | by hand | too small: bad wheels are taken for wrong walls; too large: wrong walls drag the pose |
/// | `floor_m` | 0.12 | m | by hand: the scatter of corrections in clutter | as `sigmas` |
/// | `floor_rad` | 0.1 | rad | by hand | as `sigmas` |
/// | `heading_sigma_rad` | 0.02 | rad | by hand: no heading is surer | too small: an overconfident heading is taken for wrong walls |
/// | `share_sweeps` | 30.0 | sweeps | by hand: the memory of the share of explained returns | too small: one doorway decides; too large: a wrong map is judged by the right one before |
/// | `explained` | 0.5 | - | by hand | too small: wrong walls are believed; too large: a slip is not corrected in clutter |
#[expect(missing_docs, reason = "the table describes each field")]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AgreementParams {
    pub stretch_m: f64,
    pub stretch_rad: f64,
    pub sigmas: f64,
    pub floor_m: f64,
    pub floor_rad: f64,
    pub heading_sigma_rad: f64,
    pub share_sweeps: f64,
    pub explained: f64,
}

impl Default for AgreementParams {
    fn default() -> Self {
        Self {
            stretch_m: 3.0,
            stretch_rad: 9.0,
            sigmas: 3.0,
            floor_m: 0.12,
            floor_rad: 0.1,
            heading_sigma_rad: 0.02,
            share_sweeps: 30.0,
            explained: 0.5,
        }
    }
}

/// The stretch of the way that is being compared.
#[derive(Clone, Copy, Debug)]
pub(super) struct WheelAgreement {
    stretch: Option<Stretch>,
    /// Share of the returns that known walls explain.
    explained: f64,
    /// True from a drag until a whole stretch has shown none.
    is_in_doubt: bool,
    params: AgreementParams,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Stretch {
    /// The sweep that it began with.
    pub(super) since: u64,
    /// The pose by the wheels alone from its start on.
    pub(super) by_wheels: Pose2,
    /// The wheels as known at its start, and the variances of ratio and base.
    pub(super) wheels: [f64; 2],
    pub(super) wheel_variances: [f64; 2],
    /// True over reported travel at its start.
    travel: f64,
    heading_variance: f64,
    length_m: f64,
    turned_rad: f64,
    /// Sum of the corrections in the robot's frame: ahead, to the left, counter-clockwise.
    corrections: [f64; 3],
}

impl WheelAgreement {
    pub(super) fn new(params: AgreementParams) -> Self {
        Self { stretch: None, explained: 1.0, is_in_doubt: false, params }
    }

    /// Begins anew: the pose was moved otherwise.
    pub(super) fn reset(&mut self) {
        (self.stretch, self.is_in_doubt) = (None, false);
    }

    /// Adds the motion of a sweep, by the configured wheels.
    pub(super) fn roll(&mut self, nominal: &Calibration, left_m: f64, right_m: f64) {
        let Some(stretch) = &mut self.stretch else { return };
        let [ratio, base] = stretch.wheels;
        let travel = stretch.travel;
        let (left_m, right_m) = (travel * left_m * (1.0 - 0.5 * ratio), travel * right_m * (1.0 + 0.5 * ratio));
        // The base grows with the travel, so that turning stays as it is.
        let base_m = travel * nominal.wheel_base_m * (1.0 + base);
        stretch.by_wheels = stretch.by_wheels.rolled(left_m, right_m, base_m);
        stretch.length_m += 0.5 * (left_m + right_m).abs();
        stretch.turned_rad += ((right_m - left_m) / base_m).abs();
    }

    /// Adds a sweep's correction and the share of its returns that known walls explain. Returns the stretch if the walls are wrong.
    pub(super) fn correct(
        &mut self,
        sweep: u64,
        predicted: Pose2,
        filter: &Filter,
        returns: [f64; 2],
    ) -> Option<Stretch> {
        let params = self.params;
        let [explained, all] = returns;
        if all > 0.0 {
            self.explained += (explained / all - self.explained) / params.share_sweeps;
        }
        let corrected = filter.pose();
        let stretch = self.stretch.get_or_insert_with(|| Stretch::begin(sweep, filter));
        let moved = predicted.inverse() * corrected;
        for (sum, part) in stretch.corrections.iter_mut().zip([moved.x_m, moved.y_m, moved.theta_rad]) {
            *sum += part;
        }
        let [ahead_m, aside_m, turned_rad] = stretch.corrections;
        let base_m = filter.nominal.wheel_base_m;
        let [ratio_variance, base_variance] = stretch.wheel_variances;
        let wheels_variance =
            (stretch.length_m / base_m).powi(2) * ratio_variance + stretch.turned_rad.powi(2) * base_variance;
        let heading_variance = stretch.heading_variance.max(params.heading_sigma_rad.powi(2)) + wheels_variance;
        let allowed_rad = params.floor_rad + params.sigmas * heading_variance.sqrt();
        let allowed_m = params.floor_m + params.sigmas * stretch.length_m * heading_variance.sqrt();
        let is_off = libm::hypot(ahead_m, aside_m) > allowed_m || wrap_angle(turned_rad).abs() > allowed_rad;
        let stretch = *stretch;
        let is_over = stretch.length_m > params.stretch_m || stretch.turned_rad > params.stretch_rad;
        if is_off || is_over {
            self.stretch = None;
        }
        let is_dragged = is_off && self.explained < params.explained;
        self.is_in_doubt = is_dragged || (self.is_in_doubt && !is_over);
        is_dragged.then_some(stretch)
    }
}

impl EkfSlam {
    /// True while the walls have lately moved the pose by more than the wheels' errors allow.
    #[must_use]
    pub fn is_dragged(&self) -> bool {
        self.agreement.is_in_doubt
    }

    /// Compares the sweep's correction with the wheels. If the walls are wrong, the pose is the wheels' from the start of the stretch on,
    /// and the walls learnt since are removed.
    pub(super) fn compare_with_wheels(&mut self, sweep: u64, predicted: Pose2, returns: [f64; 2]) {
        let Some(stretch) = self.agreement.correct(sweep, predicted, &self.filter, returns) else { return };
        let params = self.params.agreement;
        let heading_sigma_rad = stretch.heading_variance.sqrt().max(params.heading_sigma_rad);
        let sigma_m = params.floor_m.max(stretch.length_m * heading_sigma_rad);
        self.return_to(stretch.by_wheels, stretch.since, [sigma_m, heading_sigma_rad]);
        self.filter.set_wheels(stretch.wheels, stretch.wheel_variances);
    }
}

impl Stretch {
    fn begin(sweep: u64, filter: &Filter) -> Self {
        Self {
            since: sweep,
            by_wheels: filter.pose(),
            wheels: [filter.robot[3], filter.robot[4]],
            wheel_variances: [filter.robot_cov[(3, 3)], filter.robot_cov[(4, 4)]],
            travel: filter.travel_scale().0,
            heading_variance: filter.robot_cov[(2, 2)],
            length_m: 0.0,
            turned_rad: 0.0,
            corrections: [0.0; 3],
        }
    }
}
