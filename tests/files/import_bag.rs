//! `slamd import bag` on bags that PyPI's rosbags writes from a ring CSV: pose and map are those of the CSV.
//!
//! The test makes a Python environment in Cargo's target folder: it needs `python3` with `venv`, and PyPI the first time.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd_testkit::python;
use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

const ROBOT: &str = "[robot]\nwheel_radius_m = 0.035\nwheel_base_m = 0.26\nticks_per_turn = 1440\n\n[ring.circle]\ncount = 16\nradius_m = 0.15\nhalf_angle_deg = 12.5\ngroups = 4\n";

/// A drive of circles in a room of 4 m x 5 m, as a ring CSV: 16 sensors, exact wheels.
fn drive() -> String {
    let mut csv = String::from("t_s,left_ticks,right_ticks");
    (0..16).for_each(|sensor| write!(csv, ",r{sensor}").unwrap());
    let (mut x, mut y, mut theta) = (0.0f64, 0.0f64, 0.0f64);
    let metres_per_tick = std::f64::consts::TAU * 0.035 / 1440.0;
    let (mut left, mut right) = (0i32, 0i32);
    for k in 0..600u32 {
        write!(csv, "\n{:.1},{left},{right}", 0.1 * f64::from(k)).unwrap();
        for sensor in 0..16 {
            let bearing = theta + std::f64::consts::TAU * f64::from(sensor) / 16.0;
            let at = (x + 0.15 * libm::cos(bearing), y + 0.15 * libm::sin(bearing));
            match echo(at, bearing) {
                Some(range_m) => write!(csv, ",{range_m:.3}").unwrap(),
                None => csv.push_str(",inf"),
            }
        }
        // Straight for two seconds, then a turn.
        let (l, r) = if k % 40 < 25 { (160, 160) } else { (60, 160) };
        (left, right) = (left + l, right + r);
        let (left_m, right_m) = (f64::from(l) * metres_per_tick, f64::from(r) * metres_per_tick);
        let turn = (right_m - left_m) / 0.26;
        (x, y) = (
            x + 0.5 * (left_m + right_m) * libm::cos(theta + 0.5 * turn),
            y + 0.5 * (left_m + right_m) * libm::sin(theta + 0.5 * turn),
        );
        theta += turn;
    }
    csv + "\n"
}

/// The nearest wall that a cone of 25 degrees meets squarely enough.
fn echo((x, y): (f64, f64), bearing: f64) -> Option<f64> {
    let walls = [
        (0.0f64, 2.0 - x),
        (std::f64::consts::PI, x + 2.0),
        (0.5 * std::f64::consts::PI, 2.6 - y),
        (-0.5 * std::f64::consts::PI, y + 2.4),
    ];
    let seen = walls.iter().filter_map(|(normal, distance_m)| {
        let off = libm::atan2(libm::sin(bearing - normal), libm::cos(bearing - normal)).abs();
        (off < 0.45).then(|| distance_m / libm::cos((off - 0.218).max(0.0)))
    });
    seen.filter(|range_m| *range_m < 2.9).min_by(f64::total_cmp)
}

fn slamd(folder: &Path, arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_slamd")).args(arguments).current_dir(folder).output().unwrap();
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{arguments:?}: {error}");
    error
}

/// The last pose, and the square metres of the map.
fn result(folder: &Path, name: &str) -> ([f64; 3], f64) {
    slamd(folder, &["replay", &format!("{name}.mcap"), "--out", name]);
    let text = std::fs::read_to_string(folder.join(name).join("trajectory.tum")).unwrap();
    let fields: Vec<f64> = text.lines().last().unwrap().split(' ').map(|field| field.parse().unwrap()).collect();
    let json = std::fs::read(folder.join(name).join("summary.json")).unwrap();
    let summary: serde_json::Value = serde_json::from_slice(&json).unwrap();
    ([fields[1], fields[2], fields[6]], summary["map_m2"].as_f64().unwrap())
}

#[test]
fn a_bag_gives_pose_and_map_of_the_csv_of_the_same_drive() {
    let python = python::python(env!("CARGO_TARGET_TMPDIR"), "import", "rosbags", &["rosbags==0.11.9"]);
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("drive.csv"), drive()).unwrap();
    std::fs::write(folder.join("robot.toml"), ROBOT).unwrap();
    slamd(folder, &["import", "ring", "drive.csv", "--config", "robot.toml", "--capture", "csv.mcap"]);
    let (pose, map_m2) = result(folder, "csv");
    assert!(map_m2 > 15.0, "{map_m2}");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/files/imported/make_bag.py");
    let kinds = [
        ["mcap", "joints", ""],
        ["mcap", "odometry", ""],
        ["sqlite3", "joints", ""],
        ["sqlite3", "odometry", ""],
        ["sqlite3", "speeds", ""],
        ["mcap", "joints", "storage"],
        ["mcap", "joints", "message"],
        ["sqlite3", "joints", "file"],
        ["sqlite3", "joints", "message"],
    ];
    for [storage, wheels, compression] in kinds {
        let name = format!("{storage}-{wheels}-{compression}");
        let bag = format!("bag-{name}");
        let mut make = Command::new(&python);
        make.arg(&script).args(["drive.csv", &bag, storage, wheels, "1440", "0.035", "0.26"]).current_dir(folder);
        make.args(Some(compression).filter(|word| !word.is_empty()));
        python::run(&mut make, "rosbags writes a bag");
        let said =
            slamd(folder, &["import", "bag", &bag, "--config", "robot.toml", "--capture", &format!("{name}.mcap")]);
        assert!(said.contains("600 rows of ranges over 59.9 s"), "{said}");
        assert_eq!(said.contains("summed up from their speeds"), wheels == "speeds", "{said}");
        let (bag_pose, bag_m2) = result(folder, &name);
        let off: Vec<f64> = pose.iter().zip(bag_pose).map(|(a, b)| (a - b).abs()).collect();
        // Speeds that are summed up give nearly the same counts.
        let (within, within_m2) = if wheels == "speeds" { (0.02, 0.4) } else { (0.003, 0.05) };
        assert!(off.iter().all(|off| *off < within), "{name}: {pose:?} and {bag_pose:?}");
        assert!((map_m2 - bag_m2).abs() < within_m2, "{name}: {map_m2} and {bag_m2}");
        let info = slamd_capture::CaptureReader::open(&folder.join(format!("{name}.mcap"))).unwrap().info().clone();
        assert_eq!(info.unix_zero_us, Some(1_700_000_000_000_000), "the calendar's time is kept");
    }
    // A damaged bag is read around the damage, and what is lost is said.
    for (bag, end) in [("bag-mcap-joints-", "mcap"), ("bag-sqlite3-joints-", "db3")] {
        let is_bag = |path: &std::path::PathBuf| path.extension().is_some_and(|found| found == end);
        let mut files = std::fs::read_dir(folder.join(bag)).unwrap().map(|entry| entry.unwrap().path());
        let whole = std::fs::read(files.find(is_bag).unwrap()).unwrap();
        let mut torn = whole.clone();
        torn[whole.len() / 2..whole.len() / 2 + 6_000].fill(0x5a);
        for (name, bytes) in [("cut", &whole[..whole.len() * 2 / 3]), ("torn", &torn)] {
            let file = format!("{name}.{end}");
            std::fs::write(folder.join(&file), bytes).unwrap();
            let capture = format!("{name}-{end}.mcap");
            let said = slamd(folder, &["import", "bag", &file, "--config", "robot.toml", "--capture", &capture]);
            assert!(said.contains("cut off") || said.contains("damaged"), "{file}: {said}");
            let rows: f64 = said.rsplit_once(" rows of ranges").unwrap().0.rsplit(' ').next().unwrap().parse().unwrap();
            let least = if name == "cut" { 300.0 } else { 200.0 };
            assert!((least..600.0).contains(&rows), "{file}: {said}");
        }
    }
    // What is no bag of a robot is named.
    let import = |bag: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_slamd"));
        command.args(["import", "bag", bag, "--config", "robot.toml", "--capture", "no.mcap"]).current_dir(folder);
        let output = command.output().unwrap();
        assert!(!folder.join("no.mcap").exists());
        (output.status.code().unwrap(), String::from_utf8(output.stderr).unwrap())
    };
    let (code, text) = import("csv.mcap");
    assert!(code == 65 && text.contains("a capture of slamd"), "{code} {text}");
    let (code, text) = import("drive.csv");
    assert!(code == 65 && text.contains("no ROS 2 bag"), "{code} {text}");
}
