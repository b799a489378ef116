//! Calibration from a recorded drive: the range bias and the bearing offset of each sensor.
//!
//! The walls method maps the drive; then each sensor's readings are compared with the walls that they are associated with:
//!
//! `measured − expected = b cos(eps) + a r sin(eps) s − h r sin(eps)`
//!
//! b is the range bias, a the bearing offset, h an error of the cone's half angle, eps how far the wall's normal lies outside the
//! cone on its side s = ±1 (the beam model). Least squares with Cauchy weights estimate b, a and h per sensor. The
//! drive is then mapped again with the corrections and the remainder is estimated ([`PASSES`] times), because a map from biased sensors is
//! slightly wrong itself.
//!
//! **Not observable in a drive.** A bias that all sensors share looks like a larger room; a bias that varies around the ring as a cosine looks
//! like a shifted ring; a rotation of all sensors looks like another heading. These parts are removed. Results for less than half the ring
//! are dropped, because the common part of a few sensors cannot be separated from their individual parts. A cone that contains the wall's normal
//! measures the same distance in every direction, so a bearing offset is observable only at the cone's edge. Each estimate has a standard
//! deviation, the larger of the least squares' and a jackknife over eight parts of the drive; an estimate whose deviation is too large is
//! dropped.
//!
//! A robot that differs from its configuration is mended first, if the check of the robot is sure and the mended configuration maps the
//! drive without a finding. What a drive cannot tell ([`Unobservable`]) keeps its configured value. The results are kept only if the
//! readings fit the walls better with them.

pub mod drive;
mod fit;
mod mend;
mod verdict;

use drive::Drive;
use nalgebra::{Matrix3, Vector3};
use slamd_core::{Calibration, Config, config::CorrectionConfig};
use slamd_metrics::Accuracy;
pub use verdict::Unobservable;

/// Number of times that the drive is mapped and fitted; a last mapping measures the improvement.
pub const PASSES: usize = 3;

/// An estimate with its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimated {
    /// The estimate.
    pub value: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

/// The result for one sensor; none where the drive has too few readings.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SensorResult {
    /// Range bias without the ring's common part, metres; positive for a sensor that reads too long.
    pub range_bias_m: Option<Estimated>,
    /// Bearing offset without the ring's common part, radians.
    pub bearing_offset_rad: Option<Estimated>,
    /// Root mean square of measured − expected distance before the corrections, metres; NaN if it has no reading of a wall.
    pub before_m: f64,
    /// The same after them.
    pub after_m: f64,
}

/// Result of a calibration.
#[derive(Clone, Debug)]
pub struct Report {
    /// The configuration with all results.
    pub config: Config,
    /// The wheels.
    pub wheels: Calibration,
    /// Each sensor.
    pub sensors: Vec<SensorResult>,
    /// Errors against the true poses before and after, if the drive holds them.
    pub accuracy: Option<[Accuracy; 2]>,
    /// In what the robot differs from its configuration, one sentence each, and whether `config` is mended.
    pub findings: Vec<(String, bool)>,
    /// What the drive cannot tell.
    pub unobservable: Vec<Unobservable>,
    /// Root mean square of measured − expected distance over all sensors, before and after, metres; NaN without a reading of a wall.
    pub rms_m: [f64; 2],
    /// True if the readings fit the walls no worse with the results; else `config` is without them.
    pub is_better: bool,
}

/// Why a drive cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CalibrateError {
    /// Nothing was mapped.
    #[error("the drive is too short: no sweep has a pose")]
    NoMap,
}

/// Calibrates a robot; `mapped` maps the whole drive with a configuration.
///
/// # Errors
/// When there is no map, or when `mapped` fails.
pub fn calibrate<E: From<CalibrateError>>(
    config: &Config,
    mut mapped: impl FnMut(&Config, usize) -> Result<Drive, E>,
) -> Result<Report, E> {
    let first = mapped(config, 0)?;
    if first.steps.is_empty() {
        return Err(CalibrateError::NoMap.into());
    }
    let (begun, before, is_mended) = match mend::mended(config, &first) {
        None => (config.clone(), first.clone(), false),
        Some(mended) => {
            let drive = mapped(&mended, 0)?;
            let is_sure = drive.findings.is_empty() && !drive.is_uncertain && !drive.steps.is_empty();
            if is_sure { (mended, drive, true) } else { (config.clone(), first.clone(), false) }
        }
    };
    let findings = first.findings.iter().map(|event| (event.sentence(), is_mended)).collect();
    let unobservable = verdict::unobservable(&before);
    let mut calibrated = begun.clone();
    let mut drive = before.clone();
    let mut results: Vec<SensorResult> = Vec::new();
    for pass in 0..PASSES {
        if pass > 0 {
            drive = mapped(&calibrated, pass)?;
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
        calibrated.ring.corrections = corrections(&begun, &results);
    }
    // The wheels as found are tried, too: what is written is what was compared.
    let learnt = mapped(&calibrated, PASSES)?;
    let is_told = !unobservable.contains(&Unobservable::Wheels) && !before.is_uncertain;
    let after = if is_told {
        calibrated.robot.set_wheels(&learnt.wheels);
        mapped(&calibrated, PASSES)?
    } else {
        learnt.clone()
    };
    for (sensor, result) in results.iter_mut().enumerate() {
        (result.before_m, result.after_m) = (fit::rms_m(&before, sensor), fit::rms_m(&after, sensor));
    }
    let rms_m = [fit::ring_rms_m(&before), fit::ring_rms_m(&after)];
    let is_better = rms_m[1] <= rms_m[0] && after.findings.is_empty() && !after.is_uncertain;
    Ok(Report {
        config: if is_better { calibrated } else { begun },
        wheels: learnt.wheels,
        sensors: results,
        accuracy: before.accuracy.zip(after.accuracy).map(|(before, after)| [before, after]),
        findings,
        unobservable,
        rms_m,
        is_better,
    })
}

/// Adds the result of a later pass, if there is one; its uncertainty replaces the earlier one.
fn accumulate(total: &mut Option<Estimated>, step: Option<Estimated>) {
    *total = match (*total, step) {
        (Some(total), Some(step)) => Some(Estimated { value: total.value + step.value, sigma: step.sigma }),
        (total, step) => step.or(total),
    };
}

/// Patterns of bias that are not observable: of a larger room, and of a shifted ring.
fn shift(bearing_rad: f64) -> Vector3<f64> {
    let (sin, cos) = libm::sincos(bearing_rad);
    Vector3::new(1.0, cos, sin)
}

/// Removes the common part of all sensors: the least-squares combination of the patterns. Drops all results if there are too few.
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
    // This small term keeps the matrix invertible if only sensors on one side have results, and does not change the result noticeably.
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

/// The configuration's corrections plus the results, rounded to a measurable precision.
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
