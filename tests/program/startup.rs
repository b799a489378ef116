//! Files that are none, or far too large: named at once, with little memory.

#![allow(clippy::unwrap_used, reason = "a test may")]

use rustix::fs::{CWD, Mode};
use std::fs::File;
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// How the program ended: exit code and last words. It has 1 GB of memory.
#[expect(clippy::disallowed_methods, reason = "the test measures in real time")]
fn ends(folder: &Path, arguments: &[&str]) -> (i32, String) {
    let mut command = Command::new("sh");
    command.args(["-c", "ulimit -v 1000000 && exec \"$@\"", "sh", env!("CARGO_BIN_EXE_slamd")]).args(arguments);
    command.env("XDG_CONFIG_HOME", "/nonexistent").current_dir(folder).stdin(Stdio::null());
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let begin = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if begin.elapsed() > Duration::from_secs(20) {
            child.kill().unwrap();
            panic!("{arguments:?} hangs");
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    let output = child.wait_with_output().unwrap();
    (output.status.code().unwrap_or(-1), String::from_utf8(output.stderr).unwrap())
}

#[test]
fn pipes_devices_and_giants_are_named_as_what_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| -> PathBuf { folder.path().join(name) };
    rustix::fs::mkfifoat(CWD, path("pipe"), Mode::RUSR | Mode::WUSR).unwrap();
    rustix::fs::mkfifoat(CWD, path("pipe.toml"), Mode::RUSR | Mode::WUSR).unwrap();
    for name in ["giant", "giant.toml"] {
        giant(&path(name));
        std::fs::set_permissions(path(name), std::fs::Permissions::from_mode(0o600)).unwrap();
    }
    let run = ["--port", "/dev/nowhere", "--exit-on-hangup"];
    let mut options = vec![
        vec!["--listen", "127.0.0.1:0", "--token-file"],
        vec!["--config"],
        #[cfg(feature = "mqtt")]
        vec!["--mqtt", "127.0.0.1:1", "--mqtt-user", "u", "--mqtt-password-file"],
    ];
    for option in &mut options {
        for (file, words) in [
            ("pipe", "it is a pipe, not a file"),
            ("/dev/zero", "it is a device, not a file"),
            ("giant", "it is larger than 64 KiB"),
        ] {
            let arguments: Vec<&str> = run.iter().chain(option.iter()).copied().chain([file]).collect();
            let (code, said) = ends(folder.path(), &arguments);
            assert!(said.contains(words), "{arguments:?}: {code}: {said}");
        }
    }
    for (arguments, words) in [
        (vec!["replay", "pipe"], "it is a pipe, not a file"),
        (vec!["replay", "/dev/zero"], "it is a device, not a file"),
        (vec!["inspect", "pipe"], "it is a pipe, not a file"),
        (vec!["config", "check", "pipe.toml"], "it is a pipe, not a file"),
        (vec!["simulate", "--world", "pipe.toml", "--capture", "x.mcap"], "it is a pipe, not a file"),
        (vec!["simulate", "--world", "giant.toml", "--capture", "x.mcap"], "it is larger than 1 MiB"),
    ] {
        let (code, said) = ends(folder.path(), &arguments);
        assert!(said.contains(words) && (64..=78).contains(&code), "{arguments:?}: {code}: {said}");
    }
}

#[test]
fn a_session_that_is_a_pipe_is_named_before_the_map_begins() {
    let capture = Path::new(env!("CARGO_MANIFEST_DIR")).join("replay/flat-paper-faults.mcap");
    let folder = tempfile::tempdir().unwrap();
    rustix::fs::mkfifoat(CWD, folder.path().join("pipe"), Mode::RUSR | Mode::WUSR).unwrap();
    for option in ["--resume", "--localize"] {
        let (code, said) = ends(folder.path(), &["replay", capture.to_str().unwrap(), option, "pipe"]);
        assert!(code == 74 && said.contains("it is a pipe, not a file"), "{code}: {said}");
    }
}

/// A file of ten gigabytes without a byte on the disk.
fn giant(path: &Path) {
    File::create(path).unwrap().set_len(10 << 30).unwrap();
}

#[test]
fn results_that_are_pipes_devices_and_giants_hang_no_run() {
    let capture = Path::new(env!("CARGO_MANIFEST_DIR")).join("replay/flat-paper-faults.mcap");
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let replay = ["replay", capture.to_str().unwrap(), "--out"];
    let run = ["--port", "/dev/nowhere", "--duration", "0.2", "--out"];
    for name in slamd_publish::RESULTS {
        for (number, is_pipe) in [true, false].into_iter().enumerate() {
            let out = format!("{name}-{number}");
            std::fs::create_dir(path(&out)).unwrap();
            // A run that has mapped nothing: its results may be replaced.
            std::fs::write(path(&out).join("summary.json"), r#"{"nothing_mapped":"no frames"}"#).unwrap();
            let _ = std::fs::remove_file(path(&out).join(name));
            if is_pipe {
                rustix::fs::mkfifoat(CWD, path(&out).join(name), Mode::RUSR | Mode::WUSR).unwrap();
            } else {
                std::os::unix::fs::symlink("/dev/zero", path(&out).join(name)).unwrap();
            }
            let words = format!("{out}/{name} is a {}, not a file", if is_pipe { "pipe" } else { "device" });
            for command in [&replay[..], &run] {
                let arguments = [command, &[&out]].concat();
                let (code, said) = ends(folder.path(), &arguments);
                assert!(code == 73 && said.contains(&words), "{arguments:?}: {code}: {said}");
                assert!(!said.contains("/dev/nowhere"), "{arguments:?}: it has waited for the port: {said}");
            }
        }
    }
    std::fs::create_dir(path("held")).unwrap();
    giant(&path("held/summary.json"));
    let (code, said) = ends(folder.path(), &[&replay[..], &["held"]].concat());
    assert!(code == 73 && said.contains("held holds the results of a robot's drive"), "{code}: {said}");
}

#[test]
fn outputs_that_are_pipes_and_devices_are_named_before_anything_runs() {
    let capture = Path::new(env!("CARGO_MANIFEST_DIR")).join("replay/flat-paper-faults.mcap");
    let capture = capture.to_str().unwrap();
    let folder = tempfile::tempdir().unwrap();
    rustix::fs::mkfifoat(CWD, folder.path().join("pipe"), Mode::RUSR | Mode::WUSR).unwrap();
    std::os::unix::fs::symlink("pipe", folder.path().join("link")).unwrap();
    std::os::unix::fs::symlink("/dev/zero", folder.path().join("zero")).unwrap();
    let run = ["--port", "/dev/nowhere", "--duration", "0.2"];
    // A drive of all worlds takes hours, so nothing has run.
    let bench = ["bench", "accuracy", "--table", "grid", "--out"];
    let commands: [&[&str]; 12] = [
        &[&run[..], &["--record"]].concat(),
        &[&run[..], &["--save-session"]].concat(),
        &[&run[..], &["--save-calibration"]].concat(),
        &["simulate", "--duration", "100000", "--capture"],
        &["export", capture, "--csv"],
        &["export", capture, "--tum"],
        &["export", capture, "--mcap"],
        &["export", capture, "--svg"],
        &["replay", capture, "--save-session"],
        &["replay", capture, "--save-calibration"],
        &["calibrate", capture, "--out"],
        &bench,
    ];
    for command in commands {
        for (name, what) in [("pipe", "a pipe"), ("link", "a pipe"), ("zero", "a device")] {
            let arguments = [command, &[name, "--force"]].concat();
            let (code, said) = ends(folder.path(), &arguments);
            let words = format!("{name} is {what}, not a file");
            assert!(code == 73 && said.contains(&words), "{arguments:?}: {code}: {said}");
            assert!(!said.contains("/dev/nowhere"), "{arguments:?}: it has waited for the port: {said}");
        }
    }
    assert!(!folder.path().join("slamd-out").exists(), "nothing has begun");
}

#[test]
fn what_a_run_cannot_use_is_named_before_the_wait_for_the_port() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    rustix::fs::mkfifoat(CWD, path("pipe"), Mode::RUSR | Mode::WUSR).unwrap();
    std::fs::write(path("file"), "no session").unwrap();
    std::fs::create_dir(path("held")).unwrap();
    let held = File::open(path("held")).unwrap();
    rustix::fs::flock(&held, rustix::fs::FlockOperation::NonBlockingLockExclusive).unwrap();
    for (options, code, words) in [
        (["--session", "pipe"], 73, "pipe is a pipe, not a file"),
        (["--session", "/dev/zero"], 73, "/dev/zero is a device, not a file"),
        (["--resume", "pipe"], 74, "it is a pipe, not a file"),
        (["--resume", "missing"], 66, "there is no such file"),
        (["--localize", "/dev/zero"], 74, "it is a device, not a file"),
        (["--localize", "file"], 65, "file: "),
        (["--out", "held"], 73, "another slamd is writing into this folder"),
        (["--out", "file"], 73, "is a file, not a folder"),
        (["--out", "file/o"], 73, "it is a file, not a folder"),
    ] {
        let arguments = ["--port", "/dev/nowhere", "--duration", "0.2", options[0], options[1]];
        let (ended, said) = ends(folder.path(), &arguments);
        assert!(ended == code && said.contains(words), "{arguments:?}: {ended}: {said}");
        assert!(!said.contains("/dev/nowhere"), "{arguments:?}: it has waited for the port: {said}");
    }
    // A folder on a disk that is read-only, for root too.
    let script = "mount -t tmpfs -o ro none ro && exec \"$@\"";
    std::fs::create_dir(path("ro")).unwrap();
    let mut command = Command::new("unshare");
    command.args(["-rm", "sh", "-c", script, "sh", env!("CARGO_BIN_EXE_slamd")]).current_dir(folder.path());
    command.args(["--port", "/dev/nowhere", "--duration", "0.2", "--out"]).env("XDG_CONFIG_HOME", "/nonexistent");
    let mount = Command::new("unshare").args(["-rm", "mount", "-t", "tmpfs", "none", "/mnt"]).status();
    if mount.is_ok_and(|status| status.success()) {
        let output = command.arg("ro/o").output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(73) && said.contains("the disk is read-only"), "{said}");
    } else {
        println!("skipped: this machine lets nobody mount a read-only disk");
    }
    assert!(!path("slamd-out").exists(), "nothing is created before the port is open");
}
