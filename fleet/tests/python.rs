//! Tests a hub and a robot with a third-party client, Zenoh's Python package. It needs `python3` with
//! `venv`, and PyPI the first time.

#![allow(clippy::unwrap_used, reason = "a test may")]

mod drives;
#[expect(unreachable_pub, reason = "the file is a module of slamd-testkit, too")]
#[path = "../../crates/testkit/src/python.rs"]
mod python;

use drives::Drive;
use std::net::TcpListener;
use std::path::Path;
use std::process::{Child, Command, Stdio};

const ZENOH: &str = "eclipse-zenoh==1.10.2";
/// Half a minute of the robot's time: then there is a map.
const POSES: &str = "300";

/// A program that ends with the test.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn fleet(arguments: &[&str], folder: &Path) -> Running {
    let mut command = Command::new(env!("CARGO_BIN_EXE_slamd-fleet"));
    command.args(arguments).current_dir(folder).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    Running(command.spawn().unwrap())
}

#[test]
fn zenohs_own_python_hears_poses_and_fetches_the_map() {
    let python = python::python(env!("CARGO_TARGET_TMPDIR"), "zenoh", "zenoh", &[ZENOH]);
    let folder = tempfile::tempdir().unwrap();
    Drive { world: "flat", seed: 1, seconds: 120.0, at: None }.write(&folder.path().join("a.mcap"));
    std::fs::write(folder.path().join("fleet.toml"), "[robots.a]\n").unwrap();
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let at = format!("tcp/127.0.0.1:{port}");
    let hub = ["hub", "--site", "home", "--fleet", "fleet.toml", "--out", "site", "--listen", &at];
    let _hub = fleet(&hub, folder.path());
    let robot = ["robot", "--site", "home", "--name", "a", "--connect", &at, "--capture", "a.mcap", "--speed", "4"];
    let _robot = fleet(&robot, folder.path());
    // Both are there once the hub has a copy of the capture.
    let copies = folder.path().join("site/captures/a");
    let begun = (0..300).any(|_| {
        slamd_fleet::clock::wait(std::time::Duration::from_millis(100));
        copies.exists()
    });
    assert!(begun, "the hub has not heard the robot");
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/watch.py");
    let watch = ["-k", "1", "40", python.to_str().unwrap(), example.to_str().unwrap(), &at, "home", POSES];
    // The robot's liveliness may reach the hub after the first pieces of its capture: then the example is run again.
    let mut text = String::new();
    for _ in 0..3 {
        let out = Command::new("timeout").args(watch).output().unwrap();
        text = String::from_utf8_lossy(&out.stdout).into_owned();
        assert!(out.status.success(), "{text}{}", String::from_utf8_lossy(&out.stderr));
        if text.starts_with("alive ") {
            break;
        }
    }
    let lines: Vec<&str> = text.lines().collect();
    let [alive, poses @ .., map] = &lines[..] else { panic!("{text}") };
    assert_eq!(*alive, "alive slamd/home/a/alive");
    assert_eq!(poses.len().to_string(), POSES);
    assert!(poses.iter().all(|line| line.starts_with("slamd/home/a/pose ") && line.ends_with(" m")), "{text}");
    assert!(map.starts_with("slamd/home/a/map version 1, "), "{text}");
}
