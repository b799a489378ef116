//! `slamd setup` and ranges in another unit: the unit is named before the geometry is judged, and setup goes on with it.

#![allow(clippy::unwrap_used, reason = "a test may")]

use super::setup::{robot, set_up};
use slamd::doctor::Examination;
use slamd_capture::Record;
use slamd_core::{Config, Timestamp};

/// The scale of the ranges and the text that setup writes for this robot.
fn found(sensors: u8, faults: &[&str]) -> (f64, Config, String) {
    let (text, took_s) = set_up(&mut robot(sensors, faults), 300).unwrap_or_else(|error| panic!("{faults:?}: {error}"));
    println!("{faults:?} in {took_s:.0} s\n{text}");
    assert!(took_s < 120.0, "{faults:?}: {took_s} s");
    let config = Config::from_toml(&text).unwrap();
    (config.ring.range_scale, config, text)
}

#[test]
fn a_unit_is_named_and_its_scale_written() {
    for (unit, scale) in [("range-unit=cm", 10.0), ("range-unit=10", 0.1), ("range-unit=one-way", 2.0)] {
        for sensors in [8, 16] {
            let (found, config, text) = found(sensors, &[unit]);
            assert!((found / scale - 1.0).abs() < 1e-6, "{sensors} sensors, {unit}: {text}");
            assert!(text.contains("ring.range_scale corrects it"), "{text}");
            assert!((config.robot.wheel_base_m / 0.26 - 1.0).abs() < 0.05, "{text}");
        }
    }
}

#[test]
fn a_unit_hides_no_other_mistake() {
    let (scale, config, text) = found(8, &["range-unit=cm", "wheels-swapped", "ticks=2"]);
    assert!((scale - 10.0).abs() < 1e-6 && text.contains("wheels_swapped = true"), "{text}");
    assert!((f64::from(config.robot.ticks_per_turn.unwrap()) / 2880.0 - 1.0).abs() < 0.06, "{text}");
    let (scale, _, text) = found(16, &["range-unit=cm", "wheels-reversed"]);
    assert!((scale - 10.0).abs() < 1e-6 && text.contains("left_reversed = true"), "{text}");
    let (scale, config, text) = found(16, &["range-unit=cm", "base=1.6"]);
    assert!((scale - 10.0).abs() < 1e-6 && (config.robot.wheel_base_m / 0.416 - 1.0).abs() < 0.07, "{text}");
    let (scale, config, text) = found(16, &["range-unit=cm", "ring-rotated=90"]);
    assert!((scale - 10.0).abs() < 1e-6 && (config.ring.rotation_deg.abs() - 90.0).abs() < 1e-9, "{text}");
    let (scale, _, text) = found(16, &["range-unit=cm", "ring-mirrored"]);
    assert!((scale - 10.0).abs() < 1e-6 && text.contains("walls cannot tell"), "{text}");
    // A tenth of one-way times.
    let (scale, _, text) = found(16, &["range-unit=0.05"]);
    assert!((scale - 20.0).abs() < 1e-6, "{text}");
}

#[test]
fn the_doctor_names_the_unit_and_no_other_robot() {
    for (unit, scale, clause) in
        [("range-unit=cm", "10", "a tenth of what the way"), ("range-unit=10", "0.1", "as far as 8 to 11 m")]
    {
        let mut examination = Examination::new(&Config::default(), 115_200, "test");
        let mut simulation = robot(8, &[unit]);
        for now_us in (0..30_000_000).step_by(5_000) {
            let now = Timestamp::from_us(now_us);
            while let Some(record) = simulation.poll(now) {
                if let Record::Received { bytes, .. } = record {
                    examination.received(now, &bytes);
                }
            }
            examination.run_until(now);
            for frame in examination.take_transmit() {
                simulation.hear(now, &frame);
                examination.sent(now, &frame);
            }
        }
        let report = examination.report();
        let found = report.findings.iter().find(|finding| finding.id == "sensors.unit").unwrap();
        assert!(found.text.contains(clause), "\n{report}");
        assert!(found.fix.as_ref().unwrap().contains(&format!("ring.range_scale = {scale}")), "\n{report}");
        assert!(report.findings.iter().all(|finding| finding.id != "model.differs"), "\n{report}");
        // Ten times too long, most ranges do not fit the message: then the pose takes longer.
        let has_pose = examination.state().estimate().is_some();
        assert!(has_pose || unit == "range-unit=10", "it goes on with the right unit:\n{report}");
    }
}
