//! Biases and turns that the simulator puts into the sensors are found again, and nothing is claimed that cannot be.

#![allow(clippy::unwrap_used, reason = "a test may")]

use nalgebra::{Matrix3, Vector3};
use slamd::calibrate::drive::{Drive, Mapper};
use slamd::calibrate::{CalibrateError, Report, calibrate};
use slamd_core::Config;
use slamd_sim::misfit::Misfit;
use slamd_sim::simulation::{SimConfig, Simulation, session};
use slamd_sim::sonar::BeamShape;
use slamd_sim::world::World;

/// One standard deviation of what is put in.
const BIAS_M: f64 = 0.02;
const TURN_RAD: f64 = 2.0 * std::f64::consts::PI / 180.0;

fn calibrated(seed: u64, beam: BeamShape, duration_s: f64) -> (Report, Vec<Misfit>) {
    let simulation = || {
        Simulation::new(SimConfig { beam, ..SimConfig::usual(World::named("flat").unwrap(), seed, duration_s, 16) })
            .with_misfits(BIAS_M, TURN_RAD)
    };
    let records: Vec<_> = session(simulation()).collect();
    let report = calibrate(&Config::default(), |config, _| -> Result<Drive, CalibrateError> {
        let mut mapper = Mapper::new(config);
        records.iter().for_each(|record| mapper.take(record));
        Ok(mapper.finish())
    });
    (report.unwrap(), simulation().misfits().to_vec())
}

/// Errors of what was found, without what the ring has in common: the patterns' least-squares mixture over the sensors found.
fn errors(found: &[Option<f64>], truth: &[f64], pattern: impl Fn(f64) -> [f64; 3]) -> Vec<f64> {
    let sensors = found.len() as f64;
    let both = (0..found.len()).filter_map(|sensor| {
        let bearing_rad = std::f64::consts::TAU * sensor as f64 / sensors;
        Some((found[sensor]? - truth[sensor], Vector3::from(pattern(bearing_rad))))
    });
    let both: Vec<(f64, Vector3<f64>)> = both.collect();
    let matrix = both.iter().map(|(_, by)| by * by.transpose()).sum::<Matrix3<f64>>() + Matrix3::identity() * 1e-9;
    let vector: Vector3<f64> = both.iter().map(|(error, by)| by * *error).sum();
    let common = matrix.try_inverse().unwrap() * vector;
    both.iter().map(|(error, by)| (error - common.dot(by)).abs()).collect()
}

/// Greatest and root mean square.
fn summary(errors: &[f64]) -> (f64, f64) {
    let worst = errors.iter().copied().fold(0.0, f64::max);
    (worst, (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt())
}

#[test]
fn what_was_put_into_the_sensors_is_found() {
    for beam in [BeamShape::Cone, BeamShape::Point] {
        let (report, misfits) = calibrated(1, beam, 180.0);
        let biases: Vec<_> = report.sensors.iter().map(|s| s.range_bias_m.map(|found| found.value)).collect();
        let turns: Vec<_> = report.sensors.iter().map(|s| s.bearing_offset_rad.map(|found| found.value)).collect();
        let shift = |bearing: f64| [1.0, libm::cos(bearing), libm::sin(bearing)];
        let bias_errors = errors(&biases, &misfits.iter().map(|m| m.range_bias_m).collect::<Vec<_>>(), shift);
        let turns_true: Vec<_> = misfits.iter().map(|m| m.bearing_offset_rad).collect();
        let turn_errors = errors(&turns, &turns_true, |_| [1.0, 0.0, 0.0]);
        let ((bias_m, bias_rms_m), (turn_rad, turn_rms_rad)) = (summary(&bias_errors), summary(&turn_errors));
        let rms = |part: fn(&slamd::calibrate::SensorResult) -> f64| {
            summary(&report.sensors.iter().map(part).collect::<Vec<_>>()).1
        };
        let (before_m, after_m) = (rms(|s| s.before_m), rms(|s| s.after_m));
        println!(
            "{beam:?}: {} biases to {bias_m:.4} m ({bias_rms_m:.4} RMS), {} turns to {:.2} degrees ({:.2} RMS), \
             innovation {before_m:.4} to {after_m:.4} m, ATE {:?} m",
            bias_errors.len(),
            turn_errors.len(),
            turn_rad.to_degrees(),
            turn_rms_rad.to_degrees(),
            report.accuracy.unwrap().map(|accuracy| accuracy.ate_m),
        );
        assert!(bias_errors.len() >= 14 && bias_m < 0.012 && bias_rms_m < 0.006, "{bias_errors:?}");
        assert!(turn_errors.len() >= 9 && turn_rad < 2f64.to_radians() && turn_rms_rad < 1f64.to_radians());
        assert!(after_m < before_m, "{before_m} {after_m}");
    }
}

#[test]
fn a_drive_that_shows_too_little_claims_nothing() {
    let (report, ..) = calibrated(2, BeamShape::Cone, 12.0);
    assert!(report.sensors.iter().all(|sensor| sensor.bearing_offset_rad.is_none()), "{:?}", report.sensors);
    let found = report.sensors.iter().filter(|sensor| sensor.range_bias_m.is_some()).count();
    assert!(found < report.sensors.len(), "{found}");
}

#[test]
fn what_is_saved_is_read_back() {
    let (report, ..) = calibrated(3, BeamShape::Cone, 60.0);
    let text = report.config.to_toml_differences();
    let read = Config::from_toml(&text).unwrap();
    assert_eq!(read, report.config);
    let (saved, learnt) = (read.robot.wheels(), report.wheels);
    assert!(
        (saved.wheel_ratio - learnt.wheel_ratio).abs() < 1e-6
            && (saved.wheel_base_m - learnt.wheel_base_m).abs() < 1e-6
    );
    assert!((saved.wheel_ratio_sigma - learnt.wheel_ratio_sigma).abs() < 1e-6, "the uncertainty is saved, too");
    assert!(saved.wheel_ratio_sigma < 0.5 * Config::default().robot.wheel_ratio_sigma, "{text}");
}
