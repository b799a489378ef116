//! Serial ports: names, list, holders, and why a port cannot be opened.

#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing, clippy::string_slice)]
#![deny(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)]
#![deny(clippy::allow_attributes, clippy::allow_attributes_without_reason)]

mod error;
mod holder;
mod list;
mod name;

pub use error::{NotSerial, PortError};
pub use holder::{Holder, holders};
pub use list::{PortInfo, Roots, UsbId, list};
pub use name::{NameError, PortName};

use std::io::ErrorKind;
use std::os::unix::fs::{FileTypeExt as _, MetadataExt as _};
use std::path::Path;
use tokio_serial::{ClearBuffer, SerialPort as _, SerialPortBuilderExt as _, SerialStream};

/// Opens the device exclusively, 8N1.
///
/// It opens the port only once, because each opening of a USB port resets an Arduino.
///
/// # Errors
/// Why the port cannot be opened, and what to do.
pub fn open(path: &Path, baud: u32) -> Result<SerialStream, PortError> {
    check(path)?;
    let holders = holders(path);
    if !holders.is_empty() {
        return Err(PortError::Busy { path: path.into(), holders });
    }
    tokio_serial::new(path.to_string_lossy(), baud).open_native_async().map_err(|error| match error.kind {
        tokio_serial::ErrorKind::NoDevice => PortError::Busy { path: path.into(), holders: holder::holders(path) },
        tokio_serial::ErrorKind::Io(kind) => of_io(path, &kind.into()),
        _ => PortError::Other { path: path.into(), text: error.description },
    })
}

/// Listens at another rate. What had arrived at the one before says nothing about it, and is thrown away.
///
/// # Errors
/// When the system refuses.
pub fn set_baud(stream: &mut SerialStream, baud: u32) -> tokio_serial::Result<()> {
    stream.set_baud_rate(baud)?;
    stream.clear(ClearBuffer::Input)
}

/// Checks that the path names a serial port, without opening it.
///
/// # Errors
/// It names something else, or nothing.
pub fn check(path: &Path) -> Result<(), PortError> {
    let metadata = std::fs::metadata(path).map_err(|error| of_io(path, &error))?;
    if metadata.file_type().is_char_device() && is_terminal(metadata.rdev()) {
        return Ok(());
    }
    Err(PortError::NotSerial { path: path.into(), is: NotSerial::of(path) })
}

/// True if the kernel drives this device as a terminal. Other devices, such as /dev/null, may have many holders.
fn is_terminal(device: u64) -> bool {
    let Ok(drivers) = std::fs::read_to_string("/proc/tty/drivers") else { return true };
    let major = (device >> 8) & 0xFFF;
    drivers.lines().any(|driver| driver.split_whitespace().nth(2).and_then(|field| field.parse().ok()) == Some(major))
}

fn of_io(path: &Path, error: &std::io::Error) -> PortError {
    match error.kind() {
        ErrorKind::NotFound => PortError::Missing { name: path.display().to_string() },
        ErrorKind::PermissionDenied => PortError::permission(path),
        _ => PortError::Other { path: path.into(), text: error.to_string() },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(path: &str) -> PortError {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        let _guard = runtime.enter();
        open(Path::new(path), 115_200).map(|_| ()).unwrap_err()
    }

    #[test]
    fn other_files_are_rejected() {
        assert!(error("/dev/nowhere").is_missing());
        let is = |path: &str| match error(path) {
            PortError::NotSerial { is, .. } => is,
            other => panic!("{path}: {other}"),
        };
        assert_eq!(is("/dev/null"), NotSerial::Other);
        assert_eq!(is("/etc/passwd"), NotSerial::File);
        assert_eq!(is("/etc"), NotSerial::Folder);
        assert_eq!(is(concat!(env!("CARGO_MANIFEST_DIR"), "/replay/flat-paper-faults.mcap")), NotSerial::Capture);
    }
}
