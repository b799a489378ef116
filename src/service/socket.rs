//! The service manager's end of a datagram socket.

use std::ffi::OsStr;
use std::io;
use std::os::linux::net::SocketAddrExt as _;
use std::os::unix::ffi::OsStrExt as _;
use std::os::unix::net::{SocketAddr, UnixDatagram};

/// A socket that never waits.
#[derive(Debug)]
pub(super) struct Socket(UnixDatagram);

impl Socket {
    /// Connects to a path, or to an abstract name if it begins with `@`.
    pub(super) fn connect(path: &OsStr) -> io::Result<Self> {
        let address = match path.as_bytes().strip_prefix(b"@") {
            Some(name) => SocketAddr::from_abstract_name(name)?,
            None => SocketAddr::from_pathname(path)?,
        };
        let socket = UnixDatagram::unbound()?;
        socket.set_nonblocking(true)?;
        socket.connect_addr(&address)?;
        Ok(Self(socket))
    }

    /// Sends a message; false if the socket is full or has no receiver.
    pub(super) fn send(&self, message: &str) -> bool {
        self.0.send(message.as_bytes()).is_ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_socket_is_not_waited_for() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("notify");
        let manager = UnixDatagram::bind(&path).unwrap();
        let socket = Socket::connect(path.as_os_str()).unwrap();
        let sent = (0..10_000).take_while(|_| socket.send("WATCHDOG=1")).count();
        assert!((1..10_000).contains(&sent), "{sent}");
        manager.recv(&mut [0; 64]).unwrap();
        assert!(socket.send("WATCHDOG=1"), "there is room again");
        drop(manager);
        assert!(!socket.send("WATCHDOG=1"));
    }

    #[test]
    fn an_abstract_name_is_found() {
        let name = format!("slamd-test-{}", std::process::id());
        let manager = UnixDatagram::bind_addr(&SocketAddr::from_abstract_name(&name).unwrap()).unwrap();
        assert!(Socket::connect(OsStr::new(&format!("@{name}"))).unwrap().send("READY=1"));
        let mut message = [0; 64];
        let length = manager.recv(&mut message).unwrap();
        assert_eq!(&message[..length], b"READY=1");
        assert!(Socket::connect(OsStr::new("/nowhere/notify")).is_err());
    }
}
