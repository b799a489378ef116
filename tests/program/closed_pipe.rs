//! Every command ends quietly when nobody reads it any more, as with `slamd ... 2>&1 | head -1`.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd_testkit::mock_port::{Board, Device, Plugged};
use std::process::{Command, Stdio};

/// Command lines that print to standard output, to standard error, or log.
const LINES: &[&str] = &[
    "--help",
    "run --help",
    "--version",
    "run",
    "run --no-such-option",
    "--port board --duration 1 --out live",
    "--port board --duration 1 --out live --log-format json",
    "--port nowhere --config nowhere.toml",
    "replay drive.mcap --out replayed",
    "replay drive.mcap --out replayed --json",
    "replay missing.mcap",
    "simulate --duration 1 --capture again.mcap",
    "inspect drive.mcap",
    "doctor --port board --duration 3",
    "doctor --capture drive.mcap",
    "doctor --capture drive.mcap --json",
    "setup --port board --timeout 3 --yes",
    "calibrate drive.mcap",
    "export drive.mcap --csv poses.csv",
    "import ring missing.csv --capture x.mcap",
    "monitor --capture drive.mcap",
    "ports",
    "config show",
    "config check bad.toml",
    "config schema",
    "completions bash",
    "man --out man",
    "bench accuracy world=room --seeds 101 --seconds 5",
];

#[test]
fn a_closed_pipe_is_no_failure() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("bad.toml"), "[robot]\nwheel_base_m = 99\n").unwrap();
    let slamd = |line: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_slamd"));
        command.args(line.split(' ')).current_dir(folder.path()).env("XDG_CONFIG_HOME", folder.path());
        command.stdin(Stdio::null());
        command
    };
    assert!(slamd("simulate --duration 20 --capture drive.mcap").output().unwrap().status.success());
    let _board = Plugged::new(&folder.path().join("board"), Device::new(Board::robot(1), 1));
    for line in LINES {
        let open = slamd(line).output().unwrap();
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let closed = slamd(line).stdout(writer.try_clone().unwrap()).stderr(writer).status().unwrap();
        assert_ne!(closed.code(), Some(101), "slamd {line} panics; with a reader: {open:?}");
        // Ended by a signal it would have written nothing.
        assert!(closed.code().is_some(), "slamd {line}: {closed}");
    }
    for file in ["replayed/map.png", "poses.csv", "man/slamd.1"] {
        assert!(folder.path().join(file).exists(), "{file} is missing");
    }
}

#[test]
fn an_output_that_is_lost_is_a_failure() {
    let folder = tempfile::tempdir().unwrap();
    let slamd = |line: &str, to: Stdio| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_slamd"));
        command.args(line.split(' ')).current_dir(folder.path()).env("XDG_CONFIG_HOME", folder.path());
        command.stdin(Stdio::null()).stdout(to).stderr(Stdio::piped()).output().unwrap()
    };
    assert!(slamd("simulate --duration 20 --capture drive.mcap", Stdio::null()).status.success());
    for line in [
        "--help",
        "--version",
        "inspect drive.mcap",
        "inspect drive.mcap --json",
        "config show",
        "ports",
        "doctor --capture drive.mcap --json",
        "replay drive.mcap --out replayed",
        "replay drive.mcap --out replayed --json",
    ] {
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let output = slamd(line, full.into());
        let error = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(74), "slamd {line}: {error}");
        assert!(error.contains("slamd: standard output: the disk is full"), "slamd {line}: {error}");
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let (open, closed) = (slamd(line, Stdio::null()), slamd(line, writer.into()));
        assert_eq!(closed.status, open.status, "slamd {line}: a closed pipe changes nothing");
        assert!(!String::from_utf8_lossy(&closed.stderr).contains("standard output"), "slamd {line}");
    }
    assert!(folder.path().join("replayed/map.png").exists());
}
