//! The first sweeps: they wait until they agree on the building's axis, and on the robot's first heading in it.
//!
//! The first heading is the frame of everything after it, so two views of it are taken. The Hough transform lays all the returns out along the
//! wheels' path ([`crate::orientation::start`]). From there the filter follows the sweeps to the last and back again, with
//! the walls that it learnt on the way: at the first sweep it knows what all of them know together. It does so twice. Near each other the two are averaged;
//! the farther they are apart, the likelier it is that the wheels bent the path, and the less the first is worth.

use super::AXIS_SIGMA_RAD;
use crate::event::Calibration;
use crate::geometry::{Pose2, wrap_angle};
use crate::orientation::dominant_directions::{Axis, DominantDirections};
use crate::orientation::start::{Search, Step};
use crate::position::ekf_slam::EkfSlam;
use crate::sweep::Sweep;
use std::f64::consts::FRAC_PI_2;

/// The sweeps that wait.
#[derive(Debug)]
pub(super) struct Initializer {
    finder: DominantDirections,
    sweeps: Vec<Sweep>,
    travel_m: f64,
    search: Option<Search>,
}

/// Where to begin, and with what.
#[derive(Debug)]
pub(super) struct Initialized {
    /// A tracker at the first sweep.
    pub(super) tracker: EkfSlam,
    /// All the sweeps that waited.
    pub(super) sweeps: Vec<Sweep>,
}

/// The axis is sought every so many sweeps, once the robot has driven far enough for its returns to agree pair by pair: a ring
/// of 8 needs 3 m, one of 32 a sixteenth of that.
const EVERY_SWEEPS: usize = 25;
const TRAVEL_M: f64 = 3.0 * 8.0 * 8.0;
/// Steps of the search in one sweep: it is over before the next is due.
const STEPS: usize = 3;
/// A lone slanted thing near the start must not pass for the building.
const MIN_TRAVEL_M: f64 = 0.6;
/// After so many the axis is not waited for any longer.
const MAX_SWEEPS: usize = 300;
/// The axis must beat every other direction this much at first, and by so much less per metre driven: furniture set at an angle leads
/// for a while, but the longer the way, the more of the building is heard.
const MAX_PEAK_RATIO: f64 = 1.8;
const PEAK_RATIO: f64 = 2.4;
const PEAK_RATIO_PER_M: f64 = 0.2;
/// The second time the walls are learnt from a better heading. A third gains nothing.
const PASSES: usize = 2;
/// Two views this far apart leave a fifth of the weight to the first.
const APART_RAD: f64 = 2.0 * std::f64::consts::PI / 180.0;

impl Initializer {
    /// Nothing heard yet.
    pub(super) fn new() -> Self {
        Self {
            finder: DominantDirections::default(),
            sweeps: Vec::with_capacity(MAX_SWEEPS),
            travel_m: 0.0,
            search: None,
        }
    }

    /// Takes a sweep; a initializer once there is one. A robot that stands says nothing new: such sweeps are not kept.
    pub(super) fn add(
        &mut self,
        sweep: &Sweep,
        wheels: &Calibration,
        is_trusted: impl Fn(usize) -> bool,
    ) -> Option<Initialized> {
        let stands = sweep.left_m == 0.0 && sweep.right_m == 0.0;
        if stands && self.sweeps.len() >= EVERY_SWEEPS && self.search.is_none() {
            return None;
        }
        self.sweeps.push(sweep.clone());
        self.travel_m += 0.5 * (sweep.left_m + sweep.right_m).abs();
        let axis = match self.search.take() {
            Some(search) => match self.search_on(search, wheels) {
                Step::Done(axis) => axis,
                Step::Running(search) => {
                    self.search = Some(search);
                    return None;
                }
            },
            None => {
                let enough_m = (TRAVEL_M / (sweep.beams.len() as f64).powi(2)).max(MIN_TRAVEL_M);
                let is_due = self.travel_m >= enough_m && self.sweeps.len().is_multiple_of(EVERY_SWEEPS);
                if is_due || self.sweeps.len() >= MAX_SWEEPS {
                    self.search = Search::begin(&mut self.finder, &self.sweeps, wheels);
                }
                if self.search.is_some() || self.sweeps.len() < MAX_SWEEPS {
                    return None;
                }
                None
            }
        };
        let axis = axis.filter(Axis::is_believed);
        let min_peak_ratio = (PEAK_RATIO - PEAK_RATIO_PER_M * self.travel_m).min(MAX_PEAK_RATIO);
        if self.sweeps.len() < MAX_SWEEPS && axis.is_none_or(|axis| axis.peak_ratio < min_peak_ratio) {
            return None;
        }
        let mut sweeps = std::mem::take(&mut self.sweeps);
        if let Some(first) = sweeps.first_mut() {
            (first.left_m, first.right_m) = (0.0, 0.0);
        }
        // Without an axis any direction is as good as another: the first heading becomes the map's x axis.
        let tracker = axis.map_or_else(
            || tracker_at(0.0, 0.25 * FRAC_PI_2, wheels),
            |axis| look_back(-axis.angle_rad, &sweeps, wheels, is_trusted),
        );
        Some(Initialized { tracker, sweeps })
    }

    /// A few steps of a search.
    fn search_on(&mut self, mut search: Search, wheels: &Calibration) -> Step {
        for _ in 0..STEPS {
            match search.step(&mut self.finder, &self.sweeps, wheels) {
                Step::Running(on) => search = on,
                done @ Step::Done(_) => return done,
            }
        }
        Step::Running(search)
    }
}

fn tracker_at(heading_rad: f64, sigma_rad: f64, wheels: &Calibration) -> EkfSlam {
    EkfSlam::new(Pose2::new(0.0, 0.0, heading_rad), sigma_rad, *wheels)
}

/// Follows the sweeps to the last and back, twice; a tracker at the heading that the axis and the way back agree on.
fn look_back(axis_rad: f64, sweeps: &[Sweep], wheels: &Calibration, is_trusted: impl Fn(usize) -> bool) -> EkfSlam {
    let mut agreed = tracker_at(axis_rad, AXIS_SIGMA_RAD, wheels);
    for _ in 0..PASSES {
        let from_rad = agreed.filter.pose().theta_rad;
        let mut scout = tracker_at(from_rad, AXIS_SIGMA_RAD, wheels);
        for sweep in sweeps {
            scout.predict(sweep.left_m, sweep.right_m);
            scout.correct(sweep, true, &is_trusted);
        }
        for pair in sweeps.windows(2).rev() {
            scout.predict(-pair[1].left_m, -pair[1].right_m);
            scout.correct(&pair[0], true, &is_trusted);
        }
        let (back_rad, sigma_rad) = (scout.filter.pose().theta_rad, scout.filter.pose_covariance()[(2, 2)].sqrt());
        let apart_rad = wrap_angle(from_rad - back_rad);
        let weight = 0.5 / (1.0 + (apart_rad / APART_RAD).powi(2));
        agreed = tracker_at(wrap_angle(back_rad + weight * apart_rad), sigma_rad, wheels);
    }
    agreed
}
