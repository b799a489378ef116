//! The systemd unit: systemd understands it, it leaves little open, and what it starts is what the program takes.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd::cli::Kind;
use std::process::{Command, Output};

const UNIT: &str = include_str!("../../configs/systemd/slamd.service");
/// Where the unit expects the program: wherever systemd finds it, /usr/local/bin before /usr/bin.
const PROGRAM: &str = "ExecStart=slamd ";
/// Tenths of systemd's measure of exposure, from 0 to 100. What is left: serial ports, their group, and sockets in a network of its own.
const MAX_EXPOSED: &str = "15";

/// What `systemd-analyze` says of a unit whose program is there; none where there is no systemd.
fn analyze(unit: &str, arguments: &[&str]) -> Option<Output> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("slamd.service");
    assert!(unit.contains(PROGRAM));
    let built = format!("ExecStart={} ", env!("CARGO_BIN_EXE_slamd"));
    std::fs::write(&path, unit.replace(PROGRAM, &built)).unwrap();
    match Command::new("systemd-analyze").args(arguments).arg(&path).env("SYSTEMD_COLORS", "0").output() {
        Ok(output) => Some(output),
        Err(error) => {
            println!("not tested: systemd-analyze cannot be run ({error}); Debian's package is systemd");
            None
        }
    }
}

/// What systemd has to say against a unit.
fn complaints(unit: &str) -> Option<String> {
    let output = analyze(unit, &["verify", "--man=no", "--recursive-errors=no"])?;
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success() || !text.is_empty(), "a failure without words");
    Some(text)
}

#[test]
fn systemd_understands_every_line() {
    let Some(found) = complaints(UNIT) else { return };
    assert_eq!(found, "");
    let misspelt = UNIT.replace("NoNewPrivileges=", "NoNewPrivilege=");
    assert!(complaints(&misspelt).unwrap().contains("NoNewPrivilege"), "a misspelt key is not noticed");
}

#[test]
fn the_service_is_sandboxed() {
    let arguments = ["security", "--offline=true", "--no-pager", &format!("--threshold={MAX_EXPOSED}")];
    let Some(output) = analyze(UNIT, &arguments) else { return };
    let report = String::from_utf8_lossy(&output.stdout);
    println!("{}", report.lines().last().unwrap_or_default());
    assert!(output.status.success(), "{report}{}", String::from_utf8_lossy(&output.stderr));
    let open = UNIT.replace("SystemCallFilter=", "#").replace("ProtectSystem=strict", "ProtectSystem=no");
    assert!(!analyze(&open, &arguments).unwrap().status.success(), "an open unit is not noticed");
}

fn setting(key: &str) -> &'static str {
    let mut lines = UNIT.lines().filter_map(|line| line.strip_prefix(key)?.strip_prefix('='));
    lines.next().unwrap_or_else(|| panic!("the unit has no {key}"))
}

#[test]
fn it_is_not_started_again_where_that_cannot_help() {
    let hopeless = [Kind::Usage, Kind::Data, Kind::NoInput, Kind::CantCreate, Kind::Config];
    let codes: Vec<String> = hopeless.iter().map(|kind| (*kind as u8).to_string()).collect();
    assert_eq!(setting("RestartPreventExitStatus"), codes.join(" "));
    assert_eq!(setting("Restart"), "on-failure");
}

#[test]
fn it_says_when_it_is_up_and_its_watchdog_is_patient_enough() {
    assert_eq!(setting("Type"), "notify");
    // Four times the longest sleep of the pipeline's loop, which is a quarter more than 2 s while no port is there.
    assert!(setting("WatchdogSec").parse::<f64>().unwrap() >= 4.0 * 2.5);
}

/// The options of a settings file, with those that are only shown.
fn options(settings: &'static str) -> impl Iterator<Item = (&'static str, &'static str)> {
    let lines = settings.lines().map(|line| line.strip_prefix('#').unwrap_or(line));
    lines.filter(|line| line.starts_with("SLAMD_")).map(|line| line.split_once('=').unwrap())
}

#[test]
fn the_program_takes_the_unit_s_arguments_and_variables() {
    assert_eq!(setting("Environment"), "SLAMD_PORT=auto");
    let arguments: Vec<_> = setting("ExecStart").split_whitespace().skip(1).collect();
    let takes = |further: &str, variables: &[(&str, &str)]| {
        let mut program = Command::new(env!("CARGO_BIN_EXE_slamd"));
        program.args(&arguments).args(further.split_whitespace()).envs(variables.iter().copied());
        // There is no such port, and nothing else wrong.
        program.output().unwrap().status.code() == Some(69)
    };
    let port = ("SLAMD_PORT", "/dev/nowhere");
    assert!(takes("--exit-on-hangup", &[port]) && !takes("--nonsense", &[port]) && !takes("--exit-on-hangup", &[]));
    assert!(!takes("--exit-on-hangup", &[port, ("SLAMD_NONSENSE", "1")]), "an unknown variable");
    let known: Vec<_> = options(include_str!("../../configs/debian/slamd.env")).collect();
    assert!(known.contains(&("SLAMD_PORT", "auto")) && known.len() > 3, "{known:?}");
    let help = Command::new(env!("CARGO_BIN_EXE_slamd")).args(["run", "--help"]).output().unwrap();
    let help = String::from_utf8(help.stdout).unwrap();
    for (variable, _) in known {
        let has_it = cfg!(feature = "mqtt") || !variable.starts_with("SLAMD_MQTT");
        assert!(!has_it || help.contains(&format!("[env: {variable}=")), "`slamd run` knows no {variable}");
    }
    let state = format!("/var/lib/{}/", setting("StateDirectory"));
    let written = arguments.iter().filter(|argument| argument.starts_with("/var/"));
    assert!(written.clone().count() > 1 && written.clone().all(|path| path.starts_with(&state)), "{arguments:?}");
    assert!(arguments.windows(2).any(|pair| pair == ["--session", "/var/lib/slamd/home.session"]), "{arguments:?}");
}
