//! Calibration from a drive that is over: what each sensor reads too long, and how far it is turned from its drawing.
//!
//! The walls method maps the drive; then each sensor's readings are compared with the walls it heard:
//!
//! `measured − expected = b cos(eps) + a r sin(eps) s − h r sin(eps)`
//!
//! b is the range bias, a the bearing offset, h an error of the cone's half angle, eps how far the wall's normal lies outside the
//! cone on its side s = ±1 ([`slamd_core::position::beam_model`]). Least squares with Cauchy's weights find b, a and h per sensor. With the
//! corrections the drive is mapped anew, and what is left is estimated again ([`PASSES`] times), because a map drawn by
//! wrong sensors is a little wrong itself.
//!
//! **What a drive cannot tell.** A bias of all sensors alike looks like a larger room, one that goes round the ring as a cosine like a
//! ring that sits elsewhere on the robot, and a turn of all alike like another heading: these are taken out. What was found of less
//! than half the ring is dropped, for what a few sensors have in common cannot be told from what is each one's own.
//! A cone that holds the normal hears the same distance wherever it looks, so a bearing shows only at the cone's edge. Each estimate
//! carries a standard deviation, the greater of the least squares' own and that of eight parts of the drive left out in turn; one
//! that is too large is no estimate.

pub mod drive;
mod fit;

use drive::Drive;
use nalgebra::{Matrix3, Vector3};
use slamd_core::{Calibration, Config, config::CorrectionConfig};
use slamd_metrics::Accuracy;

/// How often the drive is mapped and fitted; once more it is mapped to see what has been gained.
pub const PASSES: usize = 3;

/// One number found, with its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimated {
    /// The number.
    pub value: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

/// What was found of one sensor; none where the drive holds too little about it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SensorResult {
    /// How much too long it reads, without what the ring has in common, metres.
    pub range_bias_m: Option<Estimated>,
    /// How far it is turned, without what the ring has in common, radians.
    pub bearing_offset_rad: Option<Estimated>,
    /// Root mean square of measured − expected distance before the corrections, metres; NaN where it heard no wall.
    pub before_m: f64,
    /// The same after them.
    pub after_m: f64,
}

/// What a drive has taught.
#[derive(Clone, Debug)]
pub struct Report {
    /// The configuration with everything that was learnt.
    pub config: Config,
    /// The wheels.
    pub wheels: Calibration,
    /// Each sensor.
    pub sensors: Vec<SensorResult>,
    /// Errors against the truth before and after, where the drive holds it.
    pub accuracy: Option<[Accuracy; 2]>,
}

/// A drive that cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CalibrateError {
    /// Nothing was mapped.
    #[error("the drive is too short: no sweep was placed in a map")]
    NoMap,
}

/// Calibrates. `mapped` maps the whole drive with a configuration.
///
/// # Errors
/// Where there is no map, and whatever `mapped` fails with.
pub fn calibrate<E: From<CalibrateError>>(
    config: &Config,
    mut mapped: impl FnMut(&Config, usize) -> Result<Drive, E>,
) -> Result<Report, E> {
    let mut learnt = config.clone();
    let mut first: Option<Drive> = None;
    let mut results: Vec<SensorResult> = Vec::new();
    for pass in 0..PASSES {
        let drive = mapped(&learnt, pass)?;
        if drive.steps.is_empty() {
            return Err(CalibrateError::NoMap.into());
        }
        let found = fit::fit(&drive);
        results.resize(found.len(), SensorResult::default());
        for (result, step) in results.iter_mut().zip(&found) {
            accumulate(&mut result.range_bias_m, step.range_bias_m);
            accumulate(&mut result.bearing_offset_rad, step.bearing_offset_rad);
        }
        let bearings_rad = drive.bearings_rad.as_slice();
        remove_common(&mut results, |result| &mut result.range_bias_m, |sensor| shift(bearings_rad[sensor]));
        remove_common(&mut results, |result| &mut result.bearing_offset_rad, |_| Vector3::new(1.0, 0.0, 0.0));
        learnt.ring.corrections = corrections(config, &results);
        first.get_or_insert(drive);
    }
    let after = mapped(&learnt, PASSES)?;
    let before = first.unwrap_or_default();
    for (sensor, result) in results.iter_mut().enumerate() {
        (result.before_m, result.after_m) = (fit::rms_m(&before, sensor), fit::rms_m(&after, sensor));
    }
    learnt.robot.set_wheels(&after.wheels);
    Ok(Report {
        config: learnt,
        wheels: after.wheels,
        sensors: results,
        accuracy: before.accuracy.zip(after.accuracy).map(|(before, after)| [before, after]),
    })
}

/// What a later pass finds comes on top, if it finds anything; its uncertainty is the present one.
fn accumulate(total: &mut Option<Estimated>, step: Option<Estimated>) {
    *total = match (*total, step) {
        (Some(total), Some(step)) => Some(Estimated { value: total.value + step.value, sigma: step.sigma }),
        (total, step) => step.or(total),
    };
}

/// Biases that cannot be told from a larger room and from a ring that sits elsewhere on the robot.
fn shift(bearing_rad: f64) -> Vector3<f64> {
    let (sin, cos) = libm::sincos(bearing_rad);
    Vector3::new(1.0, cos, sin)
}

/// Takes out what all sensors have in common: the least-squares mixture of the patterns. Nothing is left where too few were found.
fn remove_common(
    results: &mut [SensorResult],
    part: impl Fn(&mut SensorResult) -> &mut Option<Estimated>,
    patterns: impl Fn(usize) -> Vector3<f64>,
) {
    let found: usize = results.iter_mut().map(|result| usize::from(part(result).is_some())).sum();
    if 2 * found < results.len() {
        results.iter_mut().for_each(|result| *part(result) = None);
        return;
    }
    // So little keeps the patterns apart where sensors on one side alone were found, and shrinks nothing that counts.
    let (mut matrix, mut vector) = (Matrix3::identity() * 1e-6, Vector3::zeros());
    for (sensor, result) in results.iter_mut().enumerate() {
        if let Some(found) = part(result) {
            matrix += patterns(sensor) * patterns(sensor).transpose();
            vector += patterns(sensor) * found.value;
        }
    }
    let mixture = matrix.try_inverse().map_or_else(Vector3::zeros, |inverse| inverse * vector);
    for (sensor, result) in results.iter_mut().enumerate() {
        if let Some(found) = part(result) {
            found.value -= mixture.dot(&patterns(sensor));
        }
    }
}

/// The configuration's corrections with those found on top, rounded to what anybody could measure.
fn corrections(config: &Config, results: &[SensorResult]) -> Vec<CorrectionConfig> {
    let rounded = |value: f64, steps: f64| (steps * value).round() / steps;
    let sum = |sensor: usize, result: &SensorResult| {
        let id = u8::try_from(sensor).ok()?;
        let old = config.ring.corrections.iter().rfind(|correction| correction.sensor == id);
        let old = old.copied().unwrap_or(CorrectionConfig { sensor: id, range_bias_m: 0.0, bearing_offset_deg: 0.0 });
        let value = |found: Option<Estimated>| found.map_or(0.0, |found| found.value);
        let new = CorrectionConfig {
            sensor: id,
            range_bias_m: rounded(old.range_bias_m + value(result.range_bias_m), 1e4),
            bearing_offset_deg: rounded(old.bearing_offset_deg + value(result.bearing_offset_rad).to_degrees(), 1e2),
        };
        (new.range_bias_m.abs() + new.bearing_offset_deg.abs() > 0.0).then_some(new)
    };
    results.iter().enumerate().filter_map(|(sensor, result)| sum(sensor, result)).collect()
}
