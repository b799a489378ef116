//! Listening sockets: TCP addresses, and a Unix socket that only its owner can open.

use std::io;
use std::net::{SocketAddr, TcpListener};
use std::os::unix::fs::{FileTypeExt as _, PermissionsExt as _};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};

/// A listening socket.
#[derive(Debug)]
pub enum Listener {
    /// For JSON lines.
    Tcp(TcpListener),
    /// For JSON lines; its file is removed at the end.
    Unix(UnixListener, PathBuf),
    /// For `/metrics` and `/healthz`.
    Http(TcpListener),
}

/// An address or path that cannot be listened on.
#[derive(Debug, thiserror::Error)]
#[error("{address}: {cause}")]
pub struct ListenerError {
    /// The address or the file.
    pub address: String,
    /// Why, and what to do about it.
    pub cause: String,
}

/// The kernel's send buffer for each client, bytes. With more, a slow client would read old data.
const SEND_BUFFER: usize = 64 << 10;

impl Listener {
    /// Opens a TCP port for JSON lines.
    ///
    /// # Errors
    /// When the system refuses.
    pub fn tcp(address: SocketAddr) -> Result<Self, ListenerError> {
        bind(address).map(Self::Tcp)
    }

    /// Opens a TCP port for `/metrics` and `/healthz`.
    ///
    /// # Errors
    /// When the system refuses.
    pub fn http(address: SocketAddr) -> Result<Self, ListenerError> {
        bind(address).map(Self::Http)
    }

    /// Opens a Unix socket with mode 0600 from the start. An abandoned socket of that name is replaced.
    ///
    /// # Errors
    /// When the system refuses, another program listens there, or the path is not a socket.
    pub fn unix(path: &Path) -> Result<Self, ListenerError> {
        let failure = |cause: String| ListenerError { address: path.display().to_string(), cause };
        match std::fs::symlink_metadata(path) {
            Ok(there) if !there.file_type().is_socket() => {
                return Err(failure("there is a file that is no socket; name another with --socket PATH".into()));
            }
            Ok(_) if UnixStream::connect(path).is_ok() => {
                return Err(failure("another program listens there; name another with --socket PATH".into()));
            }
            _ => {}
        }
        let listener =
            bind_privately(path).map_err(|error| failure(format!("{error}; name another with --socket PATH")))?;
        Ok(Self::Unix(listener, path.into()))
    }

    /// The address or path, for messages.
    #[must_use]
    pub fn address(&self) -> String {
        match self {
            Self::Tcp(listener) => address(listener),
            Self::Unix(_, path) => path.display().to_string(),
            Self::Http(listener) => format!("http://{}", address(listener)),
        }
    }
}

fn address(listener: &TcpListener) -> String {
    listener.local_addr().map_or_else(|error| error.to_string(), |address| address.to_string())
}

fn bind(address: SocketAddr) -> Result<TcpListener, ListenerError> {
    let open = || -> io::Result<TcpListener> {
        let listener = TcpListener::bind(address)?;
        // Accepted connections inherit it.
        rustix::net::sockopt::set_socket_send_buffer_size(&listener, SEND_BUFFER)?;
        listener.set_nonblocking(true)?;
        Ok(listener)
    };
    open().map_err(|error| {
        let cause = format!("{error}; is another slamd running? Another port can be given");
        ListenerError { address: address.to_string(), cause }
    })
}

/// Binds the socket in a private folder, sets its mode and renames it, so that other users can never connect.
fn bind_privately(path: &Path) -> io::Result<UnixListener> {
    let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or_else(|| Path::new("."));
    let only_owner = std::fs::Permissions::from_mode(0o700);
    let folder = tempfile::Builder::new().prefix(".slamd").permissions(only_owner).tempdir_in(parent)?;
    let inside = folder.path().join("s");
    let listener = UnixListener::bind(&inside)?;
    std::fs::set_permissions(&inside, std::fs::Permissions::from_mode(0o600))?;
    listener.set_nonblocking(true)?;
    std::fs::rename(&inside, path)?;
    Ok(listener)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_socket_is_for_its_owner_and_takes_the_place_of_a_dead_one_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("api.sock");
        let first = Listener::unix(&path).unwrap();
        assert_eq!(std::fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "nothing else is left");
        assert!(Listener::unix(&path).unwrap_err().to_string().contains("another program listens"));
        drop(first);
        Listener::unix(&path).unwrap();
        std::fs::remove_file(&path).unwrap();
        std::fs::write(&path, "precious").unwrap();
        assert!(Listener::unix(&path).unwrap_err().to_string().contains("no socket"));
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "precious");
    }
}
