//! Every failure of the cable, on the real program, each with its words.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd_sim::link::LinkFaults;
use slamd_testkit::mock_port;
use slamd_testkit::mock_port::daemon::Daemon;
use slamd_testkit::mock_port::{Board, Device, Plugged, simulation};
use std::os::unix::fs::{MetadataExt as _, PermissionsExt as _};
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::Duration;

const SOON: Duration = Duration::from_secs(12);

/// A folder, the name of a port in it, and where the map goes.
struct Place {
    folder: tempfile::TempDir,
}

impl Place {
    fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    fn port(&self) -> PathBuf {
        self.folder.path().join("by-id-robot")
    }

    fn daemon(&self) -> Daemon {
        Daemon::start(self.port().to_str().unwrap(), &self.folder.path().join("out"))
    }

    /// The daemon on a port where this device sits.
    fn with(&self, board: Board) -> (Plugged, Daemon) {
        (Plugged::new(&self.port(), Device::new(board, 1)), self.daemon())
    }
}

#[test]
fn a_missing_port_is_named_and_found_when_it_comes() {
    let place = Place::new();
    let mut daemon = place.daemon();
    daemon.expect("link: searching (port missing: there is no", SOON);
    assert!(daemon.has_said("plug the board in, or see `slamd ports`"));
    let _robot = Plugged::new(&place.port(), Device::new(Board::robot(1), 1));
    daemon.expect("link: listening", SOON);
    daemon.expect("link: handshake (the board speaks at 115200 baud)", SOON);
    daemon.expect("link: streaming", SOON);
    daemon.end();
}

#[test]
fn a_missing_usb_device_is_named() {
    let place = Place::new();
    let mut daemon = Daemon::start("usb:ffff:fffe:nobody", &place.folder.path().join("out"));
    daemon.expect("link: searching (port missing: there is no usb:ffff:fffe:nobody; plug the board in", SOON);
    daemon.end();
}

#[test]
fn without_permission_the_group_is_named() {
    let place = Place::new();
    let _robot = Plugged::new(&place.port(), Device::new(Board::robot(1), 1));
    let device = std::fs::canonicalize(place.port()).unwrap();
    let chgrp = Command::new("chgrp").arg("dialout").arg(&device).status().unwrap().success();
    std::fs::set_permissions(&device, std::fs::Permissions::from_mode(0o060)).unwrap();
    // Root may open anything: it becomes nobody, with a copy of the program that nobody may run.
    let program = place.folder.path().join("slamd");
    std::fs::copy(env!("CARGO_BIN_EXE_slamd"), &program).unwrap();
    for path in [place.folder.path(), &program] {
        std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o777)).unwrap();
    }
    let mut command = Command::new(&program);
    if std::fs::metadata("/proc/self").unwrap().uid() == 0 {
        command = Command::new("setpriv");
        command.args(["--reuid=65534", "--regid=65534", "--clear-groups"]).arg(&program);
    }
    command.arg("--port").arg(&device).arg("--out").arg(place.folder.path().join("out"));
    let mut daemon = Daemon::run(command);
    daemon.expect("link: searching (permission denied: ", SOON);
    if chgrp {
        assert!(daemon.has_said("belongs to group dialout; run `sudo usermod -aG dialout $USER` and log in again"));
    }
    daemon.end();
}

#[test]
fn a_busy_port_names_its_holder() {
    let place = Place::new();
    let _robot = Plugged::new(&place.port(), Device::new(Board::robot(1), 1));
    let port = std::fs::File::open(place.port()).unwrap();
    let mut holder = Command::new("sleep").arg("60").stdin(Stdio::from(port)).spawn().unwrap();
    let mut daemon = place.daemon();
    daemon.expect(&format!("is held by sleep (pid {}); close it first)", holder.id()), SOON);
    assert!(daemon.has_said("link: searching (busy: "));
    holder.kill().unwrap();
    holder.wait().unwrap();
    daemon.expect("link: listening", SOON);
    daemon.end();
}

#[test]
fn silence_is_told_after_every_rate_was_tried() {
    let (_board, mut daemon) = Place::new().with_kept(Board::Silent);
    daemon.expect("link: listening (silence: nothing arrives at 115200 baud; trying other rates)", SOON);
    daemon.expect("silence: the board says nothing at any usual rate: is it powered", 2 * SOON);
    daemon.end();
}

#[test]
fn noise_leads_to_the_boards_baud_rate() {
    let place = Place::new();
    let _robot = Plugged::new(&place.port(), Device::new(Board::robot(1), 1).at_baud(500_000));
    let mut daemon = place.daemon();
    daemon.expect(
        "link: handshake (the board speaks at 500000 baud, not at 115200: start slamd with --baud 500000)",
        2 * SOON,
    );
    daemon.expect("link: streaming", SOON);
    daemon.end();
}

#[test]
fn noise_at_every_rate_is_told() {
    let place = Place::new();
    let _robot = Plugged::new(&place.port(), Device::new(Board::Text, 1).at_baud(31_250));
    let mut daemon = place.daemon();
    daemon.expect("link: listening (noise: bytes arrive but no valid frame at 115200 baud; trying other rates)", SOON);
    daemon.expect("noise: bytes arrive but no valid frame at any usual rate", 2 * SOON);
    daemon.end();
}

#[test]
fn another_firmware_is_quoted() {
    let (_board, mut daemon) = Place::new().with_kept(Board::Text);
    daemon.expect("link: listening (wrong firmware: the board prints \"Ping: 123 cm  Pong: 45 cm\"", SOON);
    assert!(daemon.has_said("flash protocol/firmware"));
    daemon.end();
}

#[test]
fn an_echoing_line_is_told() {
    let (_board, mut daemon) = Place::new().with_kept(Board::Echo);
    daemon.expect("the line echoes what slamd sends: the board's receive and transmit wires touch", SOON);
    daemon.end();
}

#[test]
fn a_protocol_mismatch_says_which_side_to_update() {
    for (major, words) in [(2, "slamd speaks 1: update slamd"), (0, "slamd speaks 1: update the board's firmware")] {
        let (_board, mut daemon) = Place::new().with_kept(Board::Speaks(major));
        daemon.expect("link: handshake (protocol mismatch: ", SOON);
        assert!(daemon.has_said(words));
        daemon.end();
    }
}

#[test]
fn a_board_that_restarts_again_and_again_is_told() {
    let robot = Box::new(simulation(1, LinkFaults::default(), 600.0));
    let (_board, mut daemon) = Place::new().with_kept(Board::Restarting(robot, Duration::from_secs(2)));
    daemon.expect("the board restarts again and again: its supply breaks down", 2 * SOON);
    daemon.end();
}

#[test]
fn a_line_that_falls_dead_is_stale_then_lost_then_well() {
    let (board, mut daemon) = Place::new().with_kept(Board::robot(1));
    daemon.expect("link: streaming", SOON);
    board.1.stall(true);
    daemon.expect("link: stale (no echoes for 0.5 s; silence: check the cable and the board's supply)", SOON);
    daemon.expect("link: lost (no echoes for 2 s; silence: check the cable and the board's supply)", SOON);
    board.1.stall(false);
    daemon.expect("link: streaming", SOON);
    daemon.end();
}

#[test]
#[expect(clippy::disallowed_methods, reason = "the robot drives in real time")]
fn map_and_pose_go_on_when_the_port_returns_under_another_name() {
    let place = Place::new();
    let (robot, mut daemon) = place.with(Board::robot(3));
    daemon.expect("link: streaming", SOON);
    std::thread::sleep(Duration::from_secs(5));
    let device = std::fs::canonicalize(place.port()).unwrap();
    // Opened while the old name is in use, so that its own is another.
    let elsewhere = mock_port::Terminal::open();
    let robot = robot.unplug();
    daemon.expect("is gone", SOON);
    let robot = Plugged::at(elsewhere, &place.port(), robot);
    assert_ne!(std::fs::canonicalize(place.port()).unwrap(), device);
    daemon.expect("link: streaming", SOON);
    std::thread::sleep(Duration::from_secs(4));
    daemon.end();
    drop(robot);
    let trajectory = std::fs::read_to_string(place.folder.path().join("out/trajectory.tum")).unwrap();
    let poses: Vec<[f64; 3]> = trajectory
        .lines()
        .filter(|line| !line.starts_with('#'))
        .map(|line| {
            line.split(' ').take(3).map(|number| number.parse().unwrap()).collect::<Vec<f64>>().try_into().unwrap()
        })
        .collect();
    assert!(poses.len() > 60, "{} poses", poses.len());
    for pair in poses.windows(2) {
        let way_m = (pair[1][1] - pair[0][1]).hypot(pair[1][2] - pair[0][2]);
        let seconds = pair[1][0] - pair[0][0];
        assert!(way_m < 0.1 + 0.6 * seconds, "{way_m} m in {seconds} s");
    }
}

impl Place {
    /// The same, where the folder must outlive the board.
    fn with_kept(self, board: Board) -> ((Self, Plugged), Daemon) {
        let (board, daemon) = self.with(board);
        ((self, board), daemon)
    }
}
