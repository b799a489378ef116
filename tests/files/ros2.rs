//! `slamd export`: what two readers of ROS 2 bags that know nothing of slamd find in its file, and each other, beside what `slamd replay` leaves
//! of the same capture.
//!
//! The test makes a Python environment in Cargo's target folder: it needs `python3` with `venv`, and PyPI the first time.

#![allow(clippy::unwrap_used, reason = "a test may")]

use serde_json::Value;
use slamd_capture::{CaptureInfo, CaptureReader, CaptureWriter};
use slamd_core::Pose2;
use slamd_testkit::python;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;
use tempfile::TempDir;

const PACKAGES: [&str; 4] = ["mcap-ros2-support==0.6.0", "rosbags==0.11.9", "pillow==13.0.0", "pyyaml==6.0.4"];
/// The session's beginning, microseconds since 1970.
const BEGAN_US: u64 = 1_700_000_000_250_000;
/// So much of the committed capture is enough, microseconds.
const LENGTH_US: u64 = 40_000_000;
const SENSORS: usize = 32;

/// The first part of the committed capture, replayed and exported.
struct Drive {
    folder: TempDir,
    /// What mcap-ros2-support finds in the bag.
    facts: Value,
}

/// The wall clock is known, other than in the committed capture.
fn cut(to: &Path) {
    let mut capture = CaptureReader::open(&root().join("replay/flat-paper-faults.mcap")).unwrap();
    let info = CaptureInfo { unix_zero_us: Some(BEGAN_US), ..capture.info().clone() };
    let mut writer = CaptureWriter::create(to, &info).unwrap();
    for record in capture.by_ref().map(Result::unwrap).take_while(|record| record.at().us() < LENGTH_US) {
        writer.record(&record).unwrap();
    }
    writer.finish().unwrap();
}

/// Made once for all tests.
fn drive() -> &'static Drive {
    static DRIVE: OnceLock<Drive> = OnceLock::new();
    DRIVE.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        cut(&folder.path().join("drive.mcap"));
        let python = std::thread::spawn(python);
        let mut replay = slamd(folder.path(), &["replay", "drive.mcap", "--out", "out"]);
        let replay = replay.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        let options = ["--mcap", "bag.mcap", "--csv", "poses.csv", "--tum", "poses.tum"];
        let exported = slamd(folder.path(), &[&["export", "drive.mcap"], &options[..]].concat()).output().unwrap();
        let said = String::from_utf8(exported.stdout).unwrap();
        assert!(exported.status.success(), "{}", String::from_utf8_lossy(&exported.stderr));
        assert!(said.starts_with("ROS 2 bag: bag.mcap, ") && said.contains("poses: poses.csv"), "{said}");
        let replayed = replay.wait_with_output().unwrap();
        assert!(replayed.status.success(), "{}", String::from_utf8_lossy(&replayed.stderr));
        python.join().unwrap();
        let facts = ask("facts.py", &[Path::new("mcap"), &folder.path().join("bag.mcap")]);
        Drive { folder, facts }
    })
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn slamd(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_slamd"));
    command.args(arguments).current_dir(folder);
    command
}

/// Python with both readers.
fn python() -> PathBuf {
    python::python(env!("CARGO_TARGET_TMPDIR"), "ros2", "mcap_ros2, rosbags, PIL, yaml", &PACKAGES)
}

/// What a script of `tests/files/exported` says.
fn ask(script: &str, arguments: &[&Path]) -> Value {
    let mut command = Command::new(python());
    let Output { status, stdout, stderr } =
        command.arg(root().join("tests/files/exported").join(script)).args(arguments).output().unwrap();
    assert!(status.success(), "{}", String::from_utf8_lossy(&stderr));
    serde_json::from_slice(&stdout).unwrap()
}

impl Drive {
    fn file(&self, name: &str) -> String {
        std::fs::read_to_string(self.folder.path().join(name)).unwrap()
    }

    /// The messages on a topic, and their type.
    fn topic(&self, name: &str) -> (usize, String) {
        serde_json::from_value(self.facts["topics"][name].clone()).unwrap()
    }

    /// The sensors that are faulty at the end, by `faults.csv`, each with its kind.
    fn faulty(&self) -> BTreeMap<usize, String> {
        let text = self.file("out/faults.csv");
        let mut faulty = BTreeMap::new();
        for words in text.lines().skip(1).map(|line| line.split(',').collect::<Vec<_>>()) {
            let sensor = words[1].parse().unwrap();
            match words[2] {
                "faulty" => faulty.insert(sensor, words[3].to_owned()),
                _ => faulty.remove(&sensor),
            };
        }
        faulty
    }
}

fn floats(value: &Value) -> Vec<f64> {
    serde_json::from_value(value.clone()).unwrap()
}

fn whole(value: &Value) -> Vec<i64> {
    serde_json::from_value(value.clone()).unwrap()
}

/// A pose or transform: x, y, z and a quaternion about z.
fn pose(value: &Value) -> Pose2 {
    let [x_m, y_m, z_m, qx, qy, qz, qw] = floats(value).try_into().unwrap();
    assert!(z_m == 0.0 && qx == 0.0 && qy == 0.0 && (libm::hypot(qz, qw) - 1.0).abs() < 1e-9);
    Pose2::new(x_m, y_m, 2.0 * libm::atan2(qz, qw))
}

fn near(a: Pose2, b: Pose2) -> bool {
    (a.position() - b.position()).norm() < 2e-6 && (a.theta_rad - b.theta_rad).abs() < 2e-6
}

/// Nanoseconds and pose of a line of a TUM file of slamd's.
fn tum(line: &str) -> (u64, Pose2) {
    let words: Vec<&str> = line.split(' ').collect();
    let number = |place: usize| words[place].parse::<f64>().unwrap();
    let us: u64 = words[0].replace('.', "").parse().unwrap();
    ((BEGAN_US + us) * 1_000, Pose2::new(number(1), number(2), 2.0 * libm::atan2(number(6), number(7))))
}

#[test]
fn both_readers_find_the_same() {
    let drive = drive();
    let other = ask("facts.py", &[Path::new("rosbags"), &drive.folder.path().join("bag.mcap")]);
    for (what, fact) in drive.facts.as_object().unwrap() {
        assert_eq!(fact, &other[what], "{what}");
    }
}

#[test]
fn each_topic_has_its_type_and_its_messages() {
    let drive = drive();
    assert_eq!(drive.facts["in_order"], true);
    let summary: Value = serde_json::from_str(&drive.file("out/summary.json")).unwrap();
    let sweeps = usize::try_from(summary["sweeps"].as_u64().unwrap()).unwrap();
    let poses = drive.file("out/trajectory.tum").lines().count();
    assert!(sweeps > 380 && poses == sweeps, "{sweeps} {poses}");
    assert_eq!(drive.topic("/odom"), (sweeps, "nav_msgs/msg/Odometry".into()));
    assert_eq!(drive.topic("/pose"), (poses, "geometry_msgs/msg/PoseWithCovarianceStamped".into()));
    assert_eq!(drive.topic("/tf"), (sweeps + poses, "tf2_msgs/msg/TFMessage".into()));
    assert_eq!(drive.topic("/tf_static"), (1, "tf2_msgs/msg/TFMessage".into()));
    for sensor in 0..SENSORS {
        assert_eq!(drive.topic(&format!("/sonar_{sensor}")), (sweeps, "sensor_msgs/msg/Range".into()));
    }
    let (maps, kind) = drive.topic("/map");
    assert!((6..=10).contains(&maps) && kind == "nav_msgs/msg/OccupancyGrid", "{maps} {kind}");
    let (told, kind) = drive.topic("/diagnostics");
    assert!((39..=60).contains(&told) && kind == "diagnostic_msgs/msg/DiagnosticArray", "{told} {kind}");
    assert_eq!(drive.topic("/scan"), (sweeps, "sensor_msgs/msg/LaserScan".into()));
    assert_eq!(drive.topic("/points"), (sweeps, "sensor_msgs/msg/PointCloud2".into()));
    assert_eq!(drive.topic("/robot_description"), (1, "std_msgs/msg/String".into()));
    assert_eq!(drive.topic("/path").1, "nav_msgs/msg/Path");
    assert_eq!(drive.facts["topics"].as_object().unwrap().len(), 10 + SENSORS);
}

#[test]
fn path_scan_points_and_description_say_the_same_as_the_rest() {
    let drive = drive();
    // The path ends within a step of the last pose.
    let (frame, poses, last): (String, usize, Vec<f64>) = serde_json::from_value(drive.facts["path"].clone()).unwrap();
    let end = floats(&drive.facts["pose"][2]);
    assert!(frame == "map" && poses > 50, "{frame} {poses}");
    assert!(libm::hypot(last[0] - end[0], last[1] - end[1]) < 0.06, "{last:?} {end:?}");
    // As many points as finite ranges, and each healthy sensor has its ray.
    let ranges: std::collections::BTreeMap<String, Vec<u64>> =
        serde_json::from_value(drive.facts["ranges"].clone()).unwrap();
    let finite: u64 = ranges.values().map(|counts| counts[0]).sum();
    assert_eq!(drive.facts["points"].as_u64().unwrap(), finite);
    assert!(drive.facts["rays"].as_object().unwrap().len() >= SENSORS - 8);
    let description = drive.facts["description"].as_str().unwrap();
    assert_eq!(description.matches("<joint ").count(), SENSORS);
}

#[test]
fn the_map_is_map_pgm_by_the_rules_of_map_server() {
    let drive = drive();
    let read = ask("map_server.py", &[&drive.folder.path().join("out/map.yaml")]);
    let [frame, width, height, resolution, origin, cells] = drive.facts["map"].as_array().unwrap().as_slice() else {
        panic!("{}", drive.facts["map"]);
    };
    assert_eq!(frame, "map");
    assert_eq!([width, height], [&read["size"][0], &read["size"][1]]);
    assert!((resolution.as_f64().unwrap() - read["size"][2].as_f64().unwrap()).abs() < 1e-8);
    let [x_m, y_m, yaw_rad] = floats(&read["origin"]).try_into().unwrap();
    assert!(near(pose(origin), Pose2::new(x_m, y_m, yaw_rad)), "{origin} {}", read["origin"]);
    // The bag has probabilities, the picture three classes.
    let class = |percent: i64| match percent {
        65..=100 => 100,
        0..=19 => 0,
        -1..65 => -1,
        _ => panic!("{percent}"),
    };
    let classes: Vec<i64> = whole(cells).into_iter().map(class).collect();
    assert_eq!(classes, whole(&read["cells"]));
    let count = |wanted: i64| classes.iter().filter(|class| **class == wanted).count();
    assert!(count(100) > 200 && count(0) > 2_000 && count(-1) > 1_000, "{} {}", count(100), count(0));
    assert_eq!(read["picture"][0], "PNG");
    assert!(read["picture"][1].as_u64() > Some(200) && read["picture"][2].as_u64() > Some(200), "{}", read["picture"]);
}

#[test]
fn the_last_pose_is_that_of_the_trajectory() {
    let drive = drive();
    assert_eq!(drive.file("poses.tum"), drive.file("out/trajectory.tum"));
    let (at_ns, last) = tum(drive.file("out/trajectory.tum").lines().last().unwrap());
    let [frame, stamp, place, covariance] = drive.facts["pose"].as_array().unwrap().as_slice() else { panic!() };
    assert_eq!((frame.as_str(), stamp.as_u64()), (Some("map"), Some(at_ns)));
    assert!(near(pose(place), last), "{place} {last:?}");
    let variances = [0, 7, 35].map(|place| floats(covariance)[place]);
    assert!(variances.iter().all(|variance| (1e-9..1e-2).contains(variance)), "{variances:?}");

    let table = drive.file("poses.csv");
    assert_eq!(table.lines().count(), 1 + drive.topic("/pose").0);
    let row: Vec<f64> = table.lines().last().unwrap().split(',').map(|word| word.parse().unwrap()).collect();
    assert!(near(Pose2::new(row[1], row[2], row[3]), last), "{row:?}");
    assert!(row[4..].iter().zip(variances).all(|(a, b)| (a / b - 1.0).abs() < 1e-3), "{row:?} {variances:?}");
}

#[test]
fn the_odometry_is_the_wheels_alone_and_says_how_well_it_knows() {
    let drive = drive();
    let (at_ns, last) = tum(drive.file("out/odometry.tum").lines().last().unwrap());
    let [frame, stamp, place, covariance, child, velocity, velocity_covariance] =
        drive.facts["odom"].as_array().unwrap().as_slice()
    else {
        panic!()
    };
    assert_eq!((frame.as_str(), child.as_str()), (Some("odom"), Some("base_link")));
    assert!(stamp.as_u64() == Some(at_ns) && near(pose(place), last), "{place} {last:?}");
    let [covariance, velocity_covariance] = [covariance, velocity_covariance].map(floats);
    assert!([0, 7, 35].iter().all(|&place| covariance[place] > 1e-6 && velocity_covariance[place] > 0.0));
    assert!([14, 21, 28].iter().all(|&place| covariance[place] == 0.0 && velocity_covariance[place] == 0.0));
    // What the wheels alone believe drifts off, and they know: the truth is within a few of their sigmas.
    let (_, map) = tum(drive.file("out/trajectory.tum").lines().last().unwrap());
    let (_, first) = tum(drive.file("out/trajectory.tum").lines().next().unwrap());
    let (_, began) = tum(drive.file("out/odometry.tum").lines().next().unwrap());
    let off_rad = (first * began.inverse() * last).inverse() * map;
    assert!(off_rad.theta_rad.abs() < 3.0 * covariance[35].sqrt(), "{off_rad:?} {}", covariance[35].sqrt());
    assert!(floats(velocity)[0].abs() < 0.6 && floats(velocity)[5].abs() < 2.5, "{velocity}");
}

#[test]
fn the_frames_are_one_tree_from_map_to_each_sensor() {
    let drive = drive();
    let frames = drive.facts["frames"].as_object().unwrap();
    assert_eq!(frames.len(), 2 + SENSORS);
    let parent = |frame: &str| frames[frame][0].as_str().unwrap();
    let transform = |frame: &str| pose(&frames[frame][2]);
    assert_eq!((parent("odom"), parent("base_link")), ("map", "odom"));
    assert_eq!(frames["odom"][1], frames["base_link"][1], "the last of both at one instant");
    let (_, last) = tum(drive.file("out/trajectory.tum").lines().last().unwrap());
    assert!(near(transform("odom") * transform("base_link"), last));
    for sensor in 0..SENSORS {
        let name = format!("sonar_{sensor}");
        assert_eq!(parent(&name), "base_link");
        let bearing_rad = std::f64::consts::TAU * sensor as f64 / SENSORS as f64;
        let turned = transform(&name) * Pose2::new(0.0, 0.0, -bearing_rad);
        assert!(turned.theta_rad.abs() < 1e-3, "{name} {turned:?}");
    }
}

#[test]
fn ranges_are_as_in_rep_117_and_faulty_sensors_measure_nothing() {
    let drive = drive();
    let faulty = drive.faulty();
    let (mut finite, mut clear) = (0, 0);
    for sensor in 0..SENSORS {
        let topic = format!("/sonar_{sensor}");
        let fields = drive.facts["fields"][&topic].as_array().unwrap();
        assert_eq!((fields[0].as_str().unwrap(), &fields[1]), (&topic[1..], &Value::from(0)));
        let [view_rad, least_m, most_m, variance] = [2, 3, 4, 5].map(|place| fields[place].as_f64().unwrap());
        assert!((0.1..1.2).contains(&view_rad) && variance == 0.0, "{view_rad}");
        assert!((least_m - 0.03).abs() < 1e-6 && (most_m - 3.0).abs() < 1e-6);
        let counts = whole(&drive.facts["ranges"][&topic]);
        let changes = drive.file("out/faults.csv").lines().filter(|line| line.contains(&format!(",{sensor},"))).count();
        // After the fault is declared, a faulty sensor has no ranges, and a healthy one has.
        if faulty.contains_key(&sensor) {
            assert!(counts[2] > 100, "{topic} {counts:?}");
            assert!(changes > 1 || counts[3] == 0, "{topic} {counts:?}");
        } else {
            assert!(counts[0] > 100, "{topic} {counts:?}");
        }
        if faulty.get(&sensor).is_some_and(|kind| kind == "missing") {
            assert_eq!(counts[..2], [0, 0], "{topic}");
        }
        finite += counts[0];
        clear += counts[1];
    }
    assert!(finite > 3_000 && clear > 100, "{finite} {clear}");
}

#[test]
fn diagnostics_name_the_faulty_sensors_and_why() {
    let drive = drive();
    let faulty = drive.faulty();
    println!("{faulty:?}");
    assert!([12, 13].iter().all(|sensor| faulty.get(sensor).is_some_and(|kind| kind == "missing")), "{faulty:?}");
    assert!(faulty.values().any(|kind| kind == "noisy") && faulty.len() >= 5, "{faulty:?}");
    let diagnostics = drive.facts["diagnostics"].as_object().unwrap();
    assert_eq!(diagnostics.len(), SENSORS + 2);
    for sensor in 0..SENSORS {
        let [level, message, robot, values] =
            diagnostics[&format!("slamd: sonar_{sensor}")].as_array().unwrap().as_slice()
        else {
            panic!()
        };
        let message = message.as_str().unwrap();
        assert_eq!(robot, "robot");
        match faulty.get(&sensor) {
            Some(kind) => {
                assert_eq!((level, &values["state"]), (&Value::from(2), &Value::from(kind.as_str())));
                assert!(message.contains(&format!("sensor {sensor} ")), "{message}");
            }
            None => assert_eq!((level, message), (&Value::from(0), "OK"), "{sensor}"),
        }
    }
    assert_eq!(diagnostics["slamd: wheel encoders"][0], 0);
    assert_eq!(diagnostics["slamd: localisation"][0], 0);
}

#[test]
fn nothing_is_written_over_and_a_failure_leaves_no_bag() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| {
        let output = slamd(folder.path(), arguments).output().unwrap();
        (output.status.code().unwrap(), String::from_utf8(output.stderr).unwrap())
    };
    std::fs::copy(root().join("replay/flat-emulated-mega.mcap"), folder.path().join("drive.mcap")).unwrap();
    let (code, text) = run(&["export", "drive.mcap"]);
    assert!(code == 64 && text.contains("--mcap"), "{text}");
    let (code, text) = run(&["export", "drive.mcap", "--mcap", "./drive.mcap"]);
    assert!(code == 64 && text.contains("would be written over"), "{text}");
    let (code, text) = run(&["export", "drive.mcap", "--csv", "a", "--tum", "a"]);
    assert!(code == 64 && text.contains("would be written over"), "{text}");
    let (code, text) = run(&["export", "drive.mcap", "--mcap", "nowhere/bag.mcap"]);
    assert!(code == 73 && text.contains("nowhere/bag.mcap") && text.contains("name a file"), "{text}");
    let (code, text) = run(&["export", "missing.mcap", "--mcap", "bag.mcap"]);
    assert!(code == 66 && text.contains("missing.mcap"), "{text}");
    std::fs::write(folder.path().join("garbage.mcap"), "this is no capture").unwrap();
    assert_eq!(run(&["export", "garbage.mcap", "--mcap", "bag.mcap"]).0, 65);
    assert!(!folder.path().join("bag.mcap").exists());
}
