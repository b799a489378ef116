//! A ring that is turned by less than sensors are apart: how the ranges change in the turn of the drill.
//!
//! After a push along a wall the walls' normals are at quarter turns. A sonar reads the least distance of a wall while the normal lies in its cone,
//! and more by the cosine beyond it. So each reading, its bearing by the wheels and the ring, and a supposed turn of the ring give the distance of a
//! wall from the axle; the turn of the ring for which the distances agree best is the right one, modulo a quarter.

use super::Leg;
use slamd_core::{Ring, wrap_angle};
use std::f64::consts::FRAC_PI_2;

/// Slopes of a push along or towards walls: of walls ahead and behind, and of walls beside it.
const AHEAD: f64 = 0.85;
const BESIDE: f64 = 0.2;
/// So many sensors tell the direction of the push.
const MIN_SENSORS: usize = 4;
/// Farther from a wall's normal, radians, smooth walls return no sound.
const MAX_OFF_NORMAL_RAD: f64 = 0.6;
/// Readings that are farther from their wall, metres, are of something else, and count as this.
const MAX_OFF_M: f64 = 0.15;
/// So many readings of a wall tell its distance, and so many in all the turn.
const MIN_OF_WALL: usize = 4;
const MIN_READINGS: usize = 40;
/// More readings tell nothing new.
const MAX_READINGS: usize = 1_500;
/// The turn must be of this size, radians: else few sensors pass from wall to wall.
const MIN_SPAN_RAD: f64 = 0.7;
/// The supposed turns of the ring, degrees: steps of the search, and around its best.
const COARSE_DEG: i32 = 3;
const MAX_DEG: i32 = 45;
/// The wheels may count a turn of another size: supposed factors.
const GAINS: [f64; 9] = [0.75, 0.8, 0.87, 0.93, 1.0, 1.07, 1.15, 1.23, 1.3];
/// The best cost must be below this, metres, and below this share of that of a ring that is not turned.
const MAX_COST_M: f64 = 0.055;
const MAX_COST_RATIO: f64 = 0.9;

/// A reading of the turn: heading by the wheels, the sensor's bearing, half its cone, its distance from the axle, and the range.
struct Reading {
    heading_rad: f64,
    bearing_rad: f64,
    half_angle_rad: f64,
    radius_m: f64,
    range_m: f64,
}

/// How far the ring is turned counter-clockwise, radians, from an eighth of a turn clockwise to an eighth counter-clockwise; none if the drill does
/// not tell. `slopes` are those of the push, by bearing.
pub(super) fn ring_turn(slopes: &[(f64, f64)], turn: &Leg, ring: &Ring, base_m: f64) -> Option<f64> {
    let along = slopes.iter().filter(|(_, slope)| slope.abs() > AHEAD || slope.abs() < BESIDE).count();
    // Where a corner passes a sensor, its slope is of no wall.
    if along < MIN_SENSORS || 4 * along < 3 * slopes.len() {
        return None;
    }
    let sign = if turn.signs == [false, true] { 1.0 } else { -1.0 };
    let mut readings = Vec::new();
    for (length_m, ranges) in &turn.sweeps {
        for (mounting, range_m) in ring.mountings.iter().zip(ranges).filter(|(_, range_m)| range_m.is_finite()) {
            readings.push(Reading {
                heading_rad: sign * 2.0 * length_m / base_m,
                bearing_rad: mounting.robot_from_sensor.theta_rad,
                half_angle_rad: mounting.half_angle_rad,
                radius_m: mounting.robot_from_sensor.position().coords.norm(),
                range_m: *range_m,
            });
        }
    }
    if 2.0 * turn.length_m() / base_m < MIN_SPAN_RAD {
        return None;
    }
    // Every so many of them: a long turn of a large ring has thousands.
    let stride = readings.len().div_ceil(MAX_READINGS).max(1);
    let readings: Vec<Reading> = readings.into_iter().step_by(stride).collect();
    let turns = |step: i32, around: i32, reach: i32| {
        (-reach / step..=reach / step).map(move |index| f64::from(around + step * index).to_radians())
    };
    let best = |turns: &mut dyn Iterator<Item = f64>| {
        let costs = turns.flat_map(|turn| GAINS.map(|gain| (turn, cost_m(&readings, turn, gain))));
        costs.filter_map(|(turn, cost)| Some((turn, cost?))).min_by(|a, b| a.1.total_cmp(&b.1))
    };
    let (coarse_rad, _) = best(&mut turns(COARSE_DEG, 0, MAX_DEG))?;
    #[expect(clippy::cast_possible_truncation, reason = "a whole number of degrees below 46")]
    let coarse_deg = coarse_rad.to_degrees().round() as i32;
    let (turned_rad, cost) = best(&mut turns(1, coarse_deg, COARSE_DEG))?;
    let (_, straight) = best(&mut std::iter::once(0.0))?;
    let turned_rad = if cost < MAX_COST_RATIO * straight { turned_rad } else { 0.0 };
    (cost < MAX_COST_M).then_some(turned_rad)
}

/// Mean distance of the readings from their walls, metres, with the ring and the wheels' turn supposed to be so; none if too few readings tell.
fn cost_m(readings: &[Reading], turned_rad: f64, gain: f64) -> Option<f64> {
    let mut walls: [Vec<f64>; 4] = std::array::from_fn(|_| Vec::new());
    for reading in readings {
        let looks_rad = wrap_angle(gain * reading.heading_rad + reading.bearing_rad + turned_rad);
        let quarter = (looks_rad / FRAC_PI_2).round();
        let off_rad = looks_rad - quarter * FRAC_PI_2;
        if off_rad.abs() > MAX_OFF_NORMAL_RAD {
            continue;
        }
        let slanted = libm::cos((off_rad.abs() - reading.half_angle_rad).max(0.0));
        let wall_m = reading.range_m * slanted + reading.radius_m * libm::cos(off_rad);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "it is from 0 to 3")]
        let wall = quarter.rem_euclid(4.0) as usize;
        walls.get_mut(wall).into_iter().for_each(|wall| wall.push(wall_m));
    }
    let (mut sum_m, mut count) = (0.0, 0);
    for wall in walls.iter_mut().filter(|wall| wall.len() >= MIN_OF_WALL) {
        wall.sort_by(f64::total_cmp);
        let middle_m = wall.get(wall.len() / 2).copied().unwrap_or_default();
        sum_m += wall.iter().map(|wall_m| (wall_m - middle_m).abs().min(MAX_OFF_M)).sum::<f64>();
        count += wall.len();
    }
    (count >= MIN_READINGS).then(|| sum_m / count as f64)
}
