//! Recordings of real robots through import, inspect and the whole pipeline.
//!
//! The small inputs are made by hand. The real ones are looked for in `../shared/data`; where they are absent the test says so
//! and passes.

#![expect(clippy::unwrap_used, reason = "a test")]

use crate::importing::{carmen_import, ring_import};
use slamd::inspect::inspect;
use slamd_capture::CaptureReader;
use slamd_core::{Config, Driver, Event, Pose2, Update, wrap_angle};
use slamd_eval::import::{ImportError, Summary};
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

fn config(name: &str) -> Config {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs").join(name);
    Config::from_toml(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn data(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data").join(name);
    if !path.exists() {
        println!("skipped: {} is absent", path.display());
    }
    Some(path).filter(|path| path.exists())
}

/// What the pipeline makes of a capture: how many sweeps, the poses by filter and by encoders, how many sensor states.
struct Run {
    poses: Vec<Pose2>,
    odometry: Vec<Pose2>,
    sweeps: u64,
    states: usize,
}

fn run(capture: &Path, config: &Config) -> Run {
    let mut driver = Driver::new(slamd_paper::pipeline(config, slamd_core::Start::Fresh).unwrap());
    let (mut poses, mut odometry) = (Vec::new(), Vec::new());
    for record in CaptureReader::open(capture).unwrap() {
        driver.feed(&record.unwrap(), |_, update| {
            if let Update::Event(Event::Estimate(estimate)) = update {
                poses.push(estimate.pose);
                odometry.push(estimate.odometry);
            }
        });
    }
    let pipeline = driver.pipeline();
    let counters = pipeline.counters();
    assert_eq!((counters.crc_errors, counters.lost_frames, counters.refused), (0, 0, 0));
    Run { poses, odometry, sweeps: counters.sweeps, states: pipeline.states().len() }
}

/// A case of `../shared/cases`: a recording with the configuration of its robot.
fn case(recording: &str) -> Option<(Vec<u8>, Config)> {
    let path = data(&format!("../cases/{recording}"))?;
    let toml = std::fs::read_to_string(data("../cases/ring16.toml")?).unwrap();
    Some((std::fs::read(path).unwrap(), Config::from_toml(&toml).unwrap()))
}

#[test]
fn an_empty_cell_of_an_encoder_changes_nothing() {
    let (Some((whole, config)), Some((holed, _))) = (case("base16.csv"), case("05-empty-tick-cell/one_empty_cell.csv"))
    else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let capture = folder.path().join("case.mcap");
    let poses = |csv: &[u8]| {
        let summary = ring_import(csv, "case.csv", &config, &capture).unwrap();
        (run(&capture, &config).poses, summary.filled_ticks)
    };
    let ((whole, none), (holed, filled)) = (poses(&whole), poses(&holed));
    assert_eq!((none, filled, whole.len()), (0, 1, holed.len()));
    let apart_m = whole.iter().zip(&holed).map(|(a, b)| (a.position() - b.position()).norm()).fold(0.0, f64::max);
    assert!(apart_m < 0.01, "{apart_m} m");
}

#[test]
fn ranges_in_another_unit_are_refused() {
    for (unit, word) in [("cm", "centimetres?"), ("mm", "millimetres?"), ("us", "microseconds of flight")] {
        let Some((csv, config)) = case(&format!("08-ranges-in-cm-or-mm/{unit}.csv")) else { continue };
        let folder = tempfile::tempdir().unwrap();
        let capture = folder.path().join("case.mcap");
        let error = ring_import(csv.as_slice(), "case.csv", &config, &capture).unwrap_err().to_string();
        assert!(error.contains("no reading of ") && error.contains(word), "{error}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "a refused recording leaves no file");
    }
}

#[test]
fn sensors_that_answer_one_after_another_make_sweeps() {
    let Some((csv, config)) = case("12-one-sensor-per-row/robin.csv") else { return };
    let folder = tempfile::tempdir().unwrap();
    let capture = folder.path().join("case.mcap");
    let summary = ring_import(csv.as_slice(), "case.csv", &config, &capture).unwrap();
    assert_eq!((summary.rows, summary.collected), (3600, 225));
    let run = run(&capture, &config);
    assert_eq!((run.sweeps, run.states), (225, 16));
    assert!(extent(&run.poses).iter().all(|span_m| (1.0..5.0).contains(span_m)), "{:?}", extent(&run.poses));
}

#[test]
fn a_small_ring_that_takes_turns_keeps_each_time_and_count() {
    let folder = tempfile::tempdir().unwrap();
    let capture = folder.path().join("turns.mcap");
    let row = |k: usize, fill: &str| {
        let cell = |sensor| if k % 3 == sensor { "1.25" } else { fill };
        format!("{:.2},{},{},{},{},{}\n", 0.1 * k as f64, 3 * k, 2 * k, cell(0), cell(1), cell(2))
    };
    for fill in ["", "nan", "0", "-1"] {
        let rows: String = (0..12).map(|k| row(k, fill)).collect();
        let text = format!("t_s,left_ticks,right_ticks,r0,r1,r2\n{rows}");
        let summary = import_ring(&text, &capture).unwrap();
        assert_eq!((summary.rows, summary.collected), (12, 4), "{fill:?}");
        let report = inspect(&capture).unwrap();
        assert_eq!((report.frames["SONAR"].count, report.encoders[0].net_ticks), (12, 33), "{fill:?}");
        assert!(report.sensors.iter().all(|sensor| sensor.readings == 4), "{fill:?}");
    }
}

fn extent(poses: &[Pose2]) -> [f64; 2] {
    let span = |of: fn(&Pose2) -> f64| {
        let all = poses.iter().map(of);
        all.clone().fold(f64::NEG_INFINITY, f64::max) - all.fold(f64::INFINITY, f64::min)
    };
    [span(|pose| pose.x_m), span(|pose| pose.y_m)]
}

fn import_ring(text: &str, capture: &Path) -> Result<Summary, ImportError> {
    let toml = "[robot]\nticks_per_turn = 1000\n[ring.circle]\ncount = 3\nradius_m = 0.1\nhalf_angle_deg = 5\n";
    ring_import(text.as_bytes(), "small.csv", &Config::from_toml(toml).unwrap(), capture)
}

#[test]
fn a_ring_csv_becomes_a_capture() {
    let folder = tempfile::tempdir().unwrap();
    let capture = folder.path().join("small.mcap");
    let text = "t_s,left_ticks,right_ticks,r0,r1,r2\n10.0,0,0,1.000,inf,\n10.1,5,-7,1.000,2.5,\n10.05,5,-7,1.1,2.5,0.3\n12,,,1,1,1\n";
    let summary = import_ring(text, &capture).unwrap();
    assert_eq!((summary.rows, summary.clamped), (4, 0));
    assert_eq!(summary.remarks, ["line 4: t_s = 10.05 is out of order; the time is interpolated"]);
    let report = inspect(&capture).unwrap();
    assert_eq!(report.frames["SONAR"].count, 4);
    assert!(report.board.starts_with("imported"), "{}", report.board);
    assert_eq!(report.damage, None);
    assert_eq!(report.gaps.len(), 2);
    assert!((report.gaps[0].length_s - 0.95).abs() < 1e-6 && (report.duration_s - 2.0).abs() < 1e-9);
    let readings: Vec<u64> = report.sensors.iter().map(|sensor| sensor.readings).collect();
    assert_eq!(readings, [4, 3, 2]);
    assert_eq!(report.sensors.iter().map(|sensor| sensor.absent_percent).collect::<Vec<_>>(), [0.0, 0.0, 50.0]);
    assert_eq!(report.sensors.iter().map(|sensor| sensor.no_echo_percent).collect::<Vec<_>>(), [0.0, 25.0, 0.0]);
    assert_eq!(report.sensors.iter().map(|sensor| sensor.longest_repeat).collect::<Vec<_>>(), [2, 2, 1]);
    assert_eq!(report.encoders.map(|wheel| (wheel.net_ticks, wheel.path_ticks)), [(5, 5), (-7, 7)]);
    assert!(serde_json::to_string(&report).unwrap().contains("\"SONAR\""));
    assert!(report.to_string().contains("3 sensors, 1000 ticks per turn"), "{report}");
}

#[test]
fn errors_name_file_line_column_and_what_is_expected() {
    let folder = tempfile::tempdir().unwrap();
    let capture = folder.path().join("bad.mcap");
    let error = |text: &str| import_ring(text, &capture).unwrap_err().to_string();
    let header = "t_s,left_ticks,right_ticks,r0,r1,r2\n";
    let refusals = [
        (format!("{header}0,0,0,1,2,x\n"), "small.csv: line 2, column 6: `x`: expected metres"),
        (format!("{header}0,0,0,1,2,-1\n"), "small.csv: line 2, column 6: `-1`: expected metres"),
        (
            format!("{header}0,,0,1,2,1\n1,9,0,1,2,1\n2,,0,1,2,1\n4,99,0,1,2,1\n"),
            "small.csv: line 4, column 2: ``: expected a whole",
        ),
        (format!("{header}0,0,0,100,200,x\n").replace('x', "150"), "small.csv: no reading of 3 lies within"),
        (format!("{header}0,0,0,1,2\n"), "line 2, column 6: ``: expected 6 fields"),
        (format!("{header}0,0,0,1,2,3,4\n"), "line 2, column 7: `4`: expected the end of the line"),
        (format!("{header}0,1.x,0,1,2,3\n"), "line 2, column 2: `1.x`: expected a number"),
        (format!("{header}inf,0,0,1,2,3\n"), "line 2, column 1: `inf`: expected seconds"),
        ("t_s,wheel,right_ticks,r0,r1,r2\n".into(), "line 1, column 2: `wheel`: expected `left_ticks`"),
        (header.into(), "small.csv: nothing to import"),
        (String::new(), "small.csv: nothing to import"),
    ];
    for (text, expected) in refusals {
        assert!(error(&text).contains(expected), "{} for {text:?}", error(&text));
    }
    let without = ring_import(header.as_bytes(), "a.csv", &Config::default(), &capture).unwrap_err().to_string();
    assert!(without.contains("ring"), "{without}");
    let config = Config::from_toml("[ring.circle]\ncount = 3\nradius_m = 0.1\nhalf_angle_deg = 5\n").unwrap();
    let without = ring_import(header.as_bytes(), "a.csv", &config, &capture).unwrap_err().to_string();
    assert!(without.contains("robot.ticks_per_turn"), "{without}");
}

#[test]
fn a_carmen_log_becomes_a_capture() {
    let folder = tempfile::tempdir().unwrap();
    let capture = folder.path().join("small.mcap");
    let ranges: Vec<String> =
        (0..181).map(|i| if i == 90 { "81.9".into() } else { format!("{:.2}", 0.5 + 0.02 * f64::from(i)) }).collect();
    let laser = |pose: &str, t: &str| format!("FLASER 181 {} {pose} {pose} {t} host {t}\n", ranges.join(" "));
    let odometry = |pose: &str, t: &str| format!("ODOM {pose} 0 0 0 {t} host {t}\n");
    let text = [
        "# comment\nPARAM robot_width 0.4\n".into(),
        odometry("1 2 0", "100.0"),
        laser("1 2 0", "100.1"),
        odometry("2 2 0", "101.0"),
        laser("2 2 1.5707963", "100.9"),
        odometry("2 3 1.5707963", "102.0"),
    ]
    .concat();
    let config = config("carmen17.toml");
    let summary = carmen_import(text.as_bytes(), "small.log", &config, &capture).unwrap();
    assert_eq!((summary.rows, summary.encoder_rows, summary.skipped, summary.clamped), (2, 3, 1, 1));
    let report = inspect(&capture).unwrap();
    assert_eq!((report.frames["SONAR"].count, report.frames["ENCODER"].count), (2, 3));
    assert!((report.sensors[8].no_echo_percent - 100.0).abs() < 1e-9);
    assert_eq!(report.sensors[0].readings, 2);
    // 0.5 + 0.02 * 180 = 4.1 m is beyond the configured 4 m.
    assert_eq!(report.sensors[16].readings, 0);
    let metre = 20_000.0 / (0.1 * std::f64::consts::TAU);
    let quarter = 0.2 * std::f64::consts::FRAC_PI_2;
    let expected = [(2.0 - quarter) * metre, (2.0 + quarter) * metre];
    for (wheel, expected) in report.encoders.iter().zip(expected) {
        assert!((wheel.net_ticks as f64 - expected).abs() < 1.0, "{wheel:?}, expected {expected}");
    }

    let error = |text: &str| carmen_import(text.as_bytes(), "bad.log", &config, &capture).unwrap_err().to_string();
    assert!(error("ODOM 1 2 x 0 0 0 1 h 1\n").contains("bad.log: line 1, column 4: `x`: expected the pose's theta"));
    assert!(error("\nFLASER many\n").contains("line 2, column 2: `many`: expected the number of ranges"));
    assert!(error("FLASER 3 1 1\n").contains("line 1, column 9: ``: expected the pose's x"));
    assert!(error("FLASER 99999999999 1 1\n").contains("expected the number of ranges"));
    assert!(error("ODOM 1 2 3 0 0 0 1 h 1\n").contains("nothing to import"));
}

/// The ring CSV as the example prints it.
fn example(arguments: &[&str], input: Stdio) -> Vec<u8> {
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".into());
    let output = Command::new(cargo)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .args(["run", "--quiet", "--example", "recordings", "--"])
        .args(arguments)
        .stdin(input)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output.stdout
}

#[test]
fn the_corridor_is_mapped_at_its_size() {
    let (Some(ranges), Some(poses)) = (data("corridor_sonar8/measurement.txt"), data("corridor_sonar8/poses.txt"))
    else {
        return;
    };
    let csv = example(&["corridor", ranges.to_str().unwrap(), poses.to_str().unwrap()], Stdio::null());
    let (config, folder) = (config("corridor8.toml"), tempfile::tempdir().unwrap());
    let capture = folder.path().join("corridor.mcap");
    let summary = ring_import(csv.as_slice(), "corridor.csv", &config, &capture).unwrap();
    println!("{summary}\n{}", inspect(&capture).unwrap());
    let run = run(&capture, &config);
    assert!(run.sweeps > 350, "{} sweeps", run.sweeps);
    assert!(run.poses.iter().all(|pose| pose.x_m.is_finite() && pose.y_m.is_finite() && pose.theta_rad.is_finite()));
    let (found, odometry) = (extent(&run.poses), extent(&run.odometry));
    println!("{} sweeps, extent {found:.2?} m, by encoders {odometry:.2?} m", run.sweeps);
    // The recorded poses span 16.9 m by 9.7 m, and the ticks must give them back.
    assert!((odometry[0] - 16.9).abs() < 0.1 && (odometry[1] - 9.7).abs() < 0.1, "{odometry:?}");
    assert!((12.0..22.0).contains(&found[0]) && (6.0..14.0).contains(&found[1]), "{found:?}");
    let (first, last) = (run.odometry[0], run.odometry[run.odometry.len() - 1]);
    let text = std::fs::read_to_string(poses).unwrap();
    let end: Vec<f64> = text.lines().last().unwrap().split_whitespace().map(|field| field.parse().unwrap()).collect();
    let moved = first.inverse() * last;
    assert!((moved.x_m - end[1] * 1e-3).abs() < 0.05 && (moved.y_m - end[2] * 1e-3).abs() < 0.05, "{moved:?} {end:?}");
    assert!(wrap_angle(moved.theta_rad - (end[3] * 0.1).to_radians()).abs() < 0.01, "{moved:?} {end:?}");
}

#[test]
fn the_ring_of_24_reports_its_sensors() {
    let Some(csv) = data("scitos_g5_ring24/sensor_readings_24_first_half.csv") else { return };
    let csv = example(&["scitos", csv.to_str().unwrap()], Stdio::null());
    let (config, folder) = (config("scitos24.toml"), tempfile::tempdir().unwrap());
    let capture = folder.path().join("scitos.mcap");
    ring_import(csv.as_slice(), "scitos.csv", &config, &capture).unwrap();
    println!("{}", inspect(&capture).unwrap());
    let run = run(&capture, &config);
    println!("{} sweeps", run.sweeps);
    assert!(run.sweeps > 2500, "{} sweeps", run.sweeps);
    assert_eq!(run.states, 24);
}

/// The start of a compressed file; none where the tool or the file is absent.
fn decompressed(tool: &str, name: &str, lines: usize) -> Option<Vec<u8>> {
    let path = data(name)?;
    let Ok(mut child) = Command::new(tool).arg("-dc").arg(path).stdout(Stdio::piped()).stderr(Stdio::null()).spawn()
    else {
        println!("skipped: {tool} is absent");
        return None;
    };
    let mut text = Vec::new();
    let mut output = BufReader::new(child.stdout.take().unwrap());
    for _ in 0..lines {
        output.read_until(b'\n', &mut text).unwrap();
    }
    std::io::copy(&mut output.by_ref(), &mut std::io::sink()).unwrap();
    child.wait().unwrap();
    Some(text)
}

#[test]
fn carmen_logs_of_two_buildings_run() {
    for name in ["freiburg_079/fr079_raw.clf.gz", "intel_lab/intel_raw.clf.gz"] {
        let Some(text) = decompressed("gzip", name, 2000) else { continue };
        let (config, folder) = (config("carmen17.toml"), tempfile::tempdir().unwrap());
        let capture = folder.path().join("log.mcap");
        let summary = carmen_import(text.as_slice(), name, &config, &capture).unwrap();
        println!("{name}: {summary}\n{}", inspect(&capture).unwrap());
        let run = run(&capture, &config);
        assert!(run.sweeps + 5 > summary.rows, "{} of {} sweeps", run.sweeps, summary.rows);
        assert!(run.poses.iter().all(|pose| pose.x_m.is_finite() && pose.theta_rad.is_finite()));
        println!("{} sweeps, extent {:.2?} m", run.sweeps, extent(&run.poses));
    }
}

#[test]
fn ticks_and_beams_of_the_mines_rover_run() {
    let Some(text) = decompressed("xz", "mines_rover_exp1/exp1.dat.xz", usize::from(u16::MAX)) else { return };
    let folder = tempfile::tempdir().unwrap();
    let (plain, capture) = (folder.path().join("exp1.dat"), folder.path().join("mines.mcap"));
    std::fs::write(&plain, text).unwrap();
    let csv = example(&["mines", "-"], std::fs::File::open(plain).unwrap().into());
    let config = config("mines21.toml");
    let summary = ring_import(csv.as_slice(), "mines.csv", &config, &capture).unwrap();
    println!("{summary}\n{}", inspect(&capture).unwrap());
    let run = run(&capture, &config);
    println!("{} sweeps, extent {:.2?} m, by encoders {:.2?} m", run.sweeps, extent(&run.poses), extent(&run.odometry));
    assert!(run.sweeps > 700, "{} sweeps", run.sweeps);
}
