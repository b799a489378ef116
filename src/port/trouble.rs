//! Why a port cannot be opened, with what to do about it.

use super::Holder;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};

/// Why a port cannot be opened.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Trouble {
    /// There is no such port now.
    Missing {
        /// As the user named it.
        name: String,
    },
    /// The name fits several ports.
    Several {
        /// As the user named it.
        name: String,
        /// The ports that it fits.
        ports: Vec<PathBuf>,
    },
    /// This user may not open it.
    Permission {
        /// The device.
        path: PathBuf,
        /// The group it belongs to.
        group: String,
        /// True where that group may open it.
        group_may: bool,
    },
    /// Another program has it open.
    Busy {
        /// The device.
        path: PathBuf,
        /// The programs, as far as this user may see them.
        holders: Vec<Holder>,
    },
    /// It is something else than a serial port.
    NotSerial {
        /// The file.
        path: PathBuf,
    },
    /// Something else.
    Other {
        /// The device.
        path: PathBuf,
        /// The operating system's words.
        words: String,
    },
}

impl Trouble {
    /// True where the port may simply be unplugged: its return is looked for often.
    #[must_use]
    pub fn is_missing(&self) -> bool {
        matches!(self, Self::Missing { .. })
    }

    /// This user may not open `path`.
    pub(super) fn permission(path: &Path) -> Self {
        let metadata = std::fs::metadata(path);
        let (gid, mode) = metadata.map_or((0, 0), |metadata| (metadata.gid(), metadata.mode()));
        Self::Permission { path: path.into(), group: group_name(gid), group_may: mode & 0o060 == 0o060 }
    }
}

impl std::error::Error for Trouble {}

impl std::fmt::Display for Trouble {
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
                "permission denied: {} belongs to group {group}; run `sudo usermod -aG {group} $USER` and log in anew",
                path.display()
            ),
            Self::Permission { path, group, group_may: false } => write!(
                f,
                "permission denied: {path} belongs to group {group}, which may not use it either; run `sudo chgrp dialout {path} && sudo chmod g+rw {path}`, then `sudo usermod -aG dialout $USER`, and log in anew",
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
            Self::NotSerial { path } => {
                write!(f, "{} is no serial port; `slamd ports` lists those there are", path.display())
            }
            Self::Other { path, words } => {
                write!(f, "{} cannot be opened: {words}; try `slamd doctor`", path.display())
            }
        }
    }
}

/// How to make the holders let go. Two of them take every new serial port for something else.
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

/// The group's name, or else its number.
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
    fn each_trouble_says_what_to_do() {
        let held = |name: &str| Trouble::Busy {
            path: "/dev/ttyUSB0".into(),
            holders: vec![Holder { pid: 7, name: name.into() }],
        };
        assert_eq!(held("picocom").to_string(), "busy: /dev/ttyUSB0 is held by picocom (pid 7); close it first");
        assert!(held("ModemManager").to_string().contains("systemctl disable --now ModemManager"));
        assert!(held("brltty").to_string().contains("remove brltty"));
        let several = Trouble::Several { name: "auto".into(), ports: vec!["/dev/a".into(), "/dev/b".into()] };
        assert_eq!(several.to_string(), "several ports: auto fits /dev/a and /dev/b; name one of them with --port");
        let path = PathBuf::from("/dev/ttyUSB0");
        let may = Trouble::Permission { path: path.clone(), group: "dialout".into(), group_may: true };
        assert!(may.to_string().contains("sudo usermod -aG dialout"), "{may}");
        let may_not = Trouble::Permission { path, group: "root".into(), group_may: false };
        assert!(may_not.to_string().contains("chmod g+rw /dev/ttyUSB0"), "{may_not}");
    }

    #[test]
    fn groups_have_names() {
        assert_eq!(group_name(0), "root");
        assert_eq!(group_name(4_000_000_000), "4000000000");
    }
}
