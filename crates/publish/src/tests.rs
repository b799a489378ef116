use super::*;
use nalgebra::Matrix3;
use slamd_core::{Estimate, FaultEvent, FaultKind, ModelAspect, ModelEvent, ModelFinding, ModelState, Point};
use std::fs;

/// A flat of three rooms with a path, an odometry that drifts off, and the truth.
fn run(folder: &Path) -> Summary {
    let mut outputs = Outputs::create(folder).unwrap();
    outputs.true_faults(vec!["7:saturated@5s".parse().unwrap()]);
    for k in 0..600u32 {
        let at = Timestamp::from_us(u64::from(k) * 100_000);
        let turn = f64::from(k) * 0.0157;
        let (sin, cos) = libm::sincos(turn);
        let truth = Pose2::new(1.2 + 3.2 * sin, 0.4 + 1.6 * libm::sin(2.0 * turn), turn);
        let pose = Pose2::new(truth.x_m + 0.04 * cos, truth.y_m + 0.03 * sin, turn + 0.01 * sin);
        let odometry = Pose2::new(0.0, 0.0, 0.0008 * f64::from(k)) * pose;
        outputs.truth(at, truth).unwrap();
        if k == 120 || k == 300 {
            let sensor = if k == 120 { 7 } else { 19 };
            let state = SensorState::Faulty(if k == 120 { FaultKind::Saturated } else { FaultKind::Noisy });
            outputs.event(&Event::Fault(FaultEvent { at, sensor, state, reason: String::new() }));
        }
        let covariance = Matrix3::zeros();
        outputs.event(&Event::Estimate(Estimate { at, sweep: u64::from(k), pose, covariance, odometry, nis: 1.0 }));
        outputs.timing(Duration::from_micros(u64::from(k % 50)));
    }
    let mut states = vec![SensorState::Healthy; 32];
    states[7] = SensorState::Faulty(FaultKind::Saturated);
    states[19] = SensorState::Faulty(FaultKind::Noisy);
    let state = FinalState {
        config: &Config::default(),
        raster: &flat(),
        ring: &Ring::circle(32, 0.15, 0.218, 4),
        states: &states,
        counters: Counters { frames: 2403, groups: 2400, sweeps: 600, crc_errors: 3, ..Counters::default() },
        calibration: None,
        walls: 4,
        waiting: None,
        ended: Timestamp::from_us(60_000_000),
    };
    outputs.finish(&state).unwrap()
}

fn flat() -> Raster {
    let (width, height, cell_m) = (240, 160, 0.05);
    let origin = Point::new(-4.0, -3.5);
    let cell = |index: usize| {
        let (x, y) = (origin.x + (index % width) as f64 * cell_m, origin.y + (index / width) as f64 * cell_m);
        let noise = (index * 7919 % 101) as f64 * 0.004;
        let inside = x > -2.6 + noise && x < 5.0 - noise && y > -2.0 + noise && y < 3.0 - noise;
        let outer = !(x > -2.5 && x < 4.9 && y > -1.9 && y < 2.9);
        let inner =
            (x - 1.2).abs() < 0.05 && !(-0.3..1.1).contains(&y) || (x - 3.0).abs() < 0.3 && (y - 2.0).abs() < 0.3;
        match (inside, outer || inner) {
            (false, _) => Raster::UNKNOWN,
            (true, true) => 70 + i8::try_from(index % 30).unwrap(),
            (true, false) => i8::try_from(index * 31 % 25).unwrap(),
        }
    };
    Raster { width, height, cell_m, origin, occupancy: (0..width * height).map(cell).collect() }
}

#[test]
fn a_run_leaves_whole_files_and_a_summary() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("new/out");
    let summary = run(&out);
    let mut names: Vec<_> =
        fs::read_dir(&out).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    let expected = "config.toml faults.csv lock.csv map.pgm map.png map.svg map.yaml odometry.tum summary.json trajectory.tum truth.tum";
    assert_eq!(names.join(" "), expected);
    let trajectory = fs::read_to_string(out.join("trajectory.tum")).unwrap();
    assert_eq!(trajectory.lines().count(), 600);
    assert_eq!(
        fs::read_to_string(out.join("faults.csv")).unwrap().lines().nth(1),
        Some("12.000000,7,faulty,saturated")
    );

    let json: serde_json::Value = serde_json::from_slice(&fs::read(out.join("summary.json")).unwrap()).unwrap();
    assert_eq!(json["sweeps"], 600);
    assert_eq!(json["trajectory_sha256"].as_str().unwrap().len(), 64);
    let ate_m = json["ate_m"].as_f64().unwrap();
    assert!(ate_m > 0.01 && ate_m < 0.1, "{ate_m}");
    assert!(
        summary.faults.unwrap().fault_recall.unwrap() > 0.8 && summary.faults.unwrap().fault_precision.unwrap() < 0.7
    );
    assert!((summary.p99_us_per_sweep.unwrap() - 49.0).abs() < 0.1);
}

/// Ends a run of so many seconds in the flat.
fn finish(outputs: Outputs, seconds: u64) -> Summary {
    let state = FinalState {
        config: &Config::default(),
        raster: &flat(),
        ring: &Ring::circle(8, 0.15, 0.218, 4),
        states: &[],
        counters: Counters { frames: 2403, groups: 2400, sweeps: 600, ..Counters::default() },
        calibration: None,
        walls: 4,
        waiting: None,
        ended: Timestamp::from_us(1_000_000 * seconds),
    };
    outputs.finish(&state).unwrap()
}

#[test]
fn the_plan_has_rooms_measures_and_what_is_doubtful() {
    let folder = tempfile::tempdir().unwrap();
    let mut outputs = Outputs::create(folder.path()).unwrap();
    let at = Timestamp::default();
    for step in 0..40u32 {
        let pose = Pose2::new(-1.5 + 0.1 * f64::from(step), 0.5, 0.0);
        let covariance = Matrix3::identity() * 4e-4;
        let at = Timestamp::from_us(u64::from(step) * 1_000_000);
        outputs.event(&Event::Estimate(Estimate { at, sweep: 1, pose, covariance, odometry: pose, nis: 1.0 }));
    }
    let finding = ModelFinding {
        aspect: ModelAspect::TurnSign,
        measured: -1.0,
        sigma: 0.0,
        clause: "the wheels turn the other way".into(),
        remedies: vec![("ring.mirrored", "true".into())],
    };
    outputs.event(&Event::Model(ModelEvent { at, since: at, finding, state: ModelState::Doubted }));
    let summary = finish(outputs, 40);
    // 7.4 m x 4.8 m without the wall in the middle, whose passage of 1.4 m is no door, a pillar, and what is behind it.
    assert!(matches!(summary.rooms_m2[..], [m2] if (30.0..35.5).contains(&m2)), "{:?}", summary.rooms_m2);
    // 2 cm each by the filter and beside it, and 2 % of 2.45 m, twice.
    assert!(summary.position_within_m.unwrap().iter().all(|m| (m - 0.1133).abs() < 1e-3), "{summary:?}");
    let svg = fs::read_to_string(folder.path().join("map.svg")).unwrap();
    for words in [
        "the wheels turn the other way",
        " m2 of floor in 1 room",
        "position within 11 cm (95 %)",
        "39 s, date unknown",
    ] {
        assert!(svg.contains(words), "no {words:?} in the plan");
    }
    let lengths: Vec<f64> =
        svg.split('>').filter_map(|text| text.strip_suffix(" m</text")?.parse().ok()).filter(|m| *m > 1.0).collect();
    assert!(lengths.iter().any(|m| (1.7..2.0).contains(m)), "the upper half of the wall in the middle: {lengths:?}");
}

#[test]
fn equal_runs_have_equal_hashes() {
    let folder = tempfile::tempdir().unwrap();
    let (a, b) = (run(&folder.path().join("a")), run(&folder.path().join("b")));
    assert_eq!((a.trajectory_sha256, a.map_sha256), (b.trajectory_sha256, b.map_sha256));
}

#[test]
fn without_truth_the_summary_has_no_errors() {
    let folder = tempfile::tempdir().unwrap();
    let state = FinalState {
        config: &Config::default(),
        raster: &Raster::default(),
        ring: &Ring::default(),
        states: &[],
        counters: Counters::default(),
        calibration: Some(Calibration { wheel_ratio: 1.01, wheel_base_m: 0.26, ..Calibration::default() }),
        walls: 0,
        waiting: None,
        ended: Timestamp::default(),
    };
    let text = Outputs::create(folder.path()).unwrap().finish(&state).unwrap().to_json();
    assert!(!text.contains("ate_m") && !text.contains("fault_") && text.contains("\"wheel_ratio\": 1.01"), "{text}");
    assert!(!folder.path().join("truth.tum").exists());
}

#[test]
fn a_folder_that_cannot_be_made_is_named() {
    let file = tempfile::NamedTempFile::new().unwrap();
    let error = Outputs::create(&file.path().join("out")).err().unwrap().to_string();
    assert!(error.contains("/out: "), "{error}");
}

#[test]
fn a_position_that_was_known_badly_is_doubtful() {
    let doubts = |variance: f64| {
        let folder = tempfile::tempdir().unwrap();
        let mut outputs = Outputs::create(folder.path()).unwrap();
        for step in 0..20u32 {
            let pose = Pose2::new(0.1 * f64::from(step), 0.5, 0.0);
            let covariance = Matrix3::identity() * if step == 10 { variance } else { 4e-4 };
            let at = Timestamp::from_us(u64::from(step) * 1_000_000);
            outputs.event(&Event::Estimate(Estimate { at, sweep: 1, pose, covariance, odometry: pose, nis: 1.0 }));
        }
        finish(outputs, 20).doubtful.join("; ")
    };
    assert_eq!(doubts(4e-4), "");
    let said = doubts(0.1156);
    assert!(said.contains("the position was known to within 68 cm only at worst, 10 cm at the end"), "{said}");
}
