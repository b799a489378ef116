//! The C header agrees with the golden vectors and with the settings' table.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd_protocol::Setting;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

fn here() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn program() -> PathBuf {
    let program = Path::new(env!("CARGO_TARGET_TMPDIR")).join("c_header");
    let done = Command::new("cc")
        .args(["-std=c99", "-Wall", "-Wextra", "-Werror", "-Wno-unused-function", "-fsanitize=undefined", "-I"])
        .args([here().join("include"), here().join("tests/c/header.c")])
        .arg("-o")
        .arg(&program)
        .status()
        .expect("a C compiler: install build-essential");
    assert!(done.success());
    program
}

fn run(input: &str) -> Vec<String> {
    let mut child = Command::new(program()).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    child.stdin.take().unwrap().write_all(input.as_bytes()).unwrap();
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success());
    String::from_utf8(output.stdout).unwrap().lines().map(str::to_owned).collect()
}

#[test]
fn the_header_holds_the_vectors_and_the_settings() {
    let mut frames = String::new();
    let mut expected: Vec<String> = Setting::ALL
        .iter()
        .map(|s| format!("setting {} {} {} {}", s.key(), s.range().start(), s.range().end(), s.default()))
        .collect();
    for path in std::fs::read_dir(here().join("vectors")).unwrap().map(|entry| entry.unwrap().path()) {
        if path.extension().is_some_and(|extension| extension == "toml") {
            let vector: toml::Table = toml::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
            let text = |key: &str| vector.get(key).and_then(toml::Value::as_str);
            let frame = text("frame").unwrap();
            // The header parses only the host's messages; the host rejects a board's bad ones.
            let of_board = ["sonar", "motion"].iter().any(|name| path.to_string_lossy().contains(name));
            if text("error") == Some("message") && of_board {
                continue;
            }
            frames.push_str(frame);
            frames.push('\n');
            expected.push(text("error").unwrap_or(frame).to_owned());
        }
    }
    assert!(expected.len() > 30);
    assert_eq!(run(&frames), expected);
}

#[test]
fn the_arduino_library_carries_the_same_header() {
    let text = |path: &str| std::fs::read_to_string(here().join(path)).unwrap();
    assert!(
        text("include/slamd_protocol.h") == text("firmware/src/slamd_protocol.h"),
        "cp protocol/include/slamd_protocol.h protocol/firmware/src/"
    );
}
