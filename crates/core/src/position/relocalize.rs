//! Where a lost robot is: its last returns against all the walls it knows.
//!
//! The building's axis gives the heading but for quarter turns. Under each of the four, a return that came from a wall on one side
//! says how far the robot is from where it is believed to be, across that wall: x and y separate, so two histograms of votes find
//! the likely shifts, and each pair of them is scored by the share of returns that its walls explain. Where two places
//! explain them about as well, the robot does not know.

use super::beam_model::{Side, WallObservation, observe_wall};
use crate::geometry::Pose2;
use crate::sweep::Beam;
use std::f64::consts::FRAC_PI_2;

/// A wall as the search needs it.
#[derive(Clone, Copy, Debug)]
pub struct KnownWall {
    /// The side it is seen from.
    pub side: Side,
    /// Its offset, metres.
    pub offset_m: f64,
    /// Where along it it has been seen.
    pub lo_m: f64,
    /// The other end.
    pub hi_m: f64,
}

/// A place that explains the returns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// `true_map_from_believed_map`: what moves the believed poses to where they belong.
    pub correction: Pose2,
    /// Share of the returns that the walls explain there.
    pub explained: f64,
}

/// Farthest that the robot is sought from where it is believed, metres: farther off, wrong places fit by chance too often.
const REACH_M: f64 = 1.5;
const BIN_M: f64 = 0.05;
const BINS: usize = 61;
/// Likeliest shifts per axis that are tried in pairs.
const PEAKS: usize = 6;
/// A wall explains a return this near, metres, and this far beyond its ends.
const NEAR_M: f64 = 0.08;
const MARGIN_M: f64 = 0.15;
/// A return from so far behind a wall, metres, speaks against a place as one explained speaks for it.
const THROUGH_M: f64 = 0.15;
/// A place is scored by no more than about so many returns.
const MAX_SCORED: usize = 150;
/// Fewer returns than this find no place.
const MIN_RETURNS: usize = 60;
/// The best place must explain this share of the returns, and so much more than any other.
const MIN_EXPLAINED: f64 = 0.65;
const MIN_LEAD: f64 = 0.08;
/// Wheels slip by little more often than by much: what a metre, a move at the most, and a quarter turn take from the score.
const PER_METRE: f64 = 0.2;
const PER_MOVE: f64 = 0.25;
const PER_QUARTER: f64 = 0.35;

/// The one place from which the walls explain the returns, each a believed pose and a beam; `axis_rad` is the building's axis in the believed map.
#[must_use]
pub fn find(returns: &[(Pose2, Beam)], walls: impl Iterator<Item = KnownWall>, axis_rad: f64) -> Option<Place> {
    let pivot = returns.last()?.0;
    let walls = &nearby(returns, walls, pivot);
    let mut places: Vec<(f64, Place)> = Vec::new();
    for quarter in [0i8, 1, -1, 2] {
        let turn = f64::from(quarter) * FRAC_PI_2 - axis_rad;
        // Turned about where the robot is now.
        let about = Pose2::new(pivot.x_m, pivot.y_m, 0.0);
        let turned = about * Pose2::new(0.0, 0.0, turn) * about.inverse();
        let sightings: Vec<WallObservation> =
            returns.iter().filter_map(|(pose, beam)| observe_wall(turned * *pose, beam)).collect();
        if sightings.len() < MIN_RETURNS {
            continue;
        }
        let [across_x, across_y] = [0, 1].map(|axis| shifts(&sightings, walls, axis));
        let pairs = across_x.iter().flat_map(|dx| across_y.iter().map(move |dy| (*dx, *dy)));
        for (dx, dy) in pairs.chain([(0.0, 0.0)]) {
            let (explained, dx, dy) = explained(&sightings, walls, dx, dy);
            let place = Place { correction: Pose2::new(dx, dy, 0.0) * turned, explained };
            let cost = (PER_METRE * libm::hypot(dx, dy)).min(PER_MOVE) + PER_QUARTER * f64::from(quarter.abs());
            places.push((explained - cost, place));
        }
    }
    let &(score, best) = places.iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
    let is_elsewhere = |other: &Place| {
        let apart = (best.correction * pivot).inverse() * (other.correction * pivot);
        apart.position().coords.norm() > 0.25 || apart.theta_rad.abs() > 0.3
    };
    let rival = places.iter().filter(|(_, place)| is_elsewhere(place)).map(|(score, _)| *score).fold(0.0, f64::max);
    (best.explained >= MIN_EXPLAINED && score - rival >= MIN_LEAD).then_some(best)
}

/// The walls that any return may have come from, however the robot is turned and moved: their number does not grow with the building.
fn nearby(returns: &[(Pose2, Beam)], walls: impl Iterator<Item = KnownWall>, pivot: Pose2) -> Vec<KnownWall> {
    let heard_m = |(pose, beam): &(Pose2, Beam)| {
        let sensor = (*pose * beam.robot_from_sensor).position();
        (sensor - pivot.position()).norm() + beam.range_m
    };
    let reach_m = returns.iter().map(heard_m).fold(0.0, f64::max) + REACH_M + MARGIN_M;
    let is_near = |wall: &KnownWall| {
        let (across_m, along_m) = if wall.side.axis() == 0 { (pivot.x_m, pivot.y_m) } else { (pivot.y_m, pivot.x_m) };
        let is_beside = wall.lo_m < along_m + reach_m && wall.hi_m > along_m - reach_m;
        (wall.offset_m - across_m).abs() < reach_m && is_beside
    };
    walls.filter(is_near).collect()
}

/// The shifts along one axis that most pairs of returns and walls ask for.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the histogram")]
fn shifts(sightings: &[WallObservation], walls: &[KnownWall], axis: usize) -> Vec<f64> {
    let mut votes = [0u32; BINS];
    for observation in sightings.iter().filter(|observation| observation.side.axis() == axis) {
        for wall in walls.iter().filter(|wall| wall.side == observation.side) {
            let place = (wall.offset_m - observation.offset_m() + REACH_M) / BIN_M + 0.5;
            let along = observation.along_m > wall.lo_m - REACH_M && observation.along_m < wall.hi_m + REACH_M;
            if along && place >= 0.0 && place < BINS as f64 {
                votes[place as usize] += 1;
            }
        }
    }
    let smooth = |bin: usize| votes[bin - 1] + 2 * votes[bin] + votes[bin + 1];
    let mut peaks: Vec<usize> = (1..BINS - 1).filter(|&bin| votes[bin] > 0).collect();
    peaks.sort_by_key(|&bin| std::cmp::Reverse((smooth(bin), std::cmp::Reverse(bin.abs_diff(BINS / 2)))));
    let mut chosen: Vec<usize> = Vec::with_capacity(PEAKS);
    for bin in peaks {
        if chosen.len() < PEAKS && chosen.iter().all(|other| other.abs_diff(bin) > 1) {
            chosen.push(bin);
        }
    }
    if chosen.is_empty() {
        chosen.push(BINS / 2);
    }
    chosen.into_iter().map(|bin| bin as f64 * BIN_M - REACH_M).collect()
}

/// The share of the sightings that walls explain after a shift, and the shift with the mean misfit taken out.
fn explained(sightings: &[WallObservation], walls: &[KnownWall], dx: f64, dy: f64) -> (f64, f64, f64) {
    let (mut hits, mut counts, mut misfits) = (0.0, [0.0; 2], [0.0; 2]);
    let stride = (sightings.len() / MAX_SCORED).max(1);
    for observation in sightings.iter().step_by(stride) {
        let axis = observation.side.axis();
        let (across, along) = if axis == 0 { (dx, dy) } else { (dy, dx) };
        let (offset_m, along_m) = (observation.offset_m() + across, observation.along_m + along);
        let misfit_m = walls
            .iter()
            .filter(|w| w.side == observation.side && along_m > w.lo_m - MARGIN_M && along_m < w.hi_m + MARGIN_M)
            .map(|wall| wall.offset_m - offset_m)
            .min_by(|a, b| a.abs().total_cmp(&b.abs()));
        let (side, foot_m, depth_m) = (observation.side, observation.sensor_along_m + along, observation.depth_m);
        let is_through = |w: &KnownWall| {
            let before_m = depth_m - side.sign() * (w.offset_m - observation.sensor_across_m - across);
            let faces = w.side == side && foot_m > w.lo_m + MARGIN_M && foot_m < w.hi_m - MARGIN_M;
            faces && before_m > THROUGH_M && before_m < depth_m
        };
        if observation.oblique_rad <= 0.0 && walls.iter().any(is_through) {
            hits -= 1.0;
        }
        if let Some(misfit_m) = misfit_m.filter(|misfit_m| misfit_m.abs() < NEAR_M) {
            hits += 1.0;
            counts[axis] += 1.0;
            misfits[axis] += misfit_m;
        }
    }
    let mean = |axis: usize| misfits[axis] / f64::max(counts[axis], 1.0);
    (hits / sightings.len().div_ceil(stride) as f64, dx + mean(0), dy + mean(1))
}
