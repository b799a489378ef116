//! A unit's sandbox in bubblewrap's words.

use super::seccomp;
use std::os::unix::fs::MetadataExt as _;
use std::path::Path;
use std::process::Command;

/// An address in the range that systemd takes for `DynamicUser=`.
const USER: &str = "64999";

/// The keys and values of `[Service]`.
pub(super) struct Unit(Vec<(String, String)>);

/// What the sandbox is built from and around.
pub(super) struct Places<'a> {
    /// Holds the folders of `StateDirectory=`.
    pub state: &'a Path,
    /// Holds the manager's socket.
    pub notify: &'a Path,
    /// Holds slamd.
    pub programs: &'a Path,
    /// Where the system call filter is written.
    pub filter: &'a Path,
    pub port: &'a Path,
    pub command: &'a [&'a str],
}

/// Keys without a sandbox: how the service starts and ends; and what needs control groups or a keyring. `IPAddressDeny=` and the bounds
/// of memory and tasks are of control groups.
const NOT_TRANSLATED: [&str; 20] = [
    "Type",
    "Environment",
    "EnvironmentFile",
    "ExecStart",
    "WatchdogSec",
    "Restart",
    "RestartSec",
    "RestartPreventExitStatus",
    "SuccessExitStatus",
    "TimeoutStopSec",
    "StateDirectoryMode",
    "IPAddressDeny",
    "IPAddressAllow",
    "RemoveIPC",
    "KeyringMode",
    "MemoryMax",
    "MemorySwapMax",
    "TasksMax",
    "PrivateMounts",
    "SystemCallArchitectures",
];
const TRANSLATED: [&str; 32] = [
    "User",
    "DynamicUser",
    "SupplementaryGroups",
    "UMask",
    "NoNewPrivileges",
    "CapabilityBoundingSet",
    "AmbientCapabilities",
    "StateDirectory",
    "ProtectSystem",
    "ProtectHome",
    "PrivateTmp",
    "ProtectProc",
    "DevicePolicy",
    "DeviceAllow",
    "PrivateDevices",
    "PrivateNetwork",
    "RestrictAddressFamilies",
    "SystemCallFilter",
    "SystemCallErrorNumber",
    "RestrictNamespaces",
    "RestrictRealtime",
    "RestrictSUIDSGID",
    "MemoryDenyWriteExecute",
    "LockPersonality",
    "ProtectClock",
    "ProtectControlGroups",
    "ProtectHostname",
    "ProtectKernelLogs",
    "ProtectKernelModules",
    "ProtectKernelTunables",
    "ReadWritePaths",
    "LimitCORE",
];

/// True where the test may change users.
pub(super) fn is_root() -> bool {
    std::fs::metadata("/proc/self").is_ok_and(|own| own.uid() == 0)
}

/// Names in a folder; none where it cannot be read.
fn names(folder: &str) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<_> = entries.filter_map(|entry| entry.file_name().into_string().ok()).collect();
    names.sort();
    names
}

impl Unit {
    /// # Panics
    /// At a key that is neither translated nor known to need no translation.
    pub(super) fn read(text: &str) -> Self {
        let service = text.split("\n[Service]\n").nth(1).unwrap().split("\n[").next().unwrap();
        let lines = service.lines().filter(|line| !line.starts_with('#'));
        let pairs = lines.filter_map(|line| line.split_once('=')).map(|(key, value)| (key.into(), value.into()));
        let unit = Self(pairs.collect());
        for (key, _) in &unit.0 {
            let is_known = NOT_TRANSLATED.contains(&key.as_str()) || TRANSLATED.contains(&key.as_str());
            assert!(is_known, "{key}=: say in tests/program/sandbox/unit.rs what it means for the sandbox");
        }
        unit
    }

    pub(super) fn value(&self, key: &str) -> Option<&str> {
        self.values(key).last().copied()
    }

    /// All values of a key that can be given again.
    pub(super) fn values(&self, key: &str) -> Vec<&str> {
        self.0.iter().filter(|(name, _)| name == key).map(|(_, value)| value.as_str()).collect()
    }

    pub(super) fn is(&self, key: &str) -> bool {
        self.value(key).is_some_and(|value| ["yes", "true", "1", "on"].contains(&value))
    }

    /// The option that shows a folder as `ProtectSystem=` has it.
    fn shown(&self, path: &str) -> &'static str {
        let is_within = |folders: &[&str]| folders.iter().any(|folder| path.starts_with(folder));
        let is_read_only = match self.value("ProtectSystem") {
            Some("strict") => true,
            Some("full") => is_within(&["/usr", "/boot", "/efi", "/etc"]),
            Some("yes" | "true") => is_within(&["/usr", "/boot", "/efi"]),
            _ => false,
        };
        if is_read_only { "--ro-bind" } else { "--bind" }
    }

    /// The file system, from the root on. Folders that get other contents are built anew, entry by entry.
    fn files(&self, places: &Places<'_>) -> Vec<String> {
        let mut arguments: Vec<String> = Vec::new();
        let mut say = |words: &[&str]| arguments.extend(words.iter().map(|word| (*word).to_owned()));
        let states: Vec<&str> = self.values("StateDirectory").into_iter().flat_map(str::split_whitespace).collect();
        let mut show = |folder: &str, skipped: &[&str]| {
            for name in names(folder) {
                let path = format!("{}/{name}", folder.trim_end_matches('/'));
                if skipped.contains(&name.as_str()) {
                    continue;
                }
                match std::fs::read_link(&path) {
                    Ok(target) => say(&["--symlink", target.to_str().unwrap(), &path]),
                    Err(_) => say(&[self.shown(&path), &path, &path]),
                }
            }
        };
        show("/", &["proc", "dev", "tmp", "var", "home", "root", "run"]);
        show("/var", &["lib", "tmp"]);
        show("/var/lib", &states);
        show("/run", &["user"]);
        say(&["--ro-bind", places.notify.to_str().unwrap(), "/run/slamd-manager"]);
        say(&["--ro-bind", places.programs.to_str().unwrap(), "/slamd-programs"]);
        for state in states {
            let folder = places.state.join(state);
            std::fs::create_dir_all(&folder).unwrap();
            if is_root() {
                assert!(Command::new("chown").arg(format!("{USER}:{USER}")).arg(&folder).status().unwrap().success());
            }
            say(&["--bind", folder.to_str().unwrap(), &format!("/var/lib/{state}")]);
        }
        for home in ["/home", "/root", "/run/user"] {
            match self.value("ProtectHome") {
                Some("yes" | "true") => say(&["--perms", "0000", "--tmpfs", home]),
                Some("tmpfs") => say(&["--tmpfs", home]),
                Some("read-only") => say(&["--ro-bind-try", home, home]),
                _ => say(&["--bind-try", home, home]),
            }
        }
        for folder in ["/tmp", "/var/tmp"] {
            match self.is("PrivateTmp") {
                true => say(&["--perms", "1777", "--tmpfs", folder]),
                false => say(&["--bind", folder, folder]),
            }
        }
        if self.is("ProtectKernelModules") && Path::new("/usr/lib/modules").exists() {
            say(&["--perms", "0000", "--tmpfs", "/usr/lib/modules"]);
        }
        for path in self.values("ReadWritePaths").into_iter().flat_map(str::split_whitespace) {
            say(&["--bind", path, path]);
        }
        match self.value("ProtectProc") {
            Some("invisible" | "noaccess" | "ptraceable") => say(&["--unshare-pid", "--proc", "/proc"]),
            _ => say(&["--bind", "/proc", "/proc"]),
        }
        match self.value("DevicePolicy") {
            Some("closed" | "strict") => say(&["--dev", "/dev"]),
            _ => say(&["--dev-bind", "/dev", "/dev"]),
        }
        // The first device of a class of serial ports is the board's, where the unit allows the class and does not hide all devices.
        for class in
            self.values("DeviceAllow").into_iter().filter_map(|value| value.strip_prefix("char-")?.strip_suffix(" rw"))
        {
            if !self.is("PrivateDevices") {
                say(&["--dev-bind", places.port.to_str().unwrap(), &format!("/dev/{class}0")]);
            }
        }
        if self.value("ProtectSystem") == Some("strict") {
            say(&["--remount-ro", "/"]);
        }
        arguments
    }

    /// A command as systemd starts it: under another user, with what the unit leaves it.
    pub(super) fn sandbox(&self, places: &Places<'_>) -> Command {
        let filter = seccomp::program(self);
        std::fs::write(places.filter, filter).unwrap();
        let mut command = Command::new("sh");
        let umask = self.value("UMask").unwrap_or("0022");
        let core = self.value("LimitCORE").unwrap_or("unlimited");
        command.args(["-c", &format!("umask {umask}; ulimit -c {core}; filter=$1; shift; exec \"$@\" 9<\"$filter\"")]);
        command.arg("sh").arg(places.filter);
        if is_root() {
            assert!(self.is("DynamicUser") || self.value("User").is_some(), "the service would run as root");
            let groups: Vec<&str> =
                self.values("SupplementaryGroups").into_iter().flat_map(str::split_whitespace).collect();
            let groups =
                if groups.is_empty() { "--clear-groups".into() } else { format!("--groups={}", groups.join(",")) };
            command.args(["setpriv", "--reuid", USER, "--regid", USER, &groups]);
        }
        command.args(["bwrap", "--die-with-parent", "--unshare-user", "--unshare-ipc", "--uid", USER, "--gid", USER]);
        if self.is("PrivateNetwork") {
            command.arg("--unshare-net");
        }
        if self.is("ProtectHostname") {
            command.arg("--unshare-uts");
        }
        command.args(self.files(places));
        if self.value("CapabilityBoundingSet") == Some("") {
            command.args(["--cap-drop", "ALL"]);
        }
        assert!(self.is("NoNewPrivileges"), "bubblewrap sets it always");
        command.args([
            "--clearenv",
            "--setenv",
            "PATH",
            "/slamd-programs:/usr/local/bin:/usr/bin:/bin:/usr/sbin:/sbin",
        ]);
        command.args(["--setenv", "NOTIFY_SOCKET", "/run/slamd-manager/socket"]);
        command.args(["--setenv", "SLAMD_PORT", "/dev/ttyUSB0", "--chdir", "/", "--seccomp", "9", "--"]);
        command.args(places.command);
        command
    }
}
