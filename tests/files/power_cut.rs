//! What a live run has written when its power is cut, and how it ends when its terminal is closed.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd_testkit::mock_port::daemon::Daemon;
use slamd_testkit::mock_port::{Board, Device, Plugged};
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

fn daemon(port: &Path, folder: &Path) -> Daemon {
    let mut command = Command::new(env!("CARGO_BIN_EXE_slamd"));
    command.arg("--port").arg(port).arg("--out").arg(folder.join("out"));
    command.arg("--save-session").arg(folder.join("home.session")).args(["--viewer", "off"]);
    Daemon::run(command)
}

/// Waits until a file is there.
#[expect(clippy::disallowed_methods, reason = "the test waits in real time")]
fn wait_for(path: &Path) {
    let end = Instant::now() + Duration::from_secs(60);
    while !path.exists() {
        assert!(Instant::now() < end, "there is no {}", path.display());
        std::thread::sleep(Duration::from_millis(50));
    }
}

#[test]
fn a_power_cut_costs_ten_seconds() {
    let folder = tempfile::tempdir().unwrap();
    let (out, port) = (folder.path().join("out"), folder.path().join("board"));
    let _robot = Plugged::new(&port, Device::new(Board::robot(1), 1));
    let mut daemon = daemon(&port, folder.path());
    daemon.expect("poses and map begin", Duration::from_secs(60));
    wait_for(&out.join("config.toml"));
    wait_for(&folder.path().join("home.session"));
    // SIGKILL.
    drop(daemon);
    let trajectory = std::fs::read_to_string(out.join("trajectory.tum")).unwrap();
    let poses: Vec<f64> = trajectory.lines().map(|line| line.split(' ').next().unwrap().parse().unwrap()).collect();
    assert!(trajectory.ends_with('\n') && poses.len() > 20, "{} poses", poses.len());
    for name in ["map.pgm", "map.png", "map.yaml", "odometry.tum", "faults.csv", "lock.csv"] {
        assert!(out.join(name).exists(), "there is no {name}");
    }
    assert!(std::fs::metadata(out.join("map.pgm")).unwrap().len() > 1_000);
    assert!(!out.join("summary.json").exists(), "the run has not ended");
    slamd::session_file::read(&folder.path().join("home.session")).unwrap();
    // What the killed run has left under temporary names goes, its map stays.
    let map = std::fs::read(out.join("map.pgm")).unwrap();
    let replay = Command::new(env!("CARGO_BIN_EXE_slamd"))
        .args(["replay", concat!(env!("CARGO_MANIFEST_DIR"), "/replay/flat-emulated-mega.mcap"), "--out"])
        .arg(&out)
        .output()
        .unwrap();
    assert_eq!(replay.status.code(), Some(73), "{}", String::from_utf8_lossy(&replay.stderr));
    assert_eq!(std::fs::read(out.join("map.pgm")).unwrap(), map);
    let parts = std::fs::read_dir(&out)
        .unwrap()
        .filter(|entry| entry.as_ref().unwrap().file_name().to_string_lossy().ends_with(".part"));
    assert_eq!(parts.count(), 0);
}

#[test]
fn a_closed_terminal_ends_a_run_as_sigterm_does() {
    let folder = tempfile::tempdir().unwrap();
    let port = folder.path().join("board");
    let _robot = Plugged::new(&port, Device::new(Board::robot(1), 1));
    let mut daemon = daemon(&port, folder.path());
    daemon.expect("link: streaming", Duration::from_secs(60));
    assert!(Command::new("kill").args(["-HUP", &daemon.pid().to_string()]).status().unwrap().success());
    daemon.wait();
    assert!(folder.path().join("out/summary.json").exists());
}

#[test]
fn two_runs_in_one_folder_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let port = folder.path().join("board");
    let _robot = Plugged::new(&port, Device::new(Board::robot(1), 1));
    let mut daemon = daemon(&port, folder.path());
    daemon.expect("link: streaming", Duration::from_secs(60));
    let replay = Command::new(env!("CARGO_BIN_EXE_slamd"))
        .args(["replay", concat!(env!("CARGO_MANIFEST_DIR"), "/replay/flat-emulated-mega.mcap"), "--force", "--out"])
        .arg(folder.path().join("out"))
        .output()
        .unwrap();
    let error = String::from_utf8_lossy(&replay.stderr);
    assert!(replay.status.code() == Some(73) && error.contains("another slamd is writing"), "{error}");
    daemon.end();
}
