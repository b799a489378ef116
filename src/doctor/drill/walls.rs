//! What the walls show in a drill: direction and speed of the push, and which way the robot turned.

use super::{Leg, MIN_LEG_M, MIN_TURN_RAD};
use slamd_core::wrap_angle;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Slopes of walls ahead and behind, or of two sensors ahead, that agree: least ratio.
const MIN_AGREEMENT: f64 = 0.75;
/// A slope of range over travel that is one, its largest residual, metres, and its least number of readings.
const MIN_SLOPE: f64 = 0.15;
const MAX_RESIDUAL_M: f64 = 0.03;
const MIN_READINGS: usize = 5;
/// Sensors within this angle of the direction of travel, or of its opposite, tell the scale.
const ALONG_RAD: f64 = 0.44;
/// Ratio of the costs of both directions of turning that decides, and the cost of a reading where another has no echo, metres.
const MAX_COST_RATIO: f64 = 0.75;
const MAX_COST_M: f64 = 0.5;

/// Slope of range over travel; none if the readings are no line.
pub(super) fn slope(readings: impl Iterator<Item = (f64, f64)>) -> Option<f64> {
    let readings: Vec<(f64, f64)> = readings.filter(|(_, range)| range.is_finite()).collect();
    let count = readings.len() as f64;
    let (first, last) = (readings.first()?, readings.last()?);
    if readings.len() < MIN_READINGS || last.0 - first.0 < MIN_LEG_M {
        return None;
    }
    let mean = |value: fn(&(f64, f64)) -> f64| readings.iter().map(value).sum::<f64>() / count;
    let (s, r) = (mean(|reading| reading.0), mean(|reading| reading.1));
    let covariance: f64 = readings.iter().map(|(travel, range)| (travel - s) * (range - r)).sum();
    let variance: f64 = readings.iter().map(|(travel, _)| (travel - s) * (travel - s)).sum();
    let slope = covariance / variance.max(1e-9);
    let residual = readings.iter().map(|(travel, range)| (range - r - slope * (travel - s)).powi(2)).sum::<f64>();
    ((residual / count).sqrt() < MAX_RESIDUAL_M).then_some(slope)
}

/// Direction in which walls approach, from bearings and slopes.
pub(super) fn direction(slopes: &[(f64, f64)]) -> Option<f64> {
    let steep: Vec<&(f64, f64)> = slopes.iter().filter(|(_, slope)| slope.abs() > MIN_SLOPE).collect();
    let sum = |part: fn(f64) -> f64| steep.iter().map(|(bearing, slope)| -slope * part(*bearing)).sum::<f64>();
    let (x, y) = (sum(libm::cos), sum(libm::sin));
    let length: f64 = steep.iter().map(|(_, slope)| slope.abs()).sum();
    (length > 0.0 && libm::hypot(x, y) > 0.6 * length).then(|| libm::atan2(y, x))
}

/// True if two sensors tell the same speed: one ahead and one behind, or two in about the same direction.
pub(super) fn is_supported(slopes: &[(f64, f64)], towards_rad: f64) -> bool {
    let along = |sign: f64| {
        let is_there = move |(bearing, slope): &&(f64, f64)| {
            let apart = wrap_angle(bearing - towards_rad).abs();
            (if sign < 0.0 { apart < ALONG_RAD } else { apart > PI - ALONG_RAD }) && slope * sign > MIN_SLOPE
        };
        slopes.iter().filter(is_there).map(|(_, slope)| slope.abs()).collect::<Vec<f64>>()
    };
    let (ahead, behind) = (along(-1.0), along(1.0));
    let agree = |a: f64, b: f64| a.min(b) > MIN_AGREEMENT * a.max(b);
    let pairs = |a: &[f64], b: &[f64]| a.iter().any(|a| b.iter().any(|b| agree(*a, *b)));
    pairs(&ahead, &behind) || ahead.len() > 1 && ahead.windows(2).any(|pair| matches!(pair, [a, b] if agree(*a, *b)))
}

/// Median slope of the sensors along the direction of travel.
pub(super) fn scale(slopes: &[(f64, f64)], towards_rad: f64) -> Option<f64> {
    let is_along = |bearing: f64| {
        let apart = wrap_angle(bearing - towards_rad).abs();
        !(ALONG_RAD..=PI - ALONG_RAD).contains(&apart)
    };
    let mut along: Vec<f64> =
        slopes.iter().filter(|(b, slope)| is_along(*b) && slope.abs() > MIN_SLOPE).map(|(_, s)| s.abs()).collect();
    along.sort_by(f64::total_cmp);
    along.get(along.len() / 2).copied()
}

/// Whether the profile of ranges turns as in a left turn. The ring sees a profile that turns the other way.
pub(super) fn turns_left(leg: &Leg, bearings: &[f64], base_m: f64) -> Option<bool> {
    let counted_rad = |length_m: f64| 2.0 * length_m / base_m;
    if counted_rad(leg.length_m()) < MIN_TURN_RAD || bearings.len() < 3 {
        return None;
    }
    let (_, start) = leg.sweeps.iter().find(|(_, ranges)| ranges.len() == bearings.len())?;
    let mut profile: Vec<(f64, f64)> =
        bearings.iter().map(|bearing| bearing.rem_euclid(TAU)).zip(start.iter().map(|range| capped(*range))).collect();
    profile.sort_by(|a, b| a.0.total_cmp(&b.0));
    let cost = |gain: f64| {
        let mut sum = (0.0, 1e-9);
        for (length_m, ranges) in &leg.sweeps {
            let turned_rad = gain * counted_rad(*length_m);
            for (bearing, range) in bearings.iter().zip(ranges) {
                let Some(expected) = interpolated(&profile, bearing + turned_rad) else { continue };
                let range = capped(*range);
                if range.is_finite() && expected.is_finite() {
                    sum = (sum.0 + (range - expected).abs().min(MAX_COST_M), sum.1 + 1.0);
                }
            }
        }
        sum.0 / sum.1
    };
    // The scale of turning is not known: the wheels may count several times too much.
    let best = |sign: f64| {
        [0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8].map(|gain| cost(sign * gain)).into_iter().fold(f64::MAX, f64::min)
    };
    let (left, right) = (best(1.0), best(-1.0));
    if left < MAX_COST_RATIO * right {
        Some(true)
    } else if right < MAX_COST_RATIO * left {
        Some(false)
    } else {
        None
    }
}

/// A range with "nothing in range" as a far wall.
fn capped(range_m: f64) -> f64 {
    if range_m == f64::INFINITY {
        4.0
    } else if range_m == f64::NEG_INFINITY {
        0.0
    } else {
        range_m
    }
}

/// The profile between its two nearest sensors.
fn interpolated(profile: &[(f64, f64)], bearing: f64) -> Option<f64> {
    let bearing = bearing.rem_euclid(TAU);
    let next = profile.iter().position(|(at, _)| *at > bearing).unwrap_or(0);
    let before = profile.get((next + profile.len() - 1) % profile.len())?;
    let after = profile.get(next)?;
    let gap = (after.0 - before.0).rem_euclid(TAU).max(1e-9);
    if gap > FRAC_PI_2 + 0.1 {
        return None;
    }
    let share = (bearing - before.0).rem_euclid(TAU) / gap;
    Some(before.1 + share * (after.1 - before.1))
}
