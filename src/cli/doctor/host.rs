//! Checks of the computer: disk, viewer, and programs that open serial ports by mistake.

use crate::doctor::{Finding, Level};
use std::path::Path;
use std::process::Command;

/// Least free space without a warning, bytes: a recording of an hour takes a few tens of megabytes.
const MIN_FREE_BYTES: u64 = 200_000_000;
/// The viewer version that reads slamd's recordings.
const RERUN: &str = "0.36.";
/// In an environment of its own: Debian and Raspberry Pi OS refuse a bare `pip install` (PEP 668).
const RERUN_FIX: &str = "to see the map live: `python3 -m venv ~/rerun && ~/rerun/bin/pip install rerun-sdk==0.36.3`, then `PATH=~/rerun/bin:$PATH`";
/// An FTDI bridge that holds bytes for longer than this delays every answer, milliseconds.
const MAX_LATENCY_MS: u32 = 2;

/// The findings that do not depend on the port.
pub(super) fn findings(out: &Path) -> Vec<Finding> {
    vec![folder(out), viewer()]
}

/// The findings about a USB port: programs that open it, and a bridge that delays bytes.
pub(super) fn of_port(path: &Path) -> Vec<Finding> {
    let device = std::fs::canonicalize(path).unwrap_or_else(|_| path.into());
    let name = device.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    if !name.starts_with("ttyUSB") && !name.starts_with("ttyACM") {
        return Vec::new();
    }
    let latency = std::fs::read_to_string(format!("/sys/class/tty/{name}/device/latency_timer"));
    let latency_ms = latency.ok().and_then(|text| text.trim().parse().ok());
    let comms = std::fs::read_dir("/proc").into_iter().flatten().flatten();
    let comms = comms.filter_map(|entry| std::fs::read_to_string(entry.path().join("comm")).ok());
    let comms: Vec<String> = comms.map(|comm| comm.trim().to_owned()).collect();
    grabbers(&comms).into_iter().chain(latency_ms.and_then(|ms| latency_timer(&device, ms))).collect()
}

/// Programs that open each new serial port to identify it.
fn grabbers(comms: &[String]) -> Vec<Finding> {
    let runs = |name: &str| comms.iter().any(|comm| comm == name);
    let mut findings = Vec::new();
    if runs("ModemManager") {
        findings.push(Finding::new(
            Level::Warning,
            "host.modem_manager",
            "ModemManager runs: it opens a new serial port as a modem and writes to it",
            "add a udev rule for the board's USB ids with ENV{ID_MM_DEVICE_IGNORE}=\"1\", or `sudo systemctl disable --now ModemManager`",
        ));
    }
    if runs("brltty") {
        findings.push(Finding::new(
            Level::Warning,
            "host.brltty",
            "brltty runs: it opens CH340 and CP210x bridges as Braille displays",
            "run `sudo systemctl mask --now brltty-udev brltty`",
        ));
    }
    findings
}

fn latency_timer(device: &Path, ms: u32) -> Option<Finding> {
    let device = device.display();
    (ms > MAX_LATENCY_MS).then(|| {
        Finding::new(
            Level::Warning,
            "host.latency_timer",
            format!("{device} is an FTDI bridge that delays bytes by up to {ms} ms"),
            format!("run `setserial {device} low_latency`, or add a udev rule: SUBSYSTEM==\"usb-serial\", DRIVER==\"ftdi_sio\", ATTR{{latency_timer}}=\"1\""),
        )
    })
}

/// Checks that the output folder, or the nearest existing one above it, can be written and has free space.
fn folder(out: &Path) -> Finding {
    let fix = "choose another folder with --out";
    let absolute = std::path::absolute(out).unwrap_or_else(|_| out.into());
    let Some(existing) = absolute.ancestors().find(|folder| folder.exists()) else {
        return Finding::new(Level::Problem, "host.folder", format!("{} cannot be made", out.display()), fix);
    };
    if let Err(error) = tempfile::tempfile_in(existing) {
        let text = format!("{} cannot be written: {error}", existing.display());
        return Finding::new(Level::Problem, "host.folder", text, fix);
    }
    match rustix::fs::statvfs(existing) {
        Ok(disk) => room(out, disk.f_bavail.saturating_mul(disk.f_frsize)),
        Err(error) => {
            Finding::new(Level::Note, "host.folder", format!("{}: room unknown: {error}", out.display()), fix)
        }
    }
}

fn room(out: &Path, bytes: u64) -> Finding {
    let text = format!("{} can be written, {:.1} GB free", out.display(), bytes as f64 * 1e-9);
    if bytes < MIN_FREE_BYTES {
        return Finding::new(Level::Warning, "host.room", text, "make room, or choose another folder with --out");
    }
    Finding::ok("host.folder", text)
}

fn viewer() -> Finding {
    let output = Command::new("rerun").arg("--version").output().ok();
    let output = output.map(|output| String::from_utf8_lossy(&output.stdout).into_owned());
    version(output.as_deref())
}

fn version(output: Option<&str>) -> Finding {
    let Some(output) = output else {
        return Finding::new(Level::Note, "host.viewer", "no viewer: there is no `rerun` on the PATH", RERUN_FIX);
    };
    let version = output.split_whitespace().find(|word| word.starts_with(|c: char| c.is_ascii_digit()));
    match version {
        Some(version) if version.starts_with(RERUN) => Finding::ok("host.viewer", format!("rerun {version}")),
        version => {
            let text = format!("the viewer is rerun {}, not {RERUN}x", version.unwrap_or("of unknown version"));
            Finding::new(Level::Note, "host.viewer", text, RERUN_FIX)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn programs_that_grab_ports_are_named() {
        let found = grabbers(&["bash".into(), "ModemManager".into(), "brltty".into()]);
        assert_eq!(found.iter().map(|finding| finding.id).collect::<Vec<_>>(), ["host.modem_manager", "host.brltty"]);
        assert!(found[0].fix.as_ref().unwrap().contains("ID_MM_DEVICE_IGNORE"));
        assert!(found[1].fix.as_ref().unwrap().contains("mask"));
        assert!(grabbers(&["bash".into()]).is_empty());
    }

    #[test]
    fn a_slow_bridge_is_reported() {
        assert!(latency_timer(Path::new("/dev/ttyUSB0"), 16).unwrap().fix.unwrap().contains("low_latency"));
        assert_eq!(latency_timer(Path::new("/dev/ttyUSB0"), 1), None);
    }

    #[test]
    fn another_viewer_is_a_note() {
        assert_eq!(version(Some("rerun-cli 0.36.3 [rustc 1.92]")).level, Level::Ok);
        let fix = version(Some("rerun-cli 0.29.0")).fix.unwrap();
        assert!(fix.contains("0.36.3") && fix.contains("-m venv"), "{fix}");
        assert_eq!(version(None).level, Level::Note);
    }

    #[test]
    fn a_folder_that_cannot_be_written_is_a_problem() {
        let folder_of = tempfile::tempdir().unwrap();
        assert_eq!(folder(&folder_of.path().join("new/deep")).level, Level::Ok);
        assert_eq!(folder(Path::new("/proc/nowhere")).level, Level::Problem);
        assert_eq!(room(Path::new("out"), 1_000).level, Level::Warning);
    }
}
