//! Fits one sensor's readings to the walls that they are associated with: least squares with Cauchy weights.

use super::Estimated;
use super::drive::Drive;
use nalgebra::{Matrix3, Vector3};
use slamd_core::{
    SensorState,
    saved_state::LandmarkState,
    stages::{BeamParams, observe_wall},
};

/// Number of parameters: range bias, bearing offset, error of the half angle.
const UNKNOWNS: usize = 3;

/// One reading of a wall: measured − expected distance, and its Jacobian by the parameters.
#[derive(Clone, Copy)]
struct Row {
    residual_m: f64,
    jacobian: Vector3<f64>,
    part: usize,
}

/// One sensor's result of one pass.
#[derive(Clone, Copy, Default)]
pub(super) struct Step {
    pub(super) range_bias_m: Option<Estimated>,
    pub(super) bearing_offset_rad: Option<Estimated>,
}

/// Largest residual for an association with a wall, metres.
const GATE_M: f64 = 0.2;
/// Scale of the Cauchy weights: the weight of a reading falls to half at this residual, metres.
const CAUCHY_M: f64 = 0.03;
/// Prior standard deviations of the parameters: metres, radians, radians.
const PRIOR: [f64; UNKNOWNS] = [0.05, 0.09, 0.09];
/// Least number of hits of a wall, and least distance of a reading from the wall's ends, metres.
const MIN_HITS: u32 = 40;
const INSIDE_M: f64 = 0.05;
/// Parts of the drive for the jackknife.
const PARTS: usize = 8;
const MIN_ROWS: usize = 60;
/// Largest standard deviation of a result: metres, radians.
const MAX_SIGMA_M: f64 = 0.008;
const MAX_SIGMA_RAD: f64 = 0.75 * std::f64::consts::PI / 180.0;

/// Fits every sensor.
pub(super) fn fit(drive: &Drive) -> Vec<Step> {
    let sensors = drive.steps.first().map_or(0, |(sweep, _)| sweep.beams.len());
    let is_healthy = |sensor: usize| drive.states.get(sensor) == Some(&SensorState::Healthy);
    (0..sensors)
        .map(|sensor| if is_healthy(sensor) { fit_sensor(&rows(drive, sensor)) } else { Step::default() })
        .collect()
}

/// Root mean square of measured − expected; NaN if the sensor has no reading of a wall.
pub(super) fn rms_m(drive: &Drive, sensor: usize) -> f64 {
    let rows = rows(drive, sensor);
    (rows.iter().map(|row| row.residual_m * row.residual_m).sum::<f64>() / rows.len() as f64).sqrt()
}

/// The same of all sensors together.
pub(super) fn ring_rms_m(drive: &Drive) -> f64 {
    let rows: Vec<Row> = (0..drive.bearings_rad.len()).flat_map(|sensor| rows(drive, sensor)).collect();
    (rows.iter().map(|row| row.residual_m * row.residual_m).sum::<f64>() / rows.len() as f64).sqrt()
}

fn rows(drive: &Drive, sensor: usize) -> Vec<Row> {
    let (mut rows, params) = (Vec::new(), BeamParams::default());
    for (step, (sweep, pose)) in drive.steps.iter().enumerate() {
        let observe = |beam| observe_wall(&params, *pose, beam);
        let Some(observation) = sweep.beams.get(sensor).and_then(observe) else { continue };
        let sign = observation.side.sign();
        let residual = |offset_m: f64| observation.depth_m - sign * (offset_m - observation.sensor_across_m);
        let is_candidate = |wall: &LandmarkState, offset_m: f64| {
            wall.side == observation.side.index()
                && wall.hits >= MIN_HITS
                && (wall.lo_m + INSIDE_M..=wall.hi_m - INSIDE_M).contains(&observation.along_m)
                && residual(offset_m).abs() < GATE_M
        };
        // Of several candidates the wall with most hits: a sensor with a range bias may have initialized a wall of its own.
        let candidates = drive.walls.iter().filter(|(wall, offset_m)| is_candidate(wall, *offset_m));
        let Some((_, offset_m)) = candidates.max_by_key(|(wall, _)| wall.hits) else { continue };
        let tangent = if observation.side.axis() == 0 { sign } else { -sign };
        let lateral_m = tangent * (observation.along_m - observation.sensor_along_m);
        rows.push(Row {
            residual_m: residual(*offset_m),
            jacobian: Vector3::new(libm::cos(observation.oblique_rad), lateral_m, -lateral_m.abs()),
            part: step * PARTS / drive.steps.len(),
        });
    }
    rows
}

fn fit_sensor(rows: &[Row]) -> Step {
    if rows.len() < MIN_ROWS {
        return Step::default();
    }
    let bearing = estimate(rows, 1, true).filter(|found| found.sigma <= MAX_SIGMA_RAD);
    let bias = estimate(rows, 0, bearing.is_some()).filter(|found| found.sigma <= MAX_SIGMA_M);
    Step { range_bias_m: bias, bearing_offset_rad: bearing }
}

/// One parameter with its standard deviation: the larger of the least squares' and the jackknife's.
fn estimate(rows: &[Row], unknown: usize, with_bearing: bool) -> Option<Estimated> {
    let (x, covariance) = solve(rows.iter(), with_bearing)?;
    let mut without = Vec::with_capacity(PARTS);
    for part in 0..PARTS {
        without.push(solve(rows.iter().filter(|row| row.part != part), with_bearing)?.0[unknown]);
    }
    let mean = without.iter().sum::<f64>() / PARTS as f64;
    // Tukey's jackknife: the parts are independent, the readings within them are not.
    let scatter = without.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
    let jackknife = (scatter * (PARTS - 1) as f64 / PARTS as f64).sqrt();
    Some(Estimated { value: x[unknown], sigma: covariance[(unknown, unknown)].sqrt().max(jackknife) })
}

/// The parameters and their covariance; without `with_bearing` the bearing offset is held at 0.
fn solve<'a>(rows: impl Iterator<Item = &'a Row> + Clone, with_bearing: bool) -> Option<(Vector3<f64>, Matrix3<f64>)> {
    let noise = CAUCHY_M * CAUCHY_M;
    let mut prior = PRIOR;
    if !with_bearing {
        prior[1] = 1e-6;
    }
    let prior = Matrix3::from_diagonal(&Vector3::from(prior.map(|sigma| 1.0 / (sigma * sigma))));
    let (mut x, mut covariance) = (Vector3::zeros(), Matrix3::zeros());
    for _ in 0..ITERATIONS {
        let (mut information, mut vector) = (prior, Vector3::zeros());
        for row in rows.clone() {
            let left_m = row.residual_m - row.jacobian.dot(&x);
            let weight = 1.0 / (noise + left_m * left_m);
            information += row.jacobian * row.jacobian.transpose() * weight;
            vector += row.jacobian * (row.residual_m * weight);
        }
        covariance = information.try_inverse()?;
        x = covariance * vector;
    }
    Some((x, covariance))
}

/// Iterations of the reweighted least squares; the weights have converged by then.
const ITERATIONS: usize = 8;
