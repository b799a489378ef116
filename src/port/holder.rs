//! The programs that have a device open.

use serde::Serialize;
use std::os::unix::fs::MetadataExt as _;
use std::path::Path;

/// A program that has a device open.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct Holder {
    /// The process id.
    pub pid: u32,
    /// Its name.
    pub name: String,
}

impl std::fmt::Display for Holder {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} (pid {})", self.name, self.pid)
    }
}

/// The other programs that have the device open. Root sees all of them, another user only its own.
#[must_use]
pub fn holders(path: &Path) -> Vec<Holder> {
    let Ok(device) = std::fs::metadata(path) else { return Vec::new() };
    let Ok(processes) = std::fs::read_dir("/proc") else { return Vec::new() };
    let own = std::process::id();
    let pids = processes.flatten().filter_map(|process| process.file_name().to_str()?.parse().ok());
    let mut holders: Vec<Holder> = pids
        .filter(|&pid| pid != own && has_open(pid, (device.dev(), device.ino())))
        .map(|pid| Holder { pid, name: process_name(pid) })
        .collect();
    holders.sort();
    holders
}

/// True if the process has this file open.
fn has_open(pid: u32, file: (u64, u64)) -> bool {
    let Ok(descriptors) = std::fs::read_dir(format!("/proc/{pid}/fd")) else { return false };
    descriptors
        .flatten()
        // Follows only links into /dev: another file system may hang.
        .filter(|descriptor| std::fs::read_link(descriptor.path()).is_ok_and(|target| target.starts_with("/dev")))
        .any(|descriptor| {
            std::fs::metadata(descriptor.path()).is_ok_and(|metadata| (metadata.dev(), metadata.ino()) == file)
        })
}

/// The program's name.
fn process_name(pid: u32) -> String {
    let name = std::fs::read_to_string(format!("/proc/{pid}/comm")).unwrap_or_default();
    let name: String = name.trim().chars().filter(|c| !c.is_control()).collect();
    if name.is_empty() { "a program".into() } else { name }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serialport::SerialPort as _;

    #[test]
    fn a_program_that_has_a_terminal_open_is_named() {
        let (_master, slave) = serialport::TTYPort::pair().unwrap();
        let path = slave.name().unwrap();
        drop(slave);
        assert_eq!(holders(Path::new(&path)), []);
        let mut sleep = std::process::Command::new("sleep");
        let mut child = sleep.arg("60").stdin(std::fs::File::open(&path).unwrap()).spawn().unwrap();
        let found = holders(Path::new(&path));
        child.kill().unwrap();
        child.wait().unwrap();
        assert_eq!(found, [Holder { pid: child.id(), name: "sleep".into() }]);
        assert_eq!(found[0].to_string(), format!("sleep (pid {})", child.id()));
        assert_eq!(holders(Path::new("/dev/nowhere")), []);
    }
}
