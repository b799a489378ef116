//! Port names as the user gives them.

use super::{PortError, PortInfo, Roots};
use std::path::{Path, PathBuf};

/// A port's name as given to `--port`. It is resolved each time the port is opened.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PortName {
    /// A device, or a link to one such as those below `/dev/serial/by-id`.
    Path(PathBuf),
    /// The USB device with this vendor, product and, if given, serial number.
    Usb {
        /// Vendor.
        vid: u16,
        /// Product.
        pid: u16,
        /// Serial number.
        serial: Option<String>,
    },
    /// The only USB serial port.
    Auto,
}

/// An invalid name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "a port is a device such as /dev/ttyUSB0, or usb:VID:PID[:SERIAL] with four hexadecimal digits each such as usb:1a86:7523, or auto"
)]
pub struct NameError;

impl std::str::FromStr for PortName {
    type Err = NameError;

    fn from_str(text: &str) -> Result<Self, NameError> {
        if text == "auto" {
            return Ok(Self::Auto);
        }
        let Some(usb) = text.strip_prefix("usb:") else {
            return if text.is_empty() { Err(NameError) } else { Ok(Self::Path(text.into())) };
        };
        let mut parts = usb.splitn(3, ':');
        let mut number = || {
            let digits = parts.next().filter(|digits| digits.len() == 4).ok_or(NameError)?;
            u16::from_str_radix(digits, 16).map_err(|_| NameError)
        };
        let (vid, pid) = (number()?, number()?);
        let serial = parts.next().map(str::to_owned);
        if serial.as_ref().is_some_and(String::is_empty) { Err(NameError) } else { Ok(Self::Usb { vid, pid, serial }) }
    }
}

impl std::fmt::Display for PortName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Path(path) => path.display().fmt(f),
            Self::Usb { vid, pid, serial: None } => write!(f, "usb:{vid:04x}:{pid:04x}"),
            Self::Usb { vid, pid, serial: Some(serial) } => write!(f, "usb:{vid:04x}:{pid:04x}:{serial}"),
            Self::Auto => write!(f, "auto"),
        }
    }
}

impl PortName {
    /// The device that matches the name now.
    ///
    /// # Errors
    /// No device matches, or several do.
    pub fn resolve(&self) -> Result<PathBuf, PortError> {
        self.resolve_in(&Roots::default())
    }

    fn resolve_in(&self, roots: &Roots) -> Result<PathBuf, PortError> {
        if let Self::Path(path) = self {
            return Ok(path.clone());
        }
        let fitting: Vec<PathBuf> =
            roots.list().into_iter().filter(|port| self.fits(port)).map(|port| port.path).collect();
        match (fitting.as_slice(), self) {
            ([path], _) => Ok(path.clone()),
            ([], Self::Auto) => Err(PortError::Missing { name: "USB serial port".into() }),
            ([], _) => Err(PortError::Missing { name: self.to_string() }),
            _ => Err(PortError::Several { name: self.to_string(), ports: fitting }),
        }
    }

    /// True if the port matches the name.
    fn fits(&self, port: &PortInfo) -> bool {
        match (self, &port.usb) {
            (Self::Path(path), _) => path == Path::new(&port.path),
            (Self::Auto, usb) => usb.is_some(),
            (Self::Usb { vid, pid, serial }, Some(usb)) => {
                (*vid, *pid) == (usb.vid, usb.pid) && (serial.is_none() || *serial == usb.serial)
            }
            (Self::Usb { .. }, None) => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::list::tests::machine;
    use super::*;

    #[test]
    fn names_survive_the_round_trip() {
        for text in ["auto", "/dev/ttyUSB0", "usb:1a86:7523", "usb:2341:0042:757:3530", "robot"] {
            assert_eq!(text.parse::<PortName>().unwrap().to_string(), text);
        }
        for text in ["", "usb:", "usb:1a86", "usb:1a86:75231", "usb:wxyz:7523", "usb:1a86:7523:"] {
            assert_eq!(text.parse::<PortName>(), Err(NameError), "{text}");
        }
    }

    #[test]
    fn a_name_resolves_to_the_port_that_matches_now() {
        let folder = tempfile::tempdir().unwrap();
        let roots = machine(folder.path());
        let resolve = |name: &str| name.parse::<PortName>().unwrap().resolve_in(&roots);
        assert!(resolve("usb:2341:0042").unwrap().ends_with("ttyACM0"));
        assert!(resolve("usb:2341:0042:7573530").unwrap().ends_with("ttyACM0"));
        assert_eq!(resolve("usb:2341:0042:1"), Err(PortError::Missing { name: "usb:2341:0042:1".into() }));
        assert!(matches!(resolve("auto"), Err(PortError::Several { ports, .. }) if ports.len() == 2));
        std::fs::remove_file(roots.dev.join("ttyUSB0")).unwrap();
        assert!(resolve("auto").unwrap().ends_with("ttyACM0"));
        std::fs::remove_file(roots.dev.join("ttyACM0")).unwrap();
        assert!(resolve("auto").unwrap_err().is_missing());
        assert_eq!(resolve("/dev/anything"), Ok("/dev/anything".into()));
    }
}
