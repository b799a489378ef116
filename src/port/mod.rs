//! Serial ports: what they are called, which there are, who holds them, why one cannot be opened.

#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing, clippy::string_slice)]
#![deny(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)]
#![deny(clippy::allow_attributes, clippy::allow_attributes_without_reason)]

mod holder;
mod list;
mod name;
mod trouble;

pub use holder::{Holder, holders};
pub use list::{PortInfo, Roots, UsbId, list};
pub use name::{NameError, PortName};
pub use trouble::Trouble;

use std::io::ErrorKind;
use std::os::unix::fs::{FileTypeExt as _, MetadataExt as _};
use std::path::Path;
use tokio_serial::{SerialPortBuilderExt as _, SerialStream};

/// Opens the device for this process alone, 8N1.
///
/// It is opened once: each opening of a USB port resets an Arduino.
///
/// # Errors
/// Why it cannot be opened, with what to do about it.
pub fn open(path: &Path, baud: u32) -> Result<SerialStream, Trouble> {
    let metadata = std::fs::metadata(path).map_err(|error| of_io(path, &error))?;
    if !metadata.file_type().is_char_device() || !is_terminal(metadata.rdev()) {
        return Err(Trouble::NotSerial { path: path.into() });
    }
    let holders = holders(path);
    if !holders.is_empty() {
        return Err(Trouble::Busy { path: path.into(), holders });
    }
    tokio_serial::new(path.to_string_lossy(), baud).open_native_async().map_err(|error| match error.kind {
        tokio_serial::ErrorKind::NoDevice => Trouble::Busy { path: path.into(), holders: holder::holders(path) },
        tokio_serial::ErrorKind::Io(kind) => of_io(path, &kind.into()),
        _ => Trouble::Other { path: path.into(), words: error.description },
    })
}

/// True where the kernel drives this device as a terminal: /dev/null must not be asked who else has it open.
fn is_terminal(device: u64) -> bool {
    let Ok(drivers) = std::fs::read_to_string("/proc/tty/drivers") else { return true };
    let major = (device >> 8) & 0xFFF;
    drivers.lines().any(|driver| driver.split_whitespace().nth(2).and_then(|field| field.parse().ok()) == Some(major))
}

fn of_io(path: &Path, error: &std::io::Error) -> Trouble {
    match error.kind() {
        ErrorKind::NotFound => Trouble::Missing { name: path.display().to_string() },
        ErrorKind::PermissionDenied => Trouble::permission(path),
        _ => Trouble::Other { path: path.into(), words: error.to_string() },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trouble(path: &str) -> Trouble {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        let _guard = runtime.enter();
        open(Path::new(path), 115_200).map(|_| ()).unwrap_err()
    }

    #[test]
    fn what_is_no_serial_port_is_said_to_be_none() {
        assert!(trouble("/dev/nowhere").is_missing());
        assert!(matches!(trouble("/dev/null"), Trouble::NotSerial { .. }), "{}", trouble("/dev/null"));
        assert!(matches!(trouble("/etc/passwd"), Trouble::NotSerial { .. }));
    }
}
