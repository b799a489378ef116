//! Global relocalization: where the last returns of a lost robot fit the known walls.
//!
//! The building's axis gives the heading but for quarter turns. Under each of the four, a return from a wall on one side measures the
//! robot's error across that wall. x and y separate, so two histograms of votes find the likely shifts. Each pair of shifts is scored
//! by the share of returns that the walls explain, less a prior against large moves:
//!
//! `score = explained − min(per_metre |move|, per_move) − per_quarter |quarters|`
//!
//! Where two poses score about as well, the robot stays lost. Voting over a quantized space of transformations is the
//! generalized Hough transform (Ballard, Pattern Recognition 13, 1981); that x and y separate is due to the orthogonal walls.

use super::beam_model::{Side, WallObservation, observe_wall};
use super::params::Params;
use crate::geometry::Pose2;
use crate::sweep::Beam;
use std::f64::consts::FRAC_PI_2;

/// A known wall.
#[derive(Clone, Copy, Debug)]
pub struct KnownWall {
    /// The side it is observed from.
    pub side: Side,
    /// Its offset, metres.
    pub offset_m: f64,
    /// The range along the wall where it has been observed, metres: its lower end.
    pub lo_m: f64,
    /// Its upper end.
    pub hi_m: f64,
}

/// A pose that explains the returns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PoseHypothesis {
    /// `true_map_from_believed_map`: moves the believed poses to the true ones.
    pub correction: Pose2,
    /// Share of the returns that the walls explain there.
    pub explained: f64,
}

/// Constants of the search.
///
/// | name | value | unit | how chosen | what breaks when it is wrong |
/// |---|---|---|---|---|
/// | `reach_m` | 1.5 | m | by hand: farther off, wrong poses fit by chance too often | too small: a robot that was carried is not found; too large: it is found at a wrong pose |
/// | `bin_m` | 0.05 | m | by hand: 2.5 times the noise of a range | too small: votes spread; too large: peaks merge |
/// | `peaks` | 6 | shifts per axis | by hand | too small: the true shift is not tried; too large: time grows with its square |
/// | `near_m` | 0.08 | m | by hand: four times the noise of a range | too small: true poses score low; too large: wrong ones score high |
/// | `margin_m` | 0.15 | m | by hand: as in data association | as `near_m` |
/// | `through_m` | 0.15 | m | by hand | too small: noise counts against true poses; too large: a beam may pass through walls |
/// | `max_scored` | 150 | returns | by hand: bounds the time | too small: scores are noisy; too large: the sweep of the search takes long |
/// | `min_returns` | 60 | returns | by hand | too small: a few returns fit anywhere; too large: sparse rings find no pose |
/// | `min_explained` | 0.65 | - | by hand | too small: wrong poses; too large: a furnished room hides the true one |
/// | `min_lead` | 0.08 | - | by hand | too small: one of two alike rooms is chosen by chance; too large: the robot stays lost |
/// | `rival_m` | 0.25 | m | by hand | too small: neighbours of the best pose are its rivals; too large: a true rival is not one |
/// | `rival_rad` | 0.3 | rad | by hand | as above |
/// | `per_metre` | 0.2 | 1/m | by hand: wheels slip by little more often than by much | too small: far poses win by chance; too large: a carried robot is found nearby |
/// | `per_move` | 0.25 | - | by hand | as `per_metre`, for far moves |
/// | `per_quarter` | 0.35 | 1/quarter turn | simulated drives: with 0.12 and 0.25 a flat of the same walls twice was turned over | too small: symmetric buildings turn over; too large: a robot that was turned by hand stays lost |
#[expect(missing_docs, reason = "the table describes each field")]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelocalizeParams {
    pub reach_m: f64,
    pub bin_m: f64,
    pub peaks: usize,
    pub near_m: f64,
    pub margin_m: f64,
    pub through_m: f64,
    pub max_scored: usize,
    pub min_returns: usize,
    pub min_explained: f64,
    pub min_lead: f64,
    pub rival_m: f64,
    pub rival_rad: f64,
    pub per_metre: f64,
    pub per_move: f64,
    pub per_quarter: f64,
}

impl Default for RelocalizeParams {
    fn default() -> Self {
        Self {
            reach_m: 1.5,
            bin_m: 0.05,
            peaks: 6,
            near_m: 0.08,
            margin_m: 0.15,
            through_m: 0.15,
            max_scored: 150,
            min_returns: 60,
            min_explained: 0.65,
            min_lead: 0.08,
            rival_m: 0.25,
            rival_rad: 0.3,
            per_metre: 0.2,
            per_move: 0.25,
            per_quarter: 0.35,
        }
    }
}

impl RelocalizeParams {
    /// Bins of a histogram over the shifts from −`reach_m` to `reach_m`; odd, so that no shift is one of them.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small positive number")]
    fn bins(&self) -> usize {
        2 * libm::round(self.reach_m / self.bin_m) as usize + 1
    }
}

/// The one pose at which the walls explain the returns, each a believed pose and a beam. `axis_rad` is the building's axis in the
/// believed map.
#[must_use]
pub(crate) fn find(
    params: &Params,
    returns: &[(Pose2, Beam)],
    walls: impl Iterator<Item = KnownWall>,
    axis_rad: f64,
) -> Option<PoseHypothesis> {
    let Params { beam: beam_params, relocalize: params, .. } = params;
    let pivot = returns.last()?.0;
    let walls = &nearby(params, returns, walls, pivot);
    let mut hypotheses: Vec<(f64, PoseHypothesis)> = Vec::new();
    for quarter in [0i8, 1, -1, 2] {
        let rotation_rad = f64::from(quarter) * FRAC_PI_2 - axis_rad;
        // Rotated about the current position.
        let about = Pose2::new(pivot.x_m, pivot.y_m, 0.0);
        let rotated = about * Pose2::new(0.0, 0.0, rotation_rad) * about.inverse();
        let observations: Vec<WallObservation> =
            returns.iter().filter_map(|(pose, beam)| observe_wall(beam_params, rotated * *pose, beam)).collect();
        if observations.len() < params.min_returns {
            continue;
        }
        let [across_x, across_y] = [0, 1].map(|axis| shifts(params, &observations, walls, axis));
        let pairs = across_x.iter().flat_map(|dx| across_y.iter().map(move |dy| (*dx, *dy)));
        for (dx, dy) in pairs.chain([(0.0, 0.0)]) {
            let (explained, dx, dy) = explained(params, &observations, walls, dx, dy);
            let hypothesis = PoseHypothesis { correction: Pose2::new(dx, dy, 0.0) * rotated, explained };
            let cost = (params.per_metre * libm::hypot(dx, dy)).min(params.per_move)
                + params.per_quarter * f64::from(quarter.abs());
            hypotheses.push((explained - cost, hypothesis));
        }
    }
    let &(score, best) = hypotheses.iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
    let is_elsewhere = |other: &PoseHypothesis| {
        let apart = (best.correction * pivot).inverse() * (other.correction * pivot);
        apart.position().coords.norm() > params.rival_m || apart.theta_rad.abs() > params.rival_rad
    };
    let rival = hypotheses
        .iter()
        .filter(|(_, hypothesis)| is_elsewhere(hypothesis))
        .map(|(score, _)| *score)
        .fold(0.0, f64::max);
    (best.explained >= params.min_explained && score - rival >= params.min_lead).then_some(best)
}

/// The walls within reach of any return, at any heading and shift: their number does not grow with the building.
fn nearby(
    params: &RelocalizeParams,
    returns: &[(Pose2, Beam)],
    walls: impl Iterator<Item = KnownWall>,
    pivot: Pose2,
) -> Vec<KnownWall> {
    let distance_m = |(pose, beam): &(Pose2, Beam)| {
        let sensor = (*pose * beam.robot_from_sensor).position();
        (sensor - pivot.position()).norm() + beam.range_m
    };
    let reach_m = returns.iter().map(distance_m).fold(0.0, f64::max) + params.reach_m + params.margin_m;
    let is_near = |wall: &KnownWall| {
        let (across_m, along_m) = if wall.side.axis() == 0 { (pivot.x_m, pivot.y_m) } else { (pivot.y_m, pivot.x_m) };
        let is_beside = wall.lo_m < along_m + reach_m && wall.hi_m > along_m - reach_m;
        (wall.offset_m - across_m).abs() < reach_m && is_beside
    };
    walls.filter(is_near).collect()
}

/// The shifts along one axis that most pairs of returns and walls vote for.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the histogram")]
fn shifts(params: &RelocalizeParams, observations: &[WallObservation], walls: &[KnownWall], axis: usize) -> Vec<f64> {
    let bins = params.bins();
    let mut votes = vec![0u32; bins];
    for observation in observations.iter().filter(|observation| observation.side.axis() == axis) {
        for wall in walls.iter().filter(|wall| wall.side == observation.side) {
            let bin = (wall.offset_m - observation.offset_m() + params.reach_m) / params.bin_m + 0.5;
            let along =
                observation.along_m > wall.lo_m - params.reach_m && observation.along_m < wall.hi_m + params.reach_m;
            if along && bin >= 0.0 && bin < bins as f64 {
                votes[bin as usize] += 1;
            }
        }
    }
    let smooth = |bin: usize| votes[bin - 1] + 2 * votes[bin] + votes[bin + 1];
    let mut peaks: Vec<usize> = (1..bins - 1).filter(|&bin| votes[bin] > 0).collect();
    peaks.sort_by_key(|&bin| std::cmp::Reverse((smooth(bin), std::cmp::Reverse(bin.abs_diff(bins / 2)))));
    let mut chosen: Vec<usize> = Vec::with_capacity(params.peaks);
    for bin in peaks {
        if chosen.len() < params.peaks && chosen.iter().all(|other| other.abs_diff(bin) > 1) {
            chosen.push(bin);
        }
    }
    if chosen.is_empty() {
        chosen.push(bins / 2);
    }
    chosen.into_iter().map(|bin| bin as f64 * params.bin_m - params.reach_m).collect()
}

/// The share of the observations that walls explain after a shift, and the shift with the mean misfit removed.
fn explained(
    params: &RelocalizeParams,
    observations: &[WallObservation],
    walls: &[KnownWall],
    dx: f64,
    dy: f64,
) -> (f64, f64, f64) {
    let (mut hits, mut counts, mut misfits) = (0.0, [0.0; 2], [0.0; 2]);
    let stride = (observations.len() / params.max_scored).max(1);
    for observation in observations.iter().step_by(stride) {
        let axis = observation.side.axis();
        let (across, along) = if axis == 0 { (dx, dy) } else { (dy, dx) };
        let (offset_m, along_m) = (observation.offset_m() + across, observation.along_m + along);
        let misfit_m = walls
            .iter()
            .filter(|w| {
                w.side == observation.side && along_m > w.lo_m - params.margin_m && along_m < w.hi_m + params.margin_m
            })
            .map(|wall| wall.offset_m - offset_m)
            .min_by(|a, b| a.abs().total_cmp(&b.abs()));
        let (side, sensor_along_m, depth_m) =
            (observation.side, observation.sensor_along_m + along, observation.depth_m);
        let is_through = |w: &KnownWall| {
            let before_m = depth_m - side.sign() * (w.offset_m - observation.sensor_across_m - across);
            let faces = w.side == side
                && sensor_along_m > w.lo_m + params.margin_m
                && sensor_along_m < w.hi_m - params.margin_m;
            faces && before_m > params.through_m && before_m < depth_m
        };
        if observation.oblique_rad <= 0.0 && walls.iter().any(is_through) {
            hits -= 1.0;
        }
        if let Some(misfit_m) = misfit_m.filter(|misfit_m| misfit_m.abs() < params.near_m) {
            hits += 1.0;
            counts[axis] += 1.0;
            misfits[axis] += misfit_m;
        }
    }
    let mean = |axis: usize| misfits[axis] / f64::max(counts[axis], 1.0);
    (hits / observations.len().div_ceil(stride) as f64, dx + mean(0), dy + mean(1))
}
