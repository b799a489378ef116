//! Finds the building's axis, and the robot's first heading in it, from the first sweeps.
//!
//! The first heading fixes the map's frame, so it is estimated twice. The Hough transform lays all returns out along the wheels' path
//! ([`crate::orientation::start`]). From there a trial filter follows the sweeps to the last and back again, learning walls on the
//! way: back at the first sweep it knows what all sweeps know together. This is done twice. If the two headings are near each other
//! they are averaged; the farther apart they are, the likelier it is that wrong wheels bent the path, and the less the first counts.

use super::params::Params;
use super::stages::Stages;
use super::step::{Backlog, Judged, RobotState};
use crate::event::Calibration;
use crate::geometry::{Pose2, wrap_angle};
use crate::orientation::dominant_directions::{Axis, DominantDirections};
use crate::orientation::start::{Search, Step};
use crate::pipeline::Waiting;
use crate::position;
use crate::position::ekf_slam::EkfSlam;
use crate::sweep::Sweep;
use std::f64::consts::FRAC_PI_2;

/// The first sweeps, all of them judged.
#[derive(Debug, Default)]
pub(super) struct Initializer {
    sweeps: Vec<Sweep>,
    travel_m: f64,
    search: Option<Search>,
}

/// The start of a map.
#[derive(Debug)]
pub(super) struct Initialized {
    /// The robot at the first sweep.
    pub(super) robot: Box<RobotState>,
    /// All collected sweeps.
    pub(super) backlog: Backlog,
}

impl Initializer {
    /// Collects a sweep, and searches the axis. A robot at standstill adds no information: such sweeps are dropped.
    pub(super) fn add(&mut self, judged: &Judged<'_>, stages: &mut Stages) -> Option<Initialized> {
        let Stages { params, position, wheels, finder, detector, .. } = stages;
        let (sweep, params, position) = (judged.sweep(), &*params, &*position);
        let stands = sweep.left_m == 0.0 && sweep.right_m == 0.0;
        if stands && self.sweeps.len() >= params.axis_every_sweeps && self.search.is_none() {
            return None;
        }
        self.keep(judged, params);
        let axis = self.find_axis(finder, wheels, params)?.filter(Axis::is_believed);
        let min_peak_ratio = (params.peak_ratio - params.peak_ratio_per_m * self.travel_m).min(params.max_peak_ratio);
        if self.sweeps.len() < params.axis_max_sweeps && axis.is_none_or(|axis| axis.peak_ratio < min_peak_ratio) {
            return None;
        }
        let mut sweeps = std::mem::take(&mut self.sweeps);
        if let Some(first) = sweeps.first_mut() {
            (first.left_m, first.right_m) = (0.0, 0.0);
        }
        // Without an axis every direction is as good: the first heading becomes the map's x axis.
        let ekf = axis.map_or_else(
            || ekf_at(position, 0.0, 0.25 * FRAC_PI_2, wheels),
            |axis| refine(-axis.angle_rad, &sweeps, wheels, |sensor| detector.is_trusted(sensor), params, position),
        );
        let robot = RobotState::new(ekf, sweeps.first().map(|first| first.index), params);
        Some(Initialized { robot, backlog: Backlog::new(sweeps) })
    }

    /// Collects a sweep.
    pub(super) fn keep(&mut self, judged: &Judged<'_>, params: &Params) {
        let sweep = judged.sweep();
        if self.sweeps.is_empty() {
            self.sweeps.reserve(params.axis_max_sweeps);
        }
        self.sweeps.push(sweep.clone());
        self.travel_m += 0.5 * (sweep.left_m + sweep.right_m).abs();
    }

    /// What the collected sweeps hold.
    pub(super) fn waiting(&self) -> Waiting {
        let rolled_m = self.sweeps.iter().map(|sweep| sweep.left_m.abs().max(sweep.right_m.abs())).sum();
        let beams = self.sweeps.iter().flat_map(|sweep| &sweep.beams);
        Waiting { rolled_m, returns: beams.filter(|beam| beam.range_m.is_finite()).count() }
    }

    /// Continues the search or begins one if it is due. The outer option is none while there is no result, the inner one if no
    /// axis was found in the last sweep that is waited for.
    #[expect(clippy::option_option, reason = "no result yet, and a result without an axis")]
    fn find_axis(
        &mut self,
        finder: &mut DominantDirections,
        wheels: &Calibration,
        params: &Params,
    ) -> Option<Option<Axis>> {
        if let Some(mut search) = self.search.take() {
            for _ in 0..params.search_steps {
                match search.step(finder, &self.sweeps, wheels) {
                    Step::Running(running) => search = running,
                    Step::Done(axis) => return Some(axis),
                }
            }
            self.search = Some(search);
            return None;
        }
        let sensors = self.sweeps.last().map_or(0, |sweep| sweep.beams.len());
        let enough_m = (params.axis_travel_m / (sensors as f64).powi(2)).max(params.axis_min_travel_m);
        let is_due = self.travel_m >= enough_m && self.sweeps.len().is_multiple_of(params.axis_every_sweeps);
        if is_due || self.sweeps.len() >= params.axis_max_sweeps {
            self.search = Search::begin(finder, &self.sweeps, wheels);
        }
        let gives_up = self.search.is_none() && self.sweeps.len() >= params.axis_max_sweeps;
        gives_up.then_some(None)
    }
}

fn ekf_at(params: &position::params::Params, heading_rad: f64, sigma_rad: f64, wheels: &Calibration) -> EkfSlam {
    EkfSlam::with_params(params, Pose2::new(0.0, 0.0, heading_rad), sigma_rad, *wheels)
}

/// Follows the sweeps to the last and back, several times; a filter at the heading that the axis and the ways back agree on.
fn refine(
    axis_rad: f64,
    sweeps: &[Sweep],
    wheels: &Calibration,
    is_trusted: impl Fn(usize) -> bool,
    params: &Params,
    position: &position::params::Params,
) -> EkfSlam {
    let mut agreed = ekf_at(position, axis_rad, params.axis_sigma_rad, wheels);
    for _ in 0..params.refine_passes {
        let from_rad = agreed.filter.pose().theta_rad;
        let mut trial = ekf_at(position, from_rad, params.axis_sigma_rad, wheels);
        trial.adopt_noise(&agreed);
        for sweep in sweeps {
            trial.predict(sweep.left_m, sweep.right_m);
            trial.correct(sweep, true, &is_trusted);
        }
        for pair in sweeps.windows(2).rev() {
            trial.predict(-pair[1].left_m, -pair[1].right_m);
            trial.correct(&pair[0], true, &is_trusted);
        }
        let (back_rad, sigma_rad) = (trial.filter.pose().theta_rad, trial.filter.pose_covariance()[(2, 2)].sqrt());
        let apart_rad = wrap_angle(from_rad - back_rad);
        let weight = 0.5 / (1.0 + (apart_rad / params.refine_apart_rad).powi(2));
        agreed = ekf_at(position, wrap_angle(back_rad + weight * apart_rad), sigma_rad, wheels);
        agreed.adopt_noise(&trial);
    }
    agreed
}
