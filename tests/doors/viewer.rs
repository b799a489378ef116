//! What the real viewer shows of a session, and that no viewer ever blocks mapping.
//!
//! The tests make a Python environment in Cargo's target folder: they need `python3` with `venv`, PyPI the first time, and a Vulkan driver
//! such as Debian's mesa-vulkan-drivers. Screenshots stay in `target/viewer/`.

#![allow(clippy::unwrap_used, reason = "a test may")]
#![cfg(feature = "viewer")]

mod real;

use real::{FAULTY, FREE, ODOMETRY, PATH, Shot, UNKNOWN, Viewer, WALL, free_port};
use slamd::source::replay::replay;
use slamd::source::session::Session;
use slamd_capture::CaptureReader;
use slamd_core::Config;
use slamd_testkit::mock_port::daemon::Daemon;
use slamd_testkit::mock_port::{Board, Device, Plugged};
use slamd_testkit::served::Served;
use slamd_viewer::Identity;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;
use std::time::{Duration, Instant};

const SIZE: &str = "1600x900";
/// Maximum time from the signal to the end of a process.
const END: Duration = Duration::from_secs(2);
/// What a session with a viewer may take at most, KiB.
const MAX_KIB: u64 = 300_000;
/// Sweeps of a session after which the queue of a viewer that takes nothing is full: it holds 256 updates.
const MORE_THAN_QUEUED: u64 = 300;
/// Sweeps during which a stopped viewer takes nothing.
const AFTER_STOP: u64 = 100;
/// Viewers on a software rasteriser want the machine for themselves.
static MACHINE: Mutex<()> = Mutex::new(());

fn capture() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("replay/flat-paper-faults.mcap")
}

/// The map's floor and the robot's path are in it: enough of them, and not too much.
fn has_map(shot: &Shot) -> bool {
    (20_000..600_000).contains(&shot.count(FREE)) && (300..100_000).contains(&shot.count(PATH))
}

/// Prints each entity's rows: path, count.
const ROWS: &str = r"
import sys
from collections import Counter
from rerun.experimental import RrdReader
rows = Counter()
for chunk in RrdReader(sys.argv[1]).stream():
    rows[str(chunk.entity_path)] += chunk.num_rows
for path, count in sorted(rows.items()):
    print(path, count)
";

/// The picture in the README is rewritten by `WRITE_GOLDEN=1 cargo test --test doors picture`.
#[test]
fn a_recording_is_whole_and_its_picture_shows_map_and_robot() {
    let _machine = MACHINE.lock();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("drive.rrd");
    let mut command = Command::new(env!("CARGO_BIN_EXE_slamd"));
    command.arg("replay").arg(capture()).arg("--out").arg(folder.path().join("out")).arg("--viewer").arg(&file);
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));

    real::rrd("verify", &file);
    assert!(real::rrd("stats", &file).contains("num_rows"));
    let sweeps = std::fs::read_to_string(folder.path().join("out/trajectory.tum")).unwrap().lines().count();
    let rows = real::python(ROWS, &file);
    let count = |path: &str| -> usize {
        let line =
            rows.lines().find(|line| line.split(' ').next() == Some(path)).unwrap_or_else(|| panic!("{path}: {rows}"));
        line.split(' ').nth(1).unwrap().parse().unwrap()
    };
    // A replay waits for its viewers, so nothing is dropped.
    assert_eq!(count("/map/odom/base_link"), sweeps, "one transform per pose");
    assert_eq!(count("/map/odom"), sweeps);
    assert_eq!(count("/map/covariance"), sweeps);
    assert!(count("/map/odom/base_link/echoes") >= sweeps, "beams are there before the first pose");
    assert!((100..=250).contains(&count("/map/grid")), "once a second where it changes: {}", count("/map/grid"));
    assert!(count("/map/walls") > 100, "{rows}");
    for path in ["/map/path/truth/000", "/map/odom/base_link/sonar_31", "/series/nis", "/state/sonar_12", "/log"] {
        assert!(count(path) > 0);
    }

    let viewer = Viewer::start(free_port(), SIZE, file.to_str());
    let shot = viewer.shows("replay.png", |shot| {
        let is_map = has_map(shot) && shot.count(UNKNOWN) > 20_000;
        is_map && shot.count(ODOMETRY) > 500 && shot.count(FAULTY) > 100 && shot.count(WALL) > 300
    });
    println!("{}: {}", shot.path.display(), shot.census());
    if std::env::var_os("WRITE_GOLDEN").is_some() {
        std::fs::copy(&shot.path, Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/viewer.png")).unwrap();
    }
}

/// A robot on a port, slamd with viewers, and the address of its API.
fn watched(folder: &Path, viewers: &[String]) -> (Plugged, Daemon, String) {
    let port = folder.join("robot");
    let robot = Plugged::new(&port, Device::new(Board::robot(3), 3));
    let mut command = Command::new(env!("CARGO_BIN_EXE_slamd"));
    command.arg("--port").arg(&port).arg("--out").arg(folder.join("out")).args(["--listen", "127.0.0.1:0"]);
    for viewer in viewers {
        command.arg("--viewer").arg(viewer);
    }
    let mut daemon = Daemon::run(command);
    let (_, line) = daemon.line("api: listening at", Duration::from_secs(10));
    let address = line.rsplit(' ').next().unwrap().to_owned();
    daemon.expect("link: streaming", Duration::from_secs(10));
    (robot, daemon, address)
}

/// Ends slamd, in time.
#[expect(clippy::disallowed_methods, reason = "the test measures in real time")]
fn end(daemon: Daemon) {
    let resident = daemon.resident_kib();
    assert!(resident < MAX_KIB, "{resident} KiB");
    let begin = Instant::now();
    daemon.end();
    let elapsed = begin.elapsed();
    println!("{resident} KiB, ended within {elapsed:?}");
    assert!(elapsed < END, "{elapsed:?}");
}

#[test]
fn returning_and_late_viewers_show_the_full_map() {
    let _machine = MACHINE.lock();
    let folder = tempfile::tempdir().unwrap();
    let (visited, served) = (free_port(), free_port());
    let first = Viewer::start(visited, SIZE, None);
    let viewers = [format!("connect=127.0.0.1:{visited}"), format!("serve={served}")];
    let (_robot, mut daemon, _) = watched(folder.path(), &viewers);
    first.shows("first.png", has_map);
    drop(first);
    daemon.expect("is gone", Duration::from_secs(10));
    let second = Viewer::start(visited, SIZE, None);
    second.shows("returned.png", has_map);
    drop(second);
    let url = format!("rerun+http://127.0.0.1:{served}/proxy");
    let late = Viewer::start(free_port(), SIZE, Some(&url));
    late.shows("late.png", has_map);
    end(daemon);
}

#[test]
fn stalled_and_absent_viewers_never_block_mapping() {
    let _machine = MACHINE.lock();
    let folder = tempfile::tempdir().unwrap();
    // Accepts, and never reads.
    let deaf = TcpListener::bind("127.0.0.1:0").unwrap();
    let (deaf_port, nobody, frozen_port) = (deaf.local_addr().unwrap().port(), free_port(), free_port());
    let frozen = Viewer::start(frozen_port, "640x400", None);
    let file = folder.path().join("drive.rrd");
    let mut viewers = [deaf_port, nobody, frozen_port].map(|port| format!("connect=127.0.0.1:{port}")).to_vec();
    viewers.push(file.display().to_string());
    let (robot, mut daemon, address) = watched(folder.path(), &viewers);
    daemon.expect(&format!("shown at rerun+http://127.0.0.1:{frozen_port}"), Duration::from_secs(30));
    frozen.signal("STOP");
    let mut watcher = Served::client(&address);
    watcher.ask("?WATCH={\"sweep_hz\":50,\"pose_hz\":0};");
    let mut sweep = || watcher.expect("SWEEP")["sweep"].as_u64().unwrap();
    let enough = MORE_THAN_QUEUED.max(sweep() + AFTER_STOP);
    while sweep() < enough {}
    assert_eq!(robot.lost_bytes(), 0, "slamd reads in time");
    end(daemon);
    frozen.signal("CONT");
    real::rrd("verify", &file);
    assert!(real::rrd("stats", &file).contains("/map/odom/base_link"), "one sink does not stop the other");
}

#[test]
#[expect(clippy::disallowed_methods, reason = "the test measures in real time")]
fn updates_that_a_viewer_does_not_take_are_dropped_and_counted() {
    let folder = tempfile::tempdir().unwrap();
    let deaf = TcpListener::bind("127.0.0.1:0").unwrap();
    let host = deaf.local_addr().unwrap().to_string();
    let identity = Identity { recording: "test".into(), name: "test".into(), unix_zero_us: None };
    let mut viewer = slamd_viewer::Viewer::new(identity, false);
    viewer.connect(&format!("rerun+http://{host}/proxy"), &host);
    let mut capture = CaptureReader::open(&capture()).unwrap();
    let config = Config::from_toml(&capture.info().config_toml).unwrap();
    let mut session =
        Session::new(slamd_paper::pipeline(&config, slamd_core::Start::Fresh).unwrap(), folder.path()).unwrap();
    session.watch(viewer.watcher().expect("a sink"));
    replay(&mut capture, &mut session, |_| ()).unwrap();
    assert_eq!(session.finish().unwrap().0.sweeps, 2_396);
    assert!(viewer.dropped() > 1_000, "{}", viewer.dropped());
    let begin = Instant::now();
    viewer.finish(Duration::from_millis(500));
    assert!(begin.elapsed() < END);
}

#[test]
fn a_port_in_use_is_reported_and_the_session_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = folder.path().join("robot");
    let _robot = Plugged::new(&port, Device::new(Board::robot(4), 4));
    let mut command = Command::new(env!("CARGO_BIN_EXE_slamd"));
    command.arg("--port").arg(&port).arg("--out").arg(folder.path().join("out"));
    command.arg("--viewer").arg(format!("serve={}", taken.local_addr().unwrap()));
    let mut daemon = Daemon::run(command);
    daemon.expect("nothing is served", Duration::from_secs(10));
    daemon.expect("link: streaming", Duration::from_secs(10));
    end(daemon);
}

/// A `rerun` that only writes down how it was called.
fn stand_in(folder: &Path) -> PathBuf {
    use std::os::unix::fs::PermissionsExt as _;
    let (program, called) = (folder.join("rerun"), folder.join("called"));
    std::fs::write(&program, format!("#!/bin/sh\necho $$ \"$@\" >> {}\nexec sleep 60\n", called.display())).unwrap();
    std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).unwrap();
    called
}

#[test]
fn the_installed_viewer_is_opened_and_what_serves_browsers_is_closed_again() {
    let folder = tempfile::tempdir().unwrap();
    let called = stand_in(folder.path());
    let (name, port) = (folder.path().join("robot"), free_port());
    let _robot = Plugged::new(&name, Device::new(Board::robot(4), 4));
    let mut command = Command::new(env!("CARGO_BIN_EXE_slamd"));
    command.arg("--port").arg(&name).arg("--out").arg(folder.path().join("out"));
    command.args(["--viewer", &format!("serve={port}"), "--viewer", "spawn", "--viewer", "web"]);
    command.env("PATH", format!("{}:{}", folder.path().display(), std::env::var("PATH").unwrap()));
    let mut daemon = Daemon::run(command);
    daemon.expect("in a browser at http://127.0.0.1:", Duration::from_secs(10));
    daemon.expect("link: streaming", Duration::from_secs(10));
    end(daemon);
    let calls = std::fs::read_to_string(called).unwrap();
    let url = format!("rerun+http://127.0.0.1:{port}/proxy");
    let runs = |words: &str| {
        let call = calls.lines().find(|call| call.contains(words)).unwrap_or_else(|| panic!("{words}: {calls}"));
        assert!(call.ends_with(&url), "{call}");
        let id = call.split(' ').next().unwrap();
        let runs = Path::new("/proc").join(id).exists();
        let _ = Command::new("kill").arg(id).status();
        runs
    };
    assert!(runs("--port auto"), "a window stays");
    assert!(!runs("--serve-web"));
}
