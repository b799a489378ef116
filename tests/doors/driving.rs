//! Who drives the robot, and when it stands: the real program and a simulated board in real time.

#![allow(clippy::unwrap_used, reason = "a test may")]

use serde_json::Value;
use slamd_protocol::{Drive, Message, WheelSpeeds, kind};
use slamd_testkit::driving::{Owner, STANDSTILL, dead_man, sent_drives, strangers};
use slamd_testkit::mock_port::{Board, Device, Plugged};
use slamd_testkit::served::{SOON, Served};
use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

const SLAMD: &str = env!("CARGO_BIN_EXE_slamd");
const READS: &str = "correct-horse-battery-staple";
const DRIVES: &str = "incorrect-donkey-charger-paperclip";

/// slamd with these options, streaming from a robot that stands.
fn streaming(options: &[&str]) -> (Served, Plugged) {
    let mut served = Served::new(options);
    let plugged = served.plug_in(Board::standing(1));
    served.daemon.expect("link: streaming", SOON);
    (served, plugged)
}

fn socket(served: &Served) -> Owner {
    Owner::new(&served.folder.path().join("api.sock"))
}

fn is_error(line: &Value, words: &str) -> bool {
    line["class"] == "ERROR" && line["message"].as_str().unwrap().contains(words)
}

/// The DRIVE frames that the host of a recording sent.
fn drives(capture: &Path) -> Vec<Drive> {
    let parsed = |payload: Vec<u8>| match Message::parse(kind::DRIVE, &payload) {
        Ok(Message::Drive(drive)) => drive,
        other => panic!("{other:?}"),
    };
    sent_drives(capture).into_iter().map(parsed).collect()
}

fn hashes(folder: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(folder.join("summary.json")).unwrap();
    text.lines().filter(|line| line.contains("sha256")).map(str::to_owned).collect()
}

#[test]
#[expect(clippy::disallowed_methods, reason = "the robot drives in real time")]
fn a_driven_session_holds_each_command_and_its_source_and_replays_bit_for_bit() {
    let (served, plugged) = streaming(&["--socket", "api.sock", "--drive", "--record", "drive.mcap"]);
    let mut owner = socket(&served);
    // Without a way to see, the turn begins the map.
    for _ in 0..60 {
        assert_eq!(owner.turn()["class"], "DRIVE");
        std::thread::sleep(Duration::from_millis(100));
    }
    let answer = owner.ask("?DRIVE={\"forward_m_s\":5.0,\"for_ms\":100};");
    assert_eq!(
        (&answer["forward_m_s"], &answer["for_ms"]),
        (&Value::from(0.2), &Value::from(100)),
        "within the limits"
    );
    assert_eq!(answer["motors"], "driving");
    std::thread::sleep(Duration::from_secs(1));
    let stopped = owner.ask("?STOP;");
    assert_eq!((&stopped["class"], &stopped["for_ms"]), (&Value::from("DRIVE"), &Value::from(0)));
    assert!(plugged.peak_m_s() > 0.1, "{} m/s", plugged.peak_m_s());
    drop((owner, plugged));
    let folder = served.folder;
    served.daemon.end();
    let drives = drives(&folder.path().join("drive.mcap"));
    assert!(drives.len() > 60 && drives.iter().all(|drive| drive.source() == Drive::FROM_SOCKET), "{}", drives.len());
    let again = folder.path().join("again");
    let replay = Command::new(SLAMD)
        .arg("replay")
        .arg(folder.path().join("drive.mcap"))
        .arg("--out")
        .arg(&again)
        .output()
        .unwrap();
    assert!(replay.status.success() || replay.status.code() == Some(75), "{}", String::from_utf8_lossy(&replay.stderr));
    assert_eq!(hashes(&folder.path().join("out")), hashes(&again));
    assert_eq!(hashes(&again).len(), 2);
}

#[test]
#[expect(clippy::disallowed_methods, reason = "the end is a moment in real time")]
fn one_drives_at_a_time_and_the_robot_stops_when_its_driver_goes() {
    let folder = tempfile::tempdir().unwrap();
    let token = |name: &str, word: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, word).unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o600)).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let (reads, may_drive) = (token("reads", READS), token("drives", DRIVES));
    let mut options = vec!["--listen", "127.0.0.1:0", "--socket", "api.sock", "--record", "drive.mcap", "--drive"];
    options.extend(["--token-file", &reads, "--drive-token-file", &may_drive]);
    let mut served = Served::new(&options);
    let address = served.address();
    let plugged = served.plug_in(Board::standing(1));
    served.daemon.expect("link: streaming", SOON);
    let mut reader = Served::client(&address);
    reader.ask(&format!("?TOKEN=\"{READS}\";\n?DRIVE={{\"turn_rad_s\":1}};\n?STOP;"));
    assert_eq!(reader.next_line().unwrap()["class"], "VERSION");
    assert!((0..2).all(|_| is_error(&reader.next_line().unwrap(), "may only read")));
    // The driver's token opens the door, too.
    let mut driver = Served::client(&address);
    driver.ask(&format!("?TOKEN=\"{DRIVES}\";\n?DRIVE={{\"turn_rad_s\":1,\"for_ms\":1000}};"));
    assert_eq!(driver.next_line().unwrap()["class"], "VERSION");
    assert_eq!(driver.next_line().unwrap()["class"], "DRIVE");
    let mut owner = socket(&served);
    assert!(is_error(&owner.turn(), "a client with the drive token drives"));
    std::thread::sleep(Duration::from_millis(500));
    assert!(plugged.peak_m_s() > 0.05);
    let gone = Instant::now();
    drop(driver);
    std::thread::sleep(Duration::from_secs(1));
    let turned = plugged.turned_after(gone);
    assert!(turned < STANDSTILL + plugged.late(), "{turned:?}");
    assert_eq!(owner.turn()["class"], "DRIVE", "the helm is free");
    let folder = served.folder;
    served.daemon.end();
    drop(plugged);
    let drives = drives(&folder.path().join("drive.mcap"));
    assert!([Drive::FROM_TOKEN, Drive::FROM_SOCKET].iter().all(|source| drives.iter().any(|d| d.source() == *source)));
    // The end of the program stopped the robot.
    assert_eq!(drives.last().unwrap().speeds(), WheelSpeeds::ZERO);
}

#[test]
fn without_the_option_a_door_and_a_board_that_drives_nothing_moves() {
    let refused = |options: &[&str]| {
        let output = Command::new(SLAMD).args(["--port", "nowhere", "--drive"]).args(options).output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    let (code, text) = refused(&[]);
    assert!(code == Some(64) && text.contains("nobody could drive"), "{text}");
    let (served, plugged) = streaming(&["--socket", "api.sock"]);
    assert!(is_error(&socket(&served).turn(), "slamd runs without --drive"));
    drop(plugged);
    served.daemon.end();
    // A link that does not stream, also before the port was found.
    let mut served = Served::new(&["--socket", "api.sock", "--drive"]);
    served.address();
    let mut owner = socket(&served);
    assert!(is_error(&owner.turn(), "not streaming"));
    let silent = Plugged::new(&served.board(), Device::new(Board::Silent, 1));
    served.daemon.expect("link: listening", SOON);
    assert!(is_error(&owner.turn(), "not streaming"));
    drop(silent);
    served.daemon.end();
}

#[test]
fn the_robot_stands_in_time_when_slamd_is_killed_or_hangs_or_its_cable_is_cut() {
    let stops = dead_man(6, 1, || ());
    println!("{stops:?}");
    assert_eq!(stops.len(), 6);
    assert!(stops.iter().all(|stop| stop.turned <= STANDSTILL + stop.late), "{stops:?}");
}

#[test]
fn nobody_else_drives() {
    let strangers = strangers(240, 1, || ());
    println!("{strangers:?}");
    assert!(strangers.peak_m_s[0] == 0.0 && strangers.drives == 0, "{strangers:?}");
    assert!(strangers.refused > 120, "{strangers:?}");
}
