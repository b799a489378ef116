//! Lists the serial ports that the kernel knows.

use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The identity of a USB device.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct UsbId {
    /// Vendor.
    pub vid: u16,
    /// Product.
    pub pid: u16,
    /// Serial number.
    pub serial: Option<String>,
    /// Vendor's name.
    pub manufacturer: Option<String>,
    /// Product's name.
    pub product: Option<String>,
}

impl UsbId {
    /// A name for `--port` that does not depend on the USB socket.
    #[must_use]
    pub fn port_name(&self) -> String {
        let serial = self.serial.as_ref().map(|serial| format!(":{serial}")).unwrap_or_default();
        format!("usb:{:04x}:{:04x}{serial}", self.vid, self.pid)
    }
}

/// A serial port.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct PortInfo {
    /// The device.
    pub path: PathBuf,
    /// The device's persistent name.
    pub by_id: Option<PathBuf>,
    /// The USB device, if it is one.
    pub usb: Option<UsbId>,
    /// The kernel's driver.
    pub driver: Option<String>,
}

/// The folders that describe the ports; tests have their own.
#[derive(Clone, Debug)]
pub struct Roots {
    /// The kernel's description of the machine.
    pub sys: PathBuf,
    /// The devices.
    pub dev: PathBuf,
}

impl Default for Roots {
    fn default() -> Self {
        Self { sys: "/sys".into(), dev: "/dev".into() }
    }
}

/// The serial ports of this machine, USB ones first.
#[must_use]
pub fn list() -> Vec<PortInfo> {
    Roots::default().list()
}

impl Roots {
    /// The serial ports described here, USB ones first.
    #[must_use]
    pub fn list(&self) -> Vec<PortInfo> {
        let by_id = self.by_id();
        let Ok(terminals) = std::fs::read_dir(self.sys.join("class/tty")) else { return Vec::new() };
        let mut ports: Vec<PortInfo> = terminals
            .flatten()
            .filter_map(|terminal| {
                let device = std::fs::canonicalize(terminal.path().join("device")).ok()?;
                let driver = std::fs::read_link(device.join("driver")).ok();
                let driver = driver.and_then(|driver| Some(driver.file_name()?.to_str()?.to_owned()));
                let path = self.dev.join(terminal.file_name());
                // The kernel also names UARTs that the machine does not have.
                let is_absent = text(&terminal.path().join("type")).as_deref() == Some("0");
                (!is_absent && path.exists()).then(|| PortInfo {
                    by_id: by_id.get(&path).cloned(),
                    usb: usb(&device),
                    path,
                    driver,
                })
            })
            .collect();
        ports.sort_by(|a, b| (a.usb.is_none(), &a.path).cmp(&(b.usb.is_none(), &b.path)));
        ports
    }

    /// The persistent name of each device.
    fn by_id(&self) -> BTreeMap<PathBuf, PathBuf> {
        let Ok(links) = std::fs::read_dir(self.dev.join("serial/by-id")) else { return BTreeMap::new() };
        let links = links.flatten().map(|link| link.path());
        links.filter_map(|link| Some((std::fs::canonicalize(&link).ok()?, link))).collect()
    }
}

/// The USB device that a port is part of.
fn usb(device: &Path) -> Option<UsbId> {
    let device = device.ancestors().find(|folder| folder.join("idVendor").exists())?;
    let number = |name| u16::from_str_radix(&text(&device.join(name))?, 16).ok();
    Some(UsbId {
        vid: number("idVendor")?,
        pid: number("idProduct")?,
        serial: text(&device.join("serial")),
        manufacturer: text(&device.join("manufacturer")),
        product: text(&device.join("product")),
    })
}

/// A line from the kernel without control characters, which a device could use to confuse a terminal.
fn text(path: &Path) -> Option<String> {
    let text: String = std::fs::read_to_string(path).ok()?.trim().chars().filter(|c| !c.is_control()).collect();
    (!text.is_empty()).then_some(text)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use std::fs;
    use std::os::unix::fs::symlink;

    /// A machine with an Arduino on ttyACM0, a cheap bridge on ttyUSB0, a UART of its own and one it does not have.
    pub(in crate::port) fn machine(folder: &Path) -> Roots {
        let folder = fs::canonicalize(folder).unwrap();
        let roots = Roots { sys: folder.join("sys"), dev: folder.join("dev") };
        fs::create_dir_all(roots.dev.join("serial/by-id")).unwrap();
        let plug = |name: &str, driver: &str, usb: Option<[&str; 4]>, uart_type: Option<&str>| {
            let usb_device = roots.sys.join("devices").join(format!("of-{name}"));
            let device = usb_device.join("interface");
            fs::create_dir_all(&device).unwrap();
            for (file, text) in ["idVendor", "idProduct", "serial", "product"].iter().zip(usb.into_iter().flatten()) {
                fs::write(usb_device.join(file), format!("{text}\n")).unwrap();
            }
            symlink(format!("/drivers/{driver}"), device.join("driver")).unwrap();
            let terminal = roots.sys.join("class/tty").join(name);
            fs::create_dir_all(&terminal).unwrap();
            symlink(&device, terminal.join("device")).unwrap();
            if let Some(uart_type) = uart_type {
                fs::write(terminal.join("type"), uart_type).unwrap();
            }
            fs::write(roots.dev.join(name), "").unwrap();
        };
        plug("ttyS0", "serial8250", None, Some("4"));
        plug("ttyS1", "serial8250", None, Some("0"));
        plug("ttyUSB0", "ch341-uart", Some(["1a86", "7523", "", "USB Serial"]), None);
        plug("ttyACM0", "cdc_acm", Some(["2341", "0042", "7573530", "Mega\u{1b}[2J 2560"]), None);
        fs::create_dir_all(roots.sys.join("class/tty/tty1")).unwrap();
        symlink(roots.dev.join("ttyACM0"), roots.dev.join("serial/by-id/usb-Arduino-if00")).unwrap();
        roots
    }

    #[test]
    fn ports_are_listed_with_their_identity() {
        let folder = tempfile::tempdir().unwrap();
        let roots = machine(folder.path());
        let ports = roots.list();
        let names: Vec<_> = ports.iter().map(|port| port.path.file_name().unwrap().to_str().unwrap()).collect();
        assert_eq!(names, ["ttyACM0", "ttyUSB0", "ttyS0"]);
        let arduino = ports[0].usb.as_ref().unwrap();
        assert_eq!((arduino.vid, arduino.pid, arduino.serial.as_deref()), (0x2341, 0x42, Some("7573530")));
        assert_eq!(arduino.product.as_deref(), Some("Mega[2J 2560"), "without the escape");
        assert_eq!(arduino.port_name(), "usb:2341:0042:7573530");
        assert!(ports[0].by_id.as_ref().unwrap().ends_with("dev/serial/by-id/usb-Arduino-if00"));
        assert_eq!(ports[1].usb.as_ref().unwrap().port_name(), "usb:1a86:7523");
        assert_eq!((ports[2].usb.as_ref(), ports[2].driver.as_deref()), (None, Some("serial8250")));
    }
}
