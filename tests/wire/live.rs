//! The daemon against a simulated board on a pseudo-terminal: what it recorded replays to the same bytes.

#![allow(clippy::unwrap_used, reason = "a test may")]

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

const SLAMD: &str = env!("CARGO_BIN_EXE_slamd");

fn hashes(folder: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(folder.join("summary.json")).unwrap();
    let lines: Vec<String> = text.lines().filter(|line| line.contains("sha256")).map(str::to_owned).collect();
    assert_eq!(lines.len(), 2, "{text}");
    lines
}

#[test]
#[expect(clippy::disallowed_methods, reason = "the pseudo-terminal appears when it appears")]
fn a_recording_replays_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    let (port, capture) = (folder.path().join("robot"), folder.path().join("live.mcap"));
    let (live, again) = (folder.path().join("live"), folder.path().join("again"));
    let mut board = Command::new(SLAMD)
        .args(["simulate", "--world", "flat", "--seed", "7", "--duration", "12", "--faults", "paper", "--pty"])
        .arg(&port)
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    for _ in 0..200 {
        if port.exists() {
            break;
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    let daemon = Command::new(SLAMD)
        .arg("--port")
        .arg(&port)
        .arg("--record")
        .arg(&capture)
        .arg("--out")
        .arg(&live)
        .arg("--exit-on-hangup")
        .output()
        .unwrap();
    assert!(board.wait().unwrap().success());
    assert!(daemon.status.success(), "{}", String::from_utf8_lossy(&daemon.stderr));
    let replay = Command::new(SLAMD).arg("replay").arg(&capture).arg("--out").arg(&again).output().unwrap();
    assert!(replay.status.success(), "{}", String::from_utf8_lossy(&replay.stderr));
    assert_eq!(hashes(&live), hashes(&again));
    let lines = std::fs::read_to_string(live.join("trajectory.tum")).unwrap().lines().count();
    assert!(lines > 60, "{lines} poses in 12 s");
}
