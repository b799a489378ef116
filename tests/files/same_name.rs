//! Two outputs of one command never have the same name, whichever options name them.

#![allow(clippy::unwrap_used, reason = "a test may")]

use std::path::Path;
use std::process::Command;

const SLAMD: &str = env!("CARGO_BIN_EXE_slamd");

/// The exit code and what the command says on standard error.
fn slamd(folder: &Path, line: &str) -> (i32, String) {
    let mut command = Command::new(SLAMD);
    command.args(line.split(' ')).current_dir(folder).env("XDG_CONFIG_HOME", "/nonexistent");
    let output = command.output().unwrap();
    (output.status.code().unwrap(), String::from_utf8_lossy(&output.stderr).into_owned())
}

/// The command is refused, and writes nothing.
fn refuses(folder: &Path, line: &str) {
    let names = || {
        let mut names: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        names.sort();
        names
    };
    let before = names();
    let (code, error) = slamd(folder, line);
    assert_eq!(code, 64, "{line}: {error}");
    assert!(error.contains("two outputs have this name"), "{line}: {error}");
    assert_eq!(names(), before, "{line}");
}

#[test]
fn a_session_does_not_replace_its_recording() {
    let folder = tempfile::tempdir().unwrap();
    let run = "--port nowhere --duration 0.1 --out o --record same.mcap";
    for option in ["--save-session same.mcap", "--session ./same.mcap", "--save-calibration same.mcap"] {
        refuses(folder.path(), &format!("{run} {option}"));
    }
    let (code, error) = slamd(folder.path(), &format!("{run} --save-session other.session"));
    assert_eq!(code, 0, "{error}");
}
