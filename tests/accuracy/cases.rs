//! Robots that differ from their configuration, in a drive that a third party made: each is named with the value that mends it.
//!
//! The drives are looked for in `../shared/cases`; where they are absent the tests say so and pass.

#![expect(clippy::unwrap_used, reason = "a test")]

use crate::importing::{carmen_import, ring_import};
use slamd::calibrate::drive::{Drive, Mapper};
use slamd::calibrate::{CalibrateError, calibrate};
use slamd_capture::CaptureReader;
use slamd_core::{Config, Driver, Estimate, Event, ModelAspect, ModelEvent, ModelState, Pose2, Start, Update};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// What a drive said, and how far off it was.
struct Outcome {
    /// Each finding with the metres driven and the degrees turned before it.
    models: Vec<(ModelEvent, f64, f64)>,
    /// Root mean square error of the poses from two seconds after the first finding on, best aligned, metres.
    rms_m: f64,
    /// The same of the whole drive, with the poses that a correction revised.
    whole_rms_m: f64,
    /// The same of the encoders as configured.
    wheels_rms_m: f64,
    is_uncertain_at_end: bool,
    faults: usize,
}

fn shared(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/cases").join(name);
    if !path.exists() {
        println!("skipped: {} is absent", path.display());
    }
    Some(path).filter(|path| path.exists())
}

fn config(toml: &str, change: impl FnOnce(&mut Config)) -> Option<Config> {
    let mut config = Config::from_toml(&std::fs::read_to_string(shared(toml)?).unwrap()).unwrap();
    change(&mut config);
    Some(config)
}

/// True poses by the hundredth of a second.
fn truth(name: &str) -> Option<BTreeMap<i64, Pose2>> {
    let text = std::fs::read_to_string(shared(name)?).unwrap();
    let pose = |line: &str| {
        let numbers: Vec<f64> = line.split_whitespace().map(|word| word.parse().unwrap()).collect();
        (hundredths(numbers[0]), Pose2::new(numbers[1], numbers[2], numbers[3]))
    };
    Some(text.lines().map(pose).collect())
}

#[expect(clippy::cast_possible_truncation, reason = "some minutes")]
fn hundredths(seconds: f64) -> i64 {
    (100.0 * seconds).round() as i64
}

/// Root mean square distance of pairs after the best rigid motion, metres.
fn aligned_rms_m(pairs: &[(Pose2, Pose2)]) -> f64 {
    let n = pairs.len() as f64;
    let mean = |of: fn(&(Pose2, Pose2)) -> Pose2| {
        pairs.iter().map(|pair| of(pair).position().coords).sum::<nalgebra::Vector2<f64>>() / n
    };
    let (from, to) = (mean(|pair| pair.0), mean(|pair| pair.1));
    let centred = pairs.iter().map(|(a, b)| (a.position().coords - from, b.position().coords - to));
    let (dot, cross) = centred.clone().fold((0.0, 0.0), |(dot, cross), (a, b)| (dot + a.dot(&b), cross + a.perp(&b)));
    let turn = nalgebra::Rotation2::new(libm::atan2(cross, dot));
    (centred.map(|(a, b)| (turn * a - b).norm_squared()).sum::<f64>() / n).sqrt()
}

/// Drives a capture.
fn drive(capture: &Path, config: &Config, truth: &BTreeMap<i64, Pose2>) -> Outcome {
    let mut driver = Driver::new(slamd_paper::pipeline(config, Start::Fresh).unwrap());
    let (mut poses, mut wheels, mut models, mut faults) = (Vec::new(), BTreeMap::new(), Vec::new(), 0);
    let mut is_uncertain = false;
    let so_far = |until: i64| {
        let steps = truth.range(..=until).zip(truth.range(..=until).skip(1));
        steps.fold((0.0, 0.0), |(way_m, turned), ((_, a), (_, b))| {
            let step = a.inverse() * *b;
            (way_m + step.position().coords.norm(), turned + step.theta_rad.abs().to_degrees())
        })
    };
    for record in CaptureReader::open(capture).unwrap() {
        driver.feed(&record.unwrap(), |_, update| match update {
            Update::Event(Event::Estimate(estimate)) => {
                let at = hundredths(estimate.at.seconds());
                if let Some(truth) = truth.get(&at) {
                    poses.push((at, estimate.pose, *truth));
                    wheels.entry(at).or_insert((estimate.odometry, *truth));
                }
            }
            Update::Event(Event::Revised { poses: revised, .. }) => {
                let at = |estimate: &Estimate| hundredths(estimate.at.seconds());
                poses = revised.iter().filter_map(|e| Some((at(e), e.pose, *truth.get(&at(e))?))).collect();
            }
            Update::Event(Event::Model(event)) => {
                let (way_m, turned_deg) = so_far(hundredths(event.at.seconds()));
                models.push((event.clone(), way_m, turned_deg));
            }
            Update::Event(Event::Localization(event)) => is_uncertain = event.is_lost(),
            Update::Event(Event::Fault(_)) => faults += 1,
            _ => {}
        });
    }
    let from = models.first().map_or(0, |(event, ..)| hundredths(event.at.seconds()) + 200);
    let until = models.first().map_or(i64::MAX, |(event, ..)| hundredths(event.at.seconds()));
    let whole: Vec<_> = poses.iter().map(|(_, pose, truth)| (*pose, *truth)).collect();
    let later: Vec<_> = poses.iter().filter(|(at, ..)| *at >= from).map(|(_, pose, truth)| (*pose, *truth)).collect();
    let before: Vec<_> = wheels.range(..until).map(|(_, pair)| *pair).collect();
    Outcome {
        rms_m: aligned_rms_m(&later),
        whole_rms_m: aligned_rms_m(&whole),
        wheels_rms_m: aligned_rms_m(&before),
        models,
        is_uncertain_at_end: is_uncertain,
        faults,
    }
}

/// Drives a case of 16 sensors with another configuration than its robot's.
fn case16(csv: &str, change: impl FnOnce(&mut Config)) -> Option<Outcome> {
    let (wrong, truth) = (config("ring16.toml", change)?, truth("base16.truth")?);
    let (folder, csv) = (tempfile::tempdir().unwrap(), std::fs::read(shared(csv)?).unwrap());
    let capture = folder.path().join("case.mcap");
    ring_import(&csv, "case.csv", &wrong, &capture).unwrap();
    Some(drive(&capture, &wrong, &truth))
}

/// The first finding names the cause and mends it with nearly the true value, before a full turn, and the poses after it are right.
fn assert_mended(outcome: &Outcome, aspect: ModelAspect, key: &str, value: f64, within: f64) {
    let (event, way_m, turned_deg) = &outcome.models[0];
    println!("{:.2} m, {turned_deg:.0} degrees: {}; then {:.3} m", way_m, event.sentence(), outcome.rms_m);
    assert_eq!((event.finding.aspect, event.state), (aspect, ModelState::Corrected), "{}", event.sentence());
    let named = event.finding.remedies.iter().find(|(named, _)| *named == key).unwrap();
    let found: f64 = named.1.parse().unwrap();
    assert!((found - value).abs() <= within, "{key} = {found}, not {value}");
    assert!(*turned_deg < 360.0, "{turned_deg}");
    assert!(outcome.rms_m < 0.05, "{} m", outcome.rms_m);
    assert!(outcome.whole_rms_m < 0.05, "{} m with the revised poses", outcome.whole_rms_m);
    assert!(!outcome.is_uncertain_at_end);
}

#[test]
fn a_robot_as_configured_is_not_doubted() {
    let Some(outcome) = case16("base16.csv", |_| {}) else { return };
    assert!(outcome.models.is_empty() && !outcome.is_uncertain_at_end && outcome.rms_m < 0.01, "{}", outcome.rms_m);
}

#[test]
fn swapped_wheels_are_named_and_followed() {
    let Some(outcome) = case16("19-mirrored/swapped.csv", |_| {}) else { return };
    let (event, _, turned_deg) = &outcome.models[0];
    assert_eq!((event.finding.aspect, event.state), (ModelAspect::TurnSign, ModelState::Doubted));
    let keys: Vec<_> = event.finding.remedies.iter().map(|(key, _)| *key).collect();
    assert_eq!(keys, ["board.wheels_swapped", "ring.mirrored"]);
    assert!(*turned_deg < 720.0 && outcome.is_uncertain_at_end, "{turned_deg}");
}

#[test]
fn a_mirrored_ring_is_named_and_the_wheels_are_followed() {
    let Some(outcome) = case16("base16.csv", |config| config.ring.mirrored = true) else { return };
    assert_eq!(outcome.models[0].0.finding.aspect, ModelAspect::TurnSign);
    assert!(outcome.models[0].2 < 360.0 && outcome.is_uncertain_at_end);
    assert!(outcome.rms_m < 0.05, "{} m", outcome.rms_m);
}

#[test]
fn four_times_the_ticks_are_mended() {
    let Some(outcome) = case16("20-ticks-per-turn/times4.csv", |_| {}) else { return };
    assert_mended(&outcome, ModelAspect::WheelScale, "robot.ticks_per_turn", 5760.0, 0.05 * 5760.0);
}

#[test]
fn other_ticks_are_mended() {
    for ticks in [360, 720, 1200, 2880, 5760] {
        let Some(outcome) = case16("base16.csv", |config| config.robot.ticks_per_turn = Some(ticks)) else { return };
        assert_mended(&outcome, ModelAspect::WheelScale, "robot.ticks_per_turn", 1440.0, 0.06 * 1440.0);
    }
}

#[test]
fn a_skid_steer_is_mended() {
    for base_m in [0.14, 0.16, 0.2, 0.42, 0.5] {
        let Some(outcome) = case16("base16.csv", |config| config.robot.wheel_base_m = base_m) else { return };
        // The filter may learn the base before the check finds it.
        if outcome.models.is_empty() {
            assert!(outcome.rms_m < 0.05, "{base_m}: {} m, of the wheels {} m", outcome.rms_m, outcome.wheels_rms_m);
        } else {
            assert_mended(&outcome, ModelAspect::TurnScale, "robot.wheel_base_m", 0.26, 0.02);
        }
    }
}

#[test]
fn a_turned_ring_is_mended() {
    for turned in [45.0, 90.0, -135.0, 180.0] {
        let Some(outcome) = case16("base16.csv", |config| config.ring.rotation_deg = turned) else { return };
        assert_mended(&outcome, ModelAspect::RingRotation, "ring.rotation_deg", 0.0, 3.0);
    }
}

#[test]
fn another_unit_of_the_ranges_is_mended() {
    let Some(outcome) = case16("base16.csv", |config| config.ring.range_scale = 0.5) else { return };
    assert_mended(&outcome, ModelAspect::RangeScale, "ring.range_scale", 1.0, 0.01);
}

#[test]
fn readings_that_scatter_do_not_mislead_the_wheels() {
    let (Some(config), Some(truth)) = (
        config("22-readings-that-scatter-by-5-cm/robot.toml", |_| {}),
        truth("22-readings-that-scatter-by-5-cm/truth.txt"),
    ) else {
        return;
    };
    let csv = std::fs::read(shared("22-readings-that-scatter-by-5-cm/scatter.csv").unwrap()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let capture = folder.path().join("case.mcap");
    ring_import(&csv, "case.csv", &config, &capture).unwrap();
    let outcome = drive(&capture, &config, &truth);
    assert!(outcome.rms_m < 0.104, "{} m, of the wheels {} m", outcome.rms_m, outcome.wheels_rms_m);
}

#[test]
fn sound_sensors_that_scatter_are_not_called_faulty() {
    let folder = "25-third-party-room-12-sonars-1-Hz";
    let Some(config) = config(&format!("{folder}/robot.toml"), |_| {}) else { return };
    let log = std::fs::read(shared(&format!("{folder}/as_carmen.log")).unwrap()).unwrap();
    let temporary = tempfile::tempdir().unwrap();
    let capture = temporary.path().join("case.mcap");
    carmen_import(&log, "as_carmen.log", &config, &capture).unwrap();
    let outcome = drive(&capture, &config, &BTreeMap::new());
    assert_eq!((outcome.faults, outcome.models.len()), (0, 0));
}

#[test]
fn calibration_mends_four_times_the_ticks() {
    let Some(config) = config("ring16.toml", |_| {}) else { return };
    let csv = std::fs::read(shared("20-ticks-per-turn/times4.csv").unwrap()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let capture = folder.path().join("case.mcap");
    ring_import(&csv, "case.csv", &config, &capture).unwrap();
    let report = calibrate(&config, |config, _| -> Result<Drive, CalibrateError> {
        let mut mapper = Mapper::new(config);
        CaptureReader::open(&capture).unwrap().for_each(|record| mapper.take(&record.unwrap()));
        Ok(mapper.finish())
    });
    let report = report.unwrap();
    let ticks = report.config.robot.ticks_per_turn.unwrap();
    assert!((5500..6000).contains(&ticks), "{ticks}");
    assert!(report.findings[0].0.contains("robot.ticks_per_turn") && report.findings[0].1, "{:?}", report.findings);
    // Eight rounds to the left and none to the right.
    println!("{}; {:?}", report.verdict(), report.unobservable);
    assert!(report.verdict().starts_with("verdict: the configuration is mended; "), "{}", report.verdict());
}
