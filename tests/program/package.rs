//! The Debian package: made by cargo-deb, installed by dpkg into a root of its own, upgraded, removed and purged.
//!
//! cargo-deb is built into Cargo's target folder the first time, which takes a minute or two and crates.io. The program in the package is the one under test.

#![allow(clippy::unwrap_used, reason = "a test may")]

use std::collections::BTreeSet;
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::process::Command;

const CARGO_DEB: &str = "3.8.0";
/// Where the package may put files, and nowhere else.
const PLACES: [&str; 6] = [
    "usr/bin/slamd",
    "usr/lib/systemd/system/slamd.service",
    "usr/lib/sysusers.d/slamd.conf",
    "usr/lib/udev/rules.d/95-slamd.rules",
    "etc/slamd/slamd.toml",
    "etc/slamd/slamd.env",
];
const PAGES: &str = "usr/share/doc/slamd/";
/// What is dpkg's own, or the list of users, which stay.
const NOT_OURS: [&str; 8] = [
    "var/lib/dpkg/",
    "var/log/",
    "usr/sbin/policy-rc.d",
    "etc/passwd",
    "etc/group",
    "etc/shadow",
    "etc/gshadow",
    "etc/.pwd.lock",
];

/// cargo-deb, without the features that the test has no use for.
fn cargo_deb() -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("cargo-deb-{CARGO_DEB}"));
    let program = folder.join("bin/cargo-deb");
    if !program.exists() {
        let mut install = Command::new(env!("CARGO"));
        install.args(["install", "--quiet", "--locked", "--debug", "--no-default-features", "--root"]).arg(&folder);
        install.args(["cargo-deb", "--version", &format!("={CARGO_DEB}")]).current_dir(env!("CARGO_TARGET_TMPDIR"));
        assert!(install.status().unwrap().success(), "is crates.io in reach?");
    }
    program
}

/// Makes the package of this version, with the program that Cargo has built for this test.
fn package(folder: &Path, version: &str) -> PathBuf {
    let program = Path::new(env!("CARGO_BIN_EXE_slamd"));
    let profile = program.parent().unwrap();
    let target = profile.parent().unwrap();
    let name = match profile.file_name().unwrap().to_str().unwrap() {
        "debug" => "dev",
        other => other,
    };
    let file = folder.join(format!("slamd-{version}.deb"));
    let mut command = Command::new(cargo_deb());
    command.args(["--no-build", "--quiet", "--offline", "--profile", name, "--deb-version", version]);
    // Packed quickly, without debugging symbols.
    command.args(["--strip", "--compress-type", "gz", "--compress-system", "--fast", "--output"]).arg(&file);
    command.env("CARGO_TARGET_DIR", target).current_dir(env!("CARGO_MANIFEST_DIR"));
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    file
}

/// An empty system with dpkg's records in it.
struct Root(tempfile::TempDir);

impl Root {
    fn new() -> Self {
        let root = Self(tempfile::tempdir().unwrap());
        for folder in
            ["var/lib/dpkg/info", "var/lib/dpkg/updates", "var/lib/dpkg/triggers", "var/log", "usr/sbin", "etc"]
        {
            std::fs::create_dir_all(root.path(folder)).unwrap();
        }
        std::fs::write(root.path("var/lib/dpkg/status"), "").unwrap();
        // No service of the machine that tests is to be started or stopped.
        std::fs::write(root.path("usr/sbin/policy-rc.d"), "#!/bin/sh\nexit 101\n").unwrap();
        std::fs::set_permissions(root.path("usr/sbin/policy-rc.d"), std::fs::Permissions::from_mode(0o755)).unwrap();
        root
    }

    fn path(&self, inside: &str) -> PathBuf {
        self.0.path().join(inside)
    }

    /// What dpkg says.
    fn dpkg(&self, arguments: &[&str]) -> String {
        let mut command = Command::new("dpkg");
        command.arg(format!("--root={}", self.0.path().display()));
        // The scripts run in this system, told where the other one is; what the package depends on is not in there.
        command.args(["--force-script-chrootless", "--force-depends"]).args(arguments);
        command.env("PATH", "/usr/sbin:/usr/bin:/sbin:/bin").env("LC_ALL", "C").env_remove("DPKG_MAINTSCRIPT_PACKAGE");
        let output = command.output().unwrap();
        let text = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap()).concat();
        assert!(output.status.success(), "dpkg {arguments:?}: {text}");
        text
    }

    /// All files and links but those that are not ours.
    fn files(&self) -> BTreeSet<String> {
        let mut found = BTreeSet::new();
        let mut folders = vec![self.0.path().to_owned()];
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap()) {
                if entry.file_type().unwrap().is_dir() {
                    folders.push(entry.path());
                } else {
                    found.insert(entry.path().strip_prefix(self.0.path()).unwrap().to_str().unwrap().to_owned());
                }
            }
        }
        found.retain(|path| !NOT_OURS.iter().any(|place| path.starts_with(place)));
        found
    }

    fn read(&self, inside: &str) -> String {
        std::fs::read_to_string(self.path(inside)).unwrap()
    }
}

fn is_root() -> bool {
    let is = rustix::process::geteuid().is_root();
    if !is {
        println!("not tested: dpkg gives files to root, which only root may do");
    }
    is
}

#[test]
fn it_is_installed_upgraded_removed_and_purged() {
    if !is_root() {
        return;
    }
    let (folder, root) = (tempfile::tempdir().unwrap(), Root::new());
    let said = root.dpkg(&["--install", package(folder.path(), "0.1.0-1").to_str().unwrap()]);
    assert!(said.contains("sudo systemctl enable --now slamd") && said.contains("/etc/slamd/slamd.env"), "{said}");
    let files = root.files();
    for place in PLACES {
        assert!(files.contains(place), "no {place} among {files:?}");
    }
    assert!(
        files.contains("usr/share/doc/slamd/README.md") && files.contains("usr/share/doc/slamd/copyright"),
        "{files:?}"
    );
    let strange: Vec<_> = files
        .iter()
        .filter(|file| !PLACES.contains(&file.as_str()) && !file.starts_with(PAGES))
        // deb-systemd-helper's note that the unit is known, and not enabled.
        .filter(|file| !file.starts_with("var/lib/systemd/deb-systemd-helper"))
        .collect();
    assert!(strange.is_empty(), "{strange:?}: if it is below multi-user.target.wants, it is enabled");
    check_program(&root);
    check_unit(&root);
    check_user(&root);

    // What somebody has set stays over an upgrade and a removal, and so does the map.
    let set = root.read("etc/slamd/slamd.env").replace("SLAMD_PORT=auto", "SLAMD_PORT=/dev/slamd-ring");
    std::fs::write(root.path("etc/slamd/slamd.env"), &set).unwrap();
    std::fs::create_dir_all(root.path("var/lib/private/slamd/out")).unwrap();
    std::fs::write(root.path("var/lib/private/slamd/home.session"), "a map").unwrap();
    std::os::unix::fs::symlink("private/slamd", root.path("var/lib/slamd")).unwrap();
    let said = root.dpkg(&["--install", package(folder.path(), "0.1.1-1").to_str().unwrap()]);
    assert!(!said.contains("not started"), "who has it already is not told again: {said}");
    root.dpkg(&["--remove", "slamd"]);
    assert_eq!(root.read("etc/slamd/slamd.env"), set);
    assert_eq!(root.read("var/lib/slamd/home.session"), "a map");
    assert!(!root.path("usr/bin/slamd").exists());
    root.dpkg(&["--purge", "slamd"]);
    assert_eq!(root.files(), BTreeSet::new(), "purged");
    assert!(!root.path("etc/slamd").exists() && !root.path("var/lib/slamd").exists());
}

fn check_program(root: &Root) {
    let output = Command::new(root.path("usr/bin/slamd")).arg("--version").output().unwrap();
    assert_eq!(String::from_utf8(output.stdout).unwrap(), format!("slamd {}\n", env!("CARGO_PKG_VERSION")));
    let status = root.read("var/lib/dpkg/status");
    let depends = status.lines().find(|line| line.starts_with("Depends: ")).unwrap();
    assert!(depends.contains("libc6 (>= ") && !depends.contains("$auto"), "is dpkg-dev installed? {depends}");
    // Its settings are what the package brings, and it understands them.
    let mut command = Command::new(root.path("usr/bin/slamd"));
    command.args(["--port", "/dev/nowhere", "--exit-on-hangup", "--config"]).arg(root.path("etc/slamd/slamd.toml"));
    let code = command.current_dir(root.0.path()).output().unwrap().status.code();
    assert_eq!(code, Some(69), "only the port is missing");
}

/// The unit is the one that tests/program/systemd.rs knows, and its program is where systemd looks for it.
fn check_unit(root: &Root) {
    let unit = root.read("usr/lib/systemd/system/slamd.service");
    assert_eq!(unit, include_str!("../../configs/systemd/slamd.service"));
    let program = root.path("usr/bin/slamd");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("slamd.service");
    std::fs::write(&path, unit.replace("ExecStart=slamd ", &format!("ExecStart={} ", program.display()))).unwrap();
    let mut command = Command::new("systemd-analyze");
    command.args(["verify", "--man=no", "--recursive-errors=no"]).arg(&path).env("SYSTEMD_COLORS", "0");
    match command.output() {
        Ok(output) => assert_eq!(String::from_utf8_lossy(&output.stderr), ""),
        Err(error) => println!("not tested: systemd-analyze cannot be run ({error})"),
    }
}

/// The service's user is there, and may open serial ports.
fn check_user(root: &Root) {
    let users = root.read("etc/passwd");
    assert!(users.lines().any(|line| line.starts_with("slamd:") && line.ends_with("/nologin")), "{users}");
    let groups = root.read("etc/group");
    assert!(groups.lines().any(|line| line.starts_with("dialout:") && line.ends_with(":slamd")), "{groups}");
}
