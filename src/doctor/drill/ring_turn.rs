//! A ring that is turned by less than sensors are apart: where in the turn each sensor faces a wall.
//!
//! A sonar reads the least distance of a wall while the wall's normal lies in its cone. In the turn of the drill the middle of these readings
//! tells the bearing of the normal by the wheels, and the sensor's own bearing the same by the ring. After a push along a wall the normals are
//! at quarter turns, so that both give the turn of the ring, modulo a quarter.

use super::Leg;
use slamd_core::{Ring, wrap_angle};

/// Slopes of a push along or towards walls: of walls ahead and behind, and of walls beside it.
const AHEAD: f64 = 0.85;
const BESIDE: f64 = 0.2;
/// Readings so near to the least one are of the wall faced, metres.
const FACED_M: f64 = 0.01;
/// A plateau of fewer readings is none, and one wider than this is no cone, radians.
const MIN_READINGS: usize = 3;
const MAX_WIDTH_RAD: f64 = 1.0;
/// The result needs so many sensors, headings so far apart that the scale of turning is known, and residuals no larger than these, radians.
const MIN_SENSORS: usize = 4;
const MIN_SPAN_RAD: f64 = 0.35;
const MAX_RESIDUAL_RAD: f64 = 0.1;
/// A turn that is counted as more than so much larger or smaller may be a quarter off, as a part of the turn.
const MAX_SCALE_ERROR: f64 = 0.3;

/// How far the ring is turned counter-clockwise, radians, from an eighth of a turn clockwise to an eighth counter-clockwise; none if the drill does
/// not tell. `slopes` are those of the push, by bearing.
pub(super) fn ring_turn(slopes: &[(f64, f64)], turn: &Leg, ring: &Ring, base_m: f64) -> Option<f64> {
    let is_along = |slope: f64| slope.abs() > AHEAD || slope.abs() < BESIDE;
    if slopes.len() < MIN_SENSORS || !slopes.iter().all(|(_, slope)| is_along(*slope)) {
        return None;
    }
    let sign = if turn.signs == [false, true] { 1.0 } else { -1.0 };
    let heading = |length_m: f64| sign * 2.0 * length_m / base_m;
    let mut found: Vec<(f64, f64)> = Vec::new();
    for (sensor, mounting) in ring.mountings.iter().enumerate() {
        let readings: Vec<(f64, f64)> = turn
            .sweeps
            .iter()
            .filter_map(|(length_m, ranges)| Some((heading(*length_m), *ranges.get(sensor)?)))
            .collect();
        for faced_rad in faced(&readings, mounting.half_angle_rad) {
            // The normal is where the sensor looks: heading + bearing + turn = a multiple of a quarter.
            found.push((faced_rad, quarter(-faced_rad - mounting.robot_from_sensor.theta_rad)));
        }
    }
    settle(&found)
}

/// The headings at which a wall is faced: the middles of the readings around each least range. Where the turn begins or ends within them, the other
/// edge tells, with the cone's half angle.
fn faced(readings: &[(f64, f64)], half_angle_rad: f64) -> Vec<f64> {
    let mut middles = Vec::new();
    let mut start = 0;
    while let Some((_, from)) = readings.get(start) {
        // A stretch of readings that are all within the tolerance of its least one.
        let (mut end, mut least, mut most) = (start, *from, *from);
        while let Some((_, range)) = readings.get(end + 1) {
            let (low, high) = (least.min(*range), most.max(*range));
            if !high.is_finite() || high - low > FACED_M {
                break;
            }
            (least, most, end) = (low, high, end + 1);
        }
        let (first, last) = (readings.get(start), readings.get(end));
        if let (Some((first, _)), Some((last, _))) = (first, last)
            && least.is_finite()
            && end - start + 1 >= MIN_READINGS
            && (last - first).abs() < MAX_WIDTH_RAD
        {
            let before = start.checked_sub(1).and_then(|index| readings.get(index));
            let after = readings.get(end + 1);
            // From the wall's normal to the edge.
            let reach_rad = (half_angle_rad + libm::acos(least / (least + FACED_M))) * (last - first).signum();
            let is_more = |beside: &&(f64, f64)| beside.1 > most;
            let edge = |inside: f64, beside: &(f64, f64)| 0.5 * (inside + beside.0);
            middles.extend(match (before.filter(is_more), after.filter(is_more)) {
                (Some(before), Some(after)) => Some(0.5 * (edge(*first, before) + edge(*last, after))),
                (None, Some(after)) if before.is_none() => Some(edge(*last, after) - reach_rad),
                (Some(before), None) if after.is_none() => Some(edge(*first, before) + reach_rad),
                _ => None,
            });
        }
        start = end + 1;
    }
    middles
}

/// The turn at heading zero: the wheels may count a turn of another size, which shows as a slope over the heading.
fn settle(found: &[(f64, f64)]) -> Option<f64> {
    let headings = || found.iter().map(|(heading, _)| *heading);
    let span_rad = headings().fold(f64::NEG_INFINITY, f64::max) - headings().fold(f64::INFINITY, f64::min);
    if found.len() < MIN_SENSORS || span_rad < MIN_SPAN_RAD {
        return None;
    }
    // Angles modulo a quarter turn: beside the one that most agree with.
    let near = |middle: f64| {
        let mut apart: Vec<f64> = found.iter().map(|(_, turn)| quarter(turn - middle).abs()).collect();
        apart.sort_by(f64::total_cmp);
        apart.get(apart.len() / 2).copied().unwrap_or(f64::MAX)
    };
    let middle = found.iter().map(|(_, turn)| *turn).min_by(|a, b| near(*a).total_cmp(&near(*b)))?;
    let points: Vec<(f64, f64)> = found.iter().map(|(heading, turn)| (*heading, quarter(turn - middle))).collect();
    let count = points.len() as f64;
    let mean = |value: fn(&(f64, f64)) -> f64| points.iter().map(value).sum::<f64>() / count;
    let (h, t) = (mean(|point| point.0), mean(|point| point.1));
    let covariance: f64 = points.iter().map(|(heading, turn)| (heading - h) * (turn - t)).sum();
    let variance: f64 = points.iter().map(|(heading, _)| (heading - h) * (heading - h)).sum();
    let slope = covariance / variance.max(1e-9);
    let residual = points.iter().map(|(heading, turn)| (turn - t - slope * (heading - h)).powi(2)).sum::<f64>();
    (slope.abs() < MAX_SCALE_ERROR && (residual / count).sqrt() < MAX_RESIDUAL_RAD)
        .then(|| quarter(middle + t - slope * h))
}

/// An angle modulo a quarter turn, from −45 to 45 degrees.
fn quarter(angle_rad: f64) -> f64 {
    wrap_angle(4.0 * angle_rad) / 4.0
}
