//! Inputs that people really have, from `../shared/cases`: each gives what its `expected.txt` says. Without that folder the tests say so.

#![allow(clippy::unwrap_used, reason = "a test may")]

use sha2::{Digest as _, Sha256};
use slamd_testkit::mock_port::{Board, Device, Plugged};
use std::path::{Path, PathBuf};
use std::process::Command;
use tempfile::TempDir;

/// A case's folder, and a folder to work in.
struct Case {
    inputs: PathBuf,
    work: TempDir,
}

impl Case {
    /// None, with a message, where the cases are not there.
    fn open(name: &str) -> Option<Self> {
        let cases = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/cases");
        if !cases.is_dir() {
            println!("skipped: there is no {}", cases.display());
            return None;
        }
        let folders = std::fs::read_dir(&cases).unwrap().map(|entry| entry.unwrap().path());
        let mut named = folders.filter(|folder| folder.file_name().unwrap().to_string_lossy().starts_with(name));
        let inputs = named.next().unwrap_or_else(|| panic!("no case {name}"));
        let work = tempfile::tempdir().unwrap();
        for file in ["base16.csv", "base16.truth", "ring16.toml"] {
            std::fs::copy(cases.join(file), work.path().join(file)).unwrap();
        }
        Some(Self { inputs, work })
    }

    fn path(&self, name: &str) -> PathBuf {
        self.work.path().join(name)
    }

    fn copy(&self, name: &str) {
        std::fs::copy(self.inputs.join(name), self.path(name)).unwrap();
    }

    /// Exit code, and standard output with standard error.
    fn slamd(&self, arguments: &[&str]) -> (i32, String) {
        let mut command = Command::new(env!("CARGO_BIN_EXE_slamd"));
        let output = command.args(arguments).current_dir(self.work.path()).output().unwrap();
        let text = String::from_utf8(output.stdout).unwrap() + &String::from_utf8(output.stderr).unwrap();
        (output.status.code().unwrap(), text)
    }

    /// Imports a ring CSV as `c.mcap`.
    fn import(&self, name: &str, options: &[&str]) -> (i32, String) {
        if !self.path(name).exists() {
            self.copy(name);
        }
        let fixed = ["import", "ring", name, "--config", "ring16.toml", "--capture", "c.mcap"];
        self.slamd(&[&fixed, options].concat())
    }

    /// Replays `c.mcap`: sweeps, square metres, root mean square error in metres against the truth of the clean drive.
    fn replay(&self) -> (u64, f64, f64) {
        let (code, text) = self.slamd(&["replay", "c.mcap", "--out", "o"]);
        assert_eq!(code, 0, "{text}");
        let summary: serde_json::Value =
            serde_json::from_slice(&std::fs::read(self.path("o/summary.json")).unwrap()).unwrap();
        (summary["sweeps"].as_u64().unwrap(), summary["map_m2"].as_f64().unwrap(), self.rmse_m())
    }

    /// Like `score.py`: poses of equal times, aligned rigidly.
    fn rmse_m(&self) -> f64 {
        let rows = |name: &str| -> Vec<Vec<f64>> {
            let text = std::fs::read_to_string(self.path(name)).unwrap();
            text.lines().map(|line| line.split(' ').map(|field| field.parse().unwrap()).collect()).collect()
        };
        let (truth, poses) = (rows("base16.truth"), rows("o/trajectory.tum"));
        let pairs: Vec<([f64; 2], [f64; 2])> = poses
            .iter()
            .filter_map(|pose| {
                let truth = truth.iter().find(|truth| (truth[0] - pose[0]).abs() < 0.006)?;
                Some(([pose[1], pose[2]], [truth[1], truth[2]]))
            })
            .collect();
        let n = pairs.len() as f64;
        let mean = |pick: fn(&([f64; 2], [f64; 2])) -> f64| pairs.iter().map(pick).sum::<f64>() / n;
        let (ex, ey, tx, ty) = (mean(|p| p.0[0]), mean(|p| p.0[1]), mean(|p| p.1[0]), mean(|p| p.1[1]));
        let centred = || pairs.iter().map(move |(e, t)| (e[0] - ex, e[1] - ey, t[0] - tx, t[1] - ty));
        let (cos, sin) = centred().fold((0.0, 0.0), |(c, s), (a, b, x, y)| (c + a * x + b * y, s + a * y - b * x));
        let (sin, cos) = libm::sincos(libm::atan2(sin, cos));
        let square = centred().map(|(a, b, x, y)| (cos * a - sin * b - x).powi(2) + (sin * a + cos * b - y).powi(2));
        (square.sum::<f64>() / n).sqrt()
    }

    /// Imported and replayed as the clean drive is.
    fn assert_clean(&self, rmse_m: f64) {
        let (sweeps, map_m2, found_m) = self.replay();
        assert!(
            sweeps >= 899 && (19.0..20.5).contains(&map_m2) && found_m < rmse_m,
            "{sweeps}, {map_m2} m2, {found_m} m"
        );
    }

    fn sha256(&self, name: &str) -> String {
        format!("{:x?}", Sha256::digest(std::fs::read(self.path(name)).unwrap()))
    }

    /// No half file is left.
    fn assert_no_part(&self) {
        for entry in std::fs::read_dir(self.work.path()).unwrap() {
            let name = entry.unwrap().file_name().to_string_lossy().into_owned();
            assert!(!name.contains(".part"), "{name}");
        }
    }
}

#[test]
fn case_01_import_onto_its_input() {
    let Some(case) = Case::open("01") else { return };
    let before = case.sha256("base16.csv");
    let name = case.path("base16.csv");
    let name = name.to_str().unwrap();
    std::os::unix::fs::symlink(name, case.path("link")).unwrap();
    std::fs::hard_link(name, case.path("hard")).unwrap();
    for capture in ["base16.csv", name, "link", "hard"] {
        let fixed = ["import", "ring", "base16.csv", "--config", "ring16.toml", "--force", "--capture", capture];
        let (code, text) = case.slamd(&fixed);
        assert!(
            code == 64 && text.contains(&format!("{capture} would be written over; name another file")),
            "{code} {text}"
        );
    }
    let (code, _) =
        case.slamd(&["import", "ring", "base16.csv", "--config", "ring16.toml", "--capture", "ring16.toml"]);
    assert_eq!(code, 64);
    assert_eq!(case.sha256("base16.csv"), before);
    case.assert_no_part();
}

#[test]
fn case_03_a_failed_import_keeps_an_older_capture() {
    let Some(case) = Case::open("03") else { return };
    assert_eq!(case.import("base16.csv", &[]).0, 0);
    let before = case.sha256("c.mcap");
    let (code, text) = case.import("cut.csv", &[]);
    assert!(
        code == 73 && text.contains("line 901: the last row is cut off") && text.contains("c.mcap exists"),
        "{code} {text}"
    );
    let cut = std::fs::read_to_string(case.path("cut.csv")).unwrap();
    for (name, code) in [("time", 73), ("when", 65)] {
        // `time` is read, as `t_s` is; a cut recording replaces no capture.
        std::fs::write(case.path("h.csv"), cut.replacen("t_s", name, 1)).unwrap();
        assert_eq!(case.import("h.csv", &[]).0, code, "{name}");
    }
    assert_eq!(case.sha256("c.mcap"), before);
    case.assert_no_part();
    // Alone it is imported, and what is lost is said.
    std::fs::remove_file(case.path("c.mcap")).unwrap();
    let (code, text) = case.import("cut.csv", &[]);
    assert!(code == 0 && text.contains("899 rows") && text.contains("what followed it is lost"), "{code} {text}");
    case.assert_clean(0.004);
}

#[test]
fn case_08_ranges_in_other_units() {
    let Some(case) = Case::open("08") else { return };
    for (name, unit, word) in
        [("cm.csv", "cm", "centimetres?"), ("mm.csv", "mm", "millimetres?"), ("us.csv", "us", "microseconds")]
    {
        let (code, text) = case.import(name, &[]);
        assert!(code == 65 && text.contains(word) && text.contains(&format!("--range-unit {unit}")), "{code} {text}");
        assert!(!case.path("c.mcap").exists());
        let (code, text) = case.import(name, &["--range-unit", unit, "--no-echo", "0"]);
        assert_eq!(code, 0, "{text}");
        case.assert_clean(0.005);
        std::fs::remove_file(case.path("c.mcap")).unwrap();
    }
}

#[test]
fn case_09_one_wrong_stamp() {
    let Some(case) = Case::open("09") else { return };
    let (code, text) = case.import("one_stamp.csv", &[]);
    assert!(code == 0 && text.contains("line 302: t_s = 4294967.295 is out of order"), "{code} {text}");
    case.assert_clean(0.004);
}

#[test]
fn case_10_time_in_other_units() {
    let Some(case) = Case::open("10") else { return };
    for (name, unit, step_s) in [("ms.csv", "ms", "100 s"), ("us.csv", "us", "100000 s")] {
        let (code, text) = case.import(name, &[]);
        assert!(code == 65 && text.contains(step_s) && text.contains(&format!("--time-unit {unit}")), "{code} {text}");
        assert_eq!(case.import(name, &["--time-unit", unit]).0, 0);
        case.assert_clean(0.004);
    }
}

#[test]
fn case_13_a_bag_is_no_capture() {
    let Some(case) = Case::open("13") else { return };
    assert_eq!(case.import("base16.csv", &[]).0, 0);
    let _ = case.replay();
    let map = case.sha256("o/map.png");
    assert_eq!(case.slamd(&["export", "c.mcap", "--mcap", "bag.mcap"]).0, 0);
    std::fs::write(case.path("empty.mcap"), "").unwrap();
    for (file, words) in
        [("bag.mcap", "bag.mcap is a ROS 2 bag (profile ros2), no capture of slamd"), ("empty.mcap", "is empty")]
    {
        for arguments in [
            &["replay", file, "--out", "o"][..],
            &["inspect", file],
            &["doctor", "--capture", file],
            &["export", file, "--tum", "x.tum"],
            &["calibrate", file, "--out", "x.toml"],
        ] {
            let (code, text) = case.slamd(arguments);
            assert!(code == 65 && text.contains(words), "{arguments:?}: {code} {text}");
        }
    }
    assert!(!case.path("x.tum").exists() && !case.path("x.toml").exists());
    assert_eq!(case.sha256("o/map.png"), map);
    case.assert_no_part();
}

#[test]
fn case_15_carmen_as_carmen_writes_it() {
    let Some(case) = Case::open("15") else { return };
    case.copy("carmen.log");
    case.copy("robot.toml");
    let import = ["import", "carmen", "carmen.log", "--config", "robot.toml", "--capture", "c.mcap"];
    let (code, text) = case.slamd(&import);
    assert!(code == 0 && text.contains("900 rows of ranges"), "{code} {text}");
    let info = slamd_capture::CaptureReader::open(&case.path("c.mcap")).unwrap().info().clone();
    assert_eq!(info.unix_zero_us, Some(1_200_000_000_000_000));
    let (sweeps, _, rmse_m) = case.replay();
    assert!(sweeps == 900 && rmse_m < 0.004, "{sweeps} {rmse_m}");
}

#[test]
fn case_17_readings_at_the_greatest_range() {
    let Some(case) = Case::open("17") else { return };
    assert_eq!(case.import("clipped.csv", &[]).0, 0);
    case.assert_clean(0.004);
    assert_eq!(std::fs::read_to_string(case.path("o/faults.csv")).unwrap().lines().count(), 1);
}

#[test]
fn case_18_zero_is_no_echo() {
    let Some(case) = Case::open("18") else { return };
    let (code, text) = case.import("zero.csv", &[]);
    assert!(code == 0 && text.contains("7265 readings (50 %) are 0, taken as too close"), "{code} {text}");
    assert_eq!(case.import("zero.csv", &["--no-echo", "0"]).0, 0);
    let zero = case.replay();
    assert_eq!(case.import("inf.csv", &[]).0, 0);
    let inf = case.replay();
    assert!((zero.1 - inf.1).abs() < 1e-9, "{zero:?} {inf:?}");
}

#[test]
fn case_21_texts_of_all_kinds() {
    let Some(case) = Case::open("21") else { return };
    for name in ["powershell.csv", "excel.csv", "drive.csv.gz", "boot.csv", "u32.csv", "german.csv"] {
        let (code, text) = case.import(name, &[]);
        assert_eq!(code, 0, "{name}: {text}");
        assert_eq!(text.contains("line 1"), name == "boot.csv", "{text}");
        case.assert_clean(0.004);
    }
}

#[test]
fn case_02_a_second_recording_keeps_the_first() {
    let Some(case) = Case::open("02") else { return };
    let _board = Plugged::new(&case.path("board"), Device::new(Board::robot(5), 1));
    let record =
        |seconds| case.slamd(&["--port", "board", "--duration", seconds, "--record", "drive.mcap", "--out", "o"]);
    let (_, text) = record("2");
    assert!(case.path("drive.mcap").exists(), "{text}");
    let before = case.sha256("drive.mcap");
    let (_, text) = record("1");
    assert!(text.contains("drive-0002.mcap") && case.path("drive-0002.mcap").exists(), "{text}");
    assert_eq!(case.sha256("drive.mcap"), before);
}

#[test]
fn case_06_counters_that_start_anew() {
    let Some(case) = Case::open("06") else { return };
    let (code, text) = case.import("board_reset.csv", &[]);
    assert!(code == 0 && text.contains("line 452"), "{code} {text}");
    let (sweeps, map_m2, rmse_m) = case.replay();
    assert!(sweeps >= 899 && (19.0..20.5).contains(&map_m2) && rmse_m < 0.05, "{sweeps} {map_m2} {rmse_m}");
    let (_, text) = case.slamd(&["doctor", "--capture", "c.mcap"]);
    assert!(text.contains("start anew"), "{text}");
}

#[test]
fn case_07_counters_of_16_bits() {
    let Some(case) = Case::open("07") else { return };
    let (code, text) = case.import("u16.csv", &[]);
    assert!(code == 0 && text.contains("16 bits"), "{code} {text}");
    case.assert_clean(0.004);
}

#[test]
fn case_12_one_sensor_per_row_makes_the_map() {
    let Some(case) = Case::open("12") else { return };
    assert_eq!(case.import("robin.csv", &[]).0, 0);
    let (sweeps, map_m2, _) = case.replay();
    assert!((220..=226).contains(&sweeps) && (19.0..20.5).contains(&map_m2), "{sweeps} sweeps, {map_m2} m2");
    assert_eq!(std::fs::read_to_string(case.path("o/faults.csv")).unwrap().lines().count(), 1, "no sensor is faulty");
}

#[test]
fn case_24_text_between_the_frames() {
    let Some(case) = Case::open("24") else { return };
    // As mixed.py does: a print every 0.3 s between what the board sends.
    let _board = Plugged::new(&case.path("board"), Device::new(Board::robot(5), 1).with_text(b"dist=23 cm\r\n"));
    let (_, text) = case.slamd(&["doctor", "--port", "board", "--seconds", "4"]);
    assert!(text.contains("readable text") && text.contains("`dist=23 cm`"), "{text}");
    assert!(text.contains("take the prints out") && !text.contains("shorten the cable"), "{text}");
}

#[test]
fn case_26_uncertain_to_the_end_counts() {
    let Some(case) = Case::open("26") else { return };
    case.copy("scatter.csv");
    case.copy("robot.toml");
    let import = ["import", "ring", "scatter.csv", "--config", "robot.toml", "--capture", "c.mcap"];
    assert_eq!(case.slamd(&import).0, 0);
    assert_eq!(case.slamd(&["replay", "c.mcap", "--out", "o"]).0, 0);
    let summary: serde_json::Value =
        serde_json::from_slice(&std::fs::read(case.path("o/summary.json")).unwrap()).unwrap();
    let log = std::fs::read_to_string(case.path("o/lock.csv")).unwrap();
    let last_pose = std::fs::read_to_string(case.path("o/trajectory.tum")).unwrap();
    let end_s: f64 = last_pose.lines().last().unwrap().split(' ').next().unwrap().parse().unwrap();
    // The sum of the log's own intervals; one that is open lasts to the last pose.
    let (mut sum_s, mut since_s) = (0.0, None::<f64>);
    for line in log.lines().skip(1) {
        let fields: Vec<&str> = line.split(',').collect();
        let from_s: f64 = fields[2].parse().unwrap();
        match fields[1] {
            "lost" | "doubted" => since_s = Some(since_s.unwrap_or(from_s)),
            "regained" | "trusted" => {
                sum_s += fields[0].parse::<f64>().unwrap() - since_s.take().map_or(from_s, |open_s| open_s.min(from_s));
            }
            _ => {}
        }
    }
    sum_s += since_s.map_or(0.0, |since_s| end_s - since_s);
    let told_s = summary["uncertain_s"].as_f64().unwrap();
    assert!((told_s - sum_s).abs() < 1e-3, "{told_s} s, {sum_s} s of\n{log}");
}
