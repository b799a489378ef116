//! Why a port cannot be opened, and what to do.

use super::Holder;
use slamd_capture::MAGIC;
use std::fs::File;
use std::io::Read as _;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};

/// Why a port cannot be opened.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PortError {
    /// The port does not exist now.
    Missing {
        /// As the user named it.
        name: String,
    },
    /// Several ports match the name.
    Several {
        /// As the user named it.
        name: String,
        /// The matching ports.
        ports: Vec<PathBuf>,
    },
    /// This user has no permission to open it.
    Permission {
        /// The device.
        path: PathBuf,
        /// The group it belongs to.
        group: String,
        /// True if that group may open it.
        group_may: bool,
    },
    /// Another program has it open.
    Busy {
        /// The device.
        path: PathBuf,
        /// The programs that this user can see.
        holders: Vec<Holder>,
    },
    /// The file is not a serial port.
    NotSerial {
        /// The file.
        path: PathBuf,
        /// What it is instead.
        is: NotSerial,
    },
    /// The program or the system has no file descriptor left.
    Descriptors {
        /// The operating system's error text.
        text: String,
    },
    /// Something else.
    Other {
        /// The device.
        path: PathBuf,
        /// The operating system's error text.
        text: String,
    },
}

/// What a path names that is no serial port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotSerial {
    /// A file that begins as an MCAP file does.
    Capture,
    /// Another file.
    File,
    /// A folder.
    Folder,
    /// A device that is no terminal, a pipe or a socket.
    Other,
}

impl NotSerial {
    /// What the path names.
    pub(super) fn of(path: &Path) -> Self {
        let Ok(metadata) = std::fs::metadata(path) else { return Self::Other };
        if metadata.is_dir() {
            return Self::Folder;
        }
        if !metadata.is_file() {
            return Self::Other;
        }
        let mut magic = [0; MAGIC.len()];
        let is_read = File::open(path).and_then(|mut file| file.read_exact(&mut magic)).is_ok();
        if is_read && magic.as_slice() == MAGIC { Self::Capture } else { Self::File }
    }
}

impl PortError {
    /// True if the port is only unplugged; the daemon then looks for it often.
    #[must_use]
    pub fn is_missing(&self) -> bool {
        matches!(self, Self::Missing { .. })
    }

    /// The same error, or the one behind it: without a free file descriptor every port seems missing.
    #[must_use]
    pub fn or_shortage(self) -> Self {
        crate::descriptors::shortage().map_or(self, |error| Self::Descriptors { text: error.to_string() })
    }

    /// The error for a `path` that this user may not open.
    pub(super) fn permission(path: &Path) -> Self {
        let metadata = std::fs::metadata(path);
        let (gid, mode) = metadata.map_or((0, 0), |metadata| (metadata.gid(), metadata.mode()));
        Self::Permission { path: path.into(), group: group_name(gid), group_may: mode & 0o060 == 0o060 }
    }
}

impl std::error::Error for PortError {}

impl std::fmt::Display for PortError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Missing { name } => {
                write!(f, "port missing: there is no {name}; plug the board in, or see `slamd ports`")
            }
            Self::Several { name, ports } => {
                let ports: Vec<String> = ports.iter().map(|port| port.display().to_string()).collect();
                write!(f, "several ports: {name} fits {}; name one of them with --port", ports.join(" and "))
            }
            Self::Permission { path, group, group_may: true } => write!(
                f,
                "permission denied: {} belongs to group {group}; run `sudo usermod -aG {group} $USER` and log in again",
                path.display()
            ),
            Self::Permission { path, group, group_may: false } => write!(
                f,
                "permission denied: {path} belongs to group {group}, which may not use it either; run `sudo chgrp dialout {path} && sudo chmod g+rw {path}`, then `sudo usermod -aG dialout $USER`, and log in again",
                path = path.display()
            ),
            Self::Busy { path, holders } if holders.is_empty() => write!(
                f,
                "busy: another program has {path} open; `sudo fuser -v {path}` names it; close it",
                path = path.display()
            ),
            Self::Busy { path, holders } => {
                let names: Vec<String> = holders.iter().map(Holder::to_string).collect();
                write!(f, "busy: {} is held by {}; {}", path.display(), names.join(" and "), remedy(holders))
            }
            Self::NotSerial { path, is: NotSerial::Capture } => {
                write!(
                    f,
                    "{path} is a capture, no serial port; replay it with `slamd replay {path}`",
                    path = path.display()
                )
            }
            Self::NotSerial { path, is } => {
                let what = match is {
                    NotSerial::Capture | NotSerial::File => "a file",
                    NotSerial::Folder => "a folder",
                    NotSerial::Other => "a device or pipe",
                };
                write!(f, "{} is {what}, no serial port; `slamd ports` lists those there are", path.display())
            }
            Self::Descriptors { text } => {
                write!(f, "no file descriptor is free: {text}; close connections to slamd, or raise `ulimit -n`")
            }
            Self::Other { path, text } => {
                write!(f, "{} cannot be opened: {text}; try `slamd doctor`", path.display())
            }
        }
    }
}

/// How to free the port. Two known programs open every new serial port because they take it for another device.
fn remedy(holders: &[Holder]) -> &'static str {
    let is_held_by = |name: &str| holders.iter().any(|holder| holder.name.eq_ignore_ascii_case(name));
    if is_held_by("ModemManager") {
        "it takes the board for a modem: `sudo systemctl disable --now ModemManager`"
    } else if is_held_by("brltty") {
        "it takes the board for a Braille display: `sudo apt-get remove brltty`"
    } else {
        "close it first"
    }
}

/// The group's name, or its number if it has none.
fn group_name(gid: u32) -> String {
    let groups = std::fs::read_to_string("/etc/group").unwrap_or_default();
    let name = groups.lines().find_map(|line| {
        let mut fields = line.split(':');
        let name = fields.next()?;
        (fields.nth(1)?.parse() == Ok(gid)).then(|| name.to_owned())
    });
    name.unwrap_or_else(|| gid.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_error_names_a_remedy() {
        let held = |name: &str| PortError::Busy {
            path: "/dev/ttyUSB0".into(),
            holders: vec![Holder { pid: 7, name: name.into() }],
        };
        assert_eq!(held("picocom").to_string(), "busy: /dev/ttyUSB0 is held by picocom (pid 7); close it first");
        assert!(held("ModemManager").to_string().contains("systemctl disable --now ModemManager"));
        assert!(held("brltty").to_string().contains("remove brltty"));
        let several = PortError::Several { name: "auto".into(), ports: vec!["/dev/a".into(), "/dev/b".into()] };
        assert_eq!(several.to_string(), "several ports: auto fits /dev/a and /dev/b; name one of them with --port");
        let path = PathBuf::from("/dev/ttyUSB0");
        let may = PortError::Permission { path: path.clone(), group: "dialout".into(), group_may: true };
        assert!(may.to_string().contains("sudo usermod -aG dialout"), "{may}");
        let may_not = PortError::Permission { path, group: "root".into(), group_may: false };
        assert!(may_not.to_string().contains("chmod g+rw /dev/ttyUSB0"), "{may_not}");
    }

    #[test]
    fn groups_have_names() {
        assert_eq!(group_name(0), "root");
        assert_eq!(group_name(4_000_000_000), "4000000000");
    }
}
