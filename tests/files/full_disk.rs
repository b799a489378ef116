//! The real program on a disk that is full for a while: it maps on, says so, and the recording lacks nothing.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd_testkit::mock_port::daemon::Daemon;
use slamd_testkit::mock_port::{Board, Device, Plugged};
use slamd_testkit::served::get;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

const SLAMD: &str = env!("CARGO_BIN_EXE_slamd");
const SOON: Duration = Duration::from_secs(20);

/// A program that sees a small disk of its own at DISK, with most of it taken; when it has ended, what it left is copied to KEPT.
const ON_A_SMALL_DISK: &str = "mount -t tmpfs -o size=800k small \"$DISK\" && head -c 700k /dev/zero >\"$DISK/ballast\" && \
    \"$@\" && cp -r \"$DISK/.\" \"$KEPT\"";

fn may_mount() -> bool {
    Command::new("unshare").args(["-rm", "mount", "-t", "tmpfs", "small", "/mnt"]).status().is_ok_and(|s| s.success())
}

fn hashes(folder: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(folder.join("summary.json")).unwrap();
    text.lines().filter(|line| line.contains("sha256")).map(str::to_owned).collect()
}

#[test]
fn a_full_disk_blocks_nothing_and_loses_nothing() {
    if !may_mount() {
        println!(
            "skipped: this machine lets nobody mount a small disk; tests/files/recording.rs has the same with a disk in memory"
        );
        return;
    }
    let place = tempfile::tempdir().unwrap();
    let [disk, kept, port] = ["disk", "kept", "port"].map(|name| place.path().join(name));
    for folder in [&disk, &kept] {
        std::fs::create_dir(folder).unwrap();
    }
    let _robot = Plugged::new(&port, Device::new(Board::robot(1), 1));
    let mut command = Command::new("unshare");
    command.env("DISK", &disk).env("KEPT", &kept).args(["-rm", "sh", "-ec", ON_A_SMALL_DISK, "sh", SLAMD, "--port"]);
    command.arg(&port).args(["--duration", "25", "--record-free-mib", "0"]);
    command.arg("--record").arg(disk.join("drive.mcap")).arg("--out").arg(disk.join("out"));
    command.args(["--metrics", "127.0.0.1:0"]);
    if cfg!(feature = "viewer") {
        command.args(["--viewer", "off"]);
    }
    let mut daemon = Daemon::run(command);
    let (_, listening) = daemon.line("api: listening at http://", SOON);
    let address = listening.rsplit('/').next().unwrap().to_owned();
    let well = get(&address, "/metrics", "");
    assert!(well.contains("\nslamd_disk_failing 0\n") && well.contains("\nslamd_recording_errors_total 0\n"), "{well}");
    daemon.expect("drive.mcap: No space left on device (os error 28); mapping continues", SOON);
    daemon.expect("trajectory.tum: No space left on device (os error 28); it waits in memory", SOON);
    // Mapping goes on, and the pages know the disk.
    let health = get(&address, "/healthz", "");
    assert!(health.starts_with("HTTP/1.1 200 ") && health.contains("\ndisk: recording: "), "{health}");
    let metrics = get(&address, "/metrics", "");
    assert!(metrics.contains("\nslamd_disk_failing 1\n"), "{metrics}");
    assert!(!metrics.contains("\nslamd_recording_errors_total 0\n"), "{metrics}");
    std::fs::remove_file(format!("/proc/{}/root{}", daemon.pid(), disk.join("ballast").display())).unwrap();
    daemon.expect("recording continues after", SOON);
    assert!(daemon.has_said("nothing is missing"));
    daemon.wait();
    let again = place.path().join("again");
    let replay =
        Command::new(SLAMD).arg("replay").arg(kept.join("drive.mcap")).arg("--out").arg(&again).output().unwrap();
    assert!(replay.status.success(), "{}", String::from_utf8_lossy(&replay.stderr));
    assert_eq!(hashes(&kept.join("out")), hashes(&again), "the recording is what was mapped");
}

/// A program that sees a disk of its own at DISK, too small for what it shall write; a list of what it left goes to LIST.
const ON_A_TINY_DISK: &str =
    "mount -t tmpfs -o size=300k tiny \"$DISK\"; \"$@\"; code=$?; ls -A \"$DISK\" >\"$LIST\"; exit $code";

#[test]
fn every_lost_file_is_named_the_recording_first() {
    if !may_mount() {
        println!("skipped: this machine lets nobody mount a small disk");
        return;
    }
    let place = tempfile::tempdir().unwrap();
    let [disk, list, port] = ["m", "list", "port"].map(|name| place.path().join(name));
    std::fs::create_dir(&disk).unwrap();
    let _robot = Plugged::new(&port, Device::new(Board::robot(1), 1));
    let run = |options: &[&str]| {
        let mut command = Command::new("unshare");
        command.env("DISK", &disk).env("LIST", &list).env("XDG_CONFIG_HOME", "/nonexistent").current_dir(place.path());
        command
            .args(["-rm", "sh", "-c", ON_A_TINY_DISK, "sh", SLAMD, "--port", "port", "--duration", "14"])
            .args(options);
        if cfg!(feature = "viewer") {
            command.args(["--viewer", "off"]);
        }
        let output = command.output().unwrap();
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        (output.status.code().unwrap(), error, std::fs::read_to_string(&list).unwrap())
    };
    // 100 MiB must stay free, so that nothing is recorded; and the map has no room.
    let (code, error, left) = run(&["--record", "m/d.mcap", "--out", "m/ro", "--save-session", "m/home.session"]);
    assert_eq!(code, 74, "{error}");
    assert!(!left.contains("d.mcap"), "{left}");
    let line_of =
        |text: &str| error.lines().position(|line| line.contains(text)).unwrap_or_else(|| panic!("{text}: {error}"));
    let recording = line_of("m/d.mcap: 0 MiB are free, and 100 must stay free: the recording is lost");
    if !left.contains("home.session") {
        assert!(recording < line_of("m/home.session: "), "{error}");
    }
    if error.contains("m/ro: lost: ") {
        let last = error.lines().last().unwrap();
        assert!(last.contains("summary.json") && last.contains("the disk is full"), "{error}");
        assert!(recording < line_of("m/ro: lost: "), "{error}");
    }
    // A recording that has begun is not gone, but the run did not go well.
    let (code, error, left) = run(&["--record", "m/d.mcap", "--record-free-mib", "0", "--out", "m/ro"]);
    assert!(left.contains("d.mcap"), "{left}");
    assert!(code == 73 || code == 74, "{code}: {error}");
    println!("{error}");
}
