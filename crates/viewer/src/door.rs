//! The port that viewers connect to, in front of Rerun's server, which answers everybody.
//!
//! Rerun checks neither `Host` nor `Origin`, so the page of another site could read the session: by a name that leads here (DNS rebinding), or from
//! another port of this machine. It also takes connections without limit. So Rerun listens at a random loopback address, and the door passes on
//! what comes from a viewer. Viewers speak HTTP/2, which no browser speaks without encryption. Browsers speak HTTP/1.1: the door checks each
//! request, and lets a connection have one.

use std::collections::hash_map::RandomState;
use std::hash::{BuildHasher as _, Hasher as _};
use std::io::{self, ErrorKind, Read as _, Write as _};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, Shutdown, SocketAddr, TcpListener, TcpStream};
use std::os::fd::AsRawFd as _;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Limit of the connections; further ones are closed.
const MAX_CONNECTIONS: usize = 32;
/// Limit of those from one address of the network: a viewer has one, a browser six at most.
const MAX_OF_ADDRESS: usize = 8;
/// Descriptors that are left to the session.
const RESERVED: u64 = 64;
/// A connection that has not sent its request's head by then is closed.
const HEAD_TIMEOUT: Duration = Duration::from_secs(5);
/// Longest head of a request, bytes.
const MAX_HEAD_BYTES: usize = 16 << 10;
const MAX_HEADERS: usize = 64;
/// Rerun's server is up within this.
const START_TIMEOUT: Duration = Duration::from_secs(5);
/// Longest wait for connections at the end.
const END_TIMEOUT: Duration = Duration::from_millis(500);
const RETRY: Duration = Duration::from_millis(20);
/// Wait after a failed accept, as when no file descriptor is free.
const ACCEPT_RETRY: Duration = Duration::from_millis(100);
/// How every HTTP/2 connection begins.
const PREFACE: &[u8] = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";
/// What a page of another site is told.
const REFUSED: &str = "refused: the request is a page's of another site, or no request; Host must be an IP address or localhost, and Origin, if \
                       there is one, must be this server or the web viewer that slamd has started\n";

/// The open door; dropping it closes it.
#[derive(Debug)]
pub(super) struct Door {
    shared: Arc<Shared>,
    address: SocketAddr,
}

#[derive(Debug)]
struct Shared {
    behind: SocketAddr,
    /// Pages that may read the session, as browsers name them in `Origin`.
    pages: Mutex<Vec<String>>,
    /// Where the open connections come from.
    open: Mutex<Vec<IpAddr>>,
    is_closed: AtomicBool,
}

impl Door {
    /// Opens the door at an address in front of the server at `behind`, which may come up later.
    ///
    /// # Errors
    /// When the address cannot be listened at.
    pub(super) fn open(address: SocketAddr, behind: SocketAddr) -> io::Result<Self> {
        let listener = TcpListener::bind(address)?;
        let address = listener.local_addr()?;
        let shared = Arc::new(Shared {
            behind,
            pages: Mutex::default(),
            open: Mutex::default(),
            is_closed: AtomicBool::new(false),
        });
        let accepting = Arc::clone(&shared);
        std::thread::Builder::new().name("viewer-door".into()).spawn(move || accept(&listener, &accepting))?;
        Ok(Self { shared, address })
    }

    /// Lets in the page of a web viewer on this machine.
    pub(super) fn let_in(&self, page_port: u16) {
        let mut pages = self.shared.pages.lock().unwrap_or_else(PoisonError::into_inner);
        pages.extend(["127.0.0.1", "localhost"].map(|host| format!("http://{host}:{page_port}")));
    }
}

impl Shared {
    fn open(&self) -> MutexGuard<'_, Vec<IpAddr>> {
        self.open.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Door {
    #[expect(clippy::disallowed_methods, reason = "the end of a process must not wait long for a viewer")]
    fn drop(&mut self) {
        self.shared.is_closed.store(true, Ordering::Relaxed);
        // Wakes the thread that accepts.
        let _ = TcpStream::connect_timeout(&super::reached(self.address), HEAD_TIMEOUT);
        // What the server sent last is still passed on.
        let end = Instant::now() + END_TIMEOUT;
        while !self.shared.open().is_empty() && Instant::now() < end {
            std::thread::sleep(RETRY);
        }
    }
}

/// A free address that only this machine reaches and no page can guess.
pub(super) fn hidden_address() -> io::Result<SocketAddr> {
    let [a, b, c, ..] = RandomState::new().build_hasher().finish().to_le_bytes();
    let hidden = Ipv4Addr::new(127, a, b, c.clamp(1, 254));
    // Other systems than Linux have one loopback address.
    let listener = TcpListener::bind((hidden, 0)).or_else(|_| TcpListener::bind((Ipv4Addr::LOCALHOST, 0)))?;
    listener.local_addr()
}

#[expect(clippy::disallowed_methods, reason = "without descriptors the loop must not spin")]
fn accept(listener: &TcpListener, shared: &Arc<Shared>) {
    loop {
        let accepted = listener.accept();
        if shared.is_closed.load(Ordering::Relaxed) {
            return;
        }
        let (stream, address) = match accepted {
            Ok((stream, from)) => (stream, from.ip().to_canonical()),
            Err(error) => {
                tracing::warn!("viewer: cannot accept a connection: {error}");
                std::thread::sleep(ACCEPT_RETRY);
                continue;
            }
        };
        let Some(place) = Place::new(shared, address) else {
            tracing::warn!(
                "viewer: a connection is refused: {MAX_CONNECTIONS} are open, or {MAX_OF_ADDRESS} from the same address"
            );
            continue;
        };
        if !is_spare(&stream) {
            tracing::warn!("viewer: a connection is refused: too few file descriptors are free; see `ulimit -n`");
            continue;
        }
        let thread = std::thread::Builder::new().name("viewer-door".into());
        // A viewer that leaves is no failure.
        if let Err(error) = thread.spawn(move || drop(pass(stream, &place))) {
            tracing::warn!("viewer: a connection is refused: {error}");
        }
    }
}

/// Holds a connection's place until it is dropped.
struct Place {
    shared: Arc<Shared>,
    address: IpAddr,
}

impl Place {
    fn new(shared: &Arc<Shared>, address: IpAddr) -> Option<Self> {
        let mut open = shared.open();
        let of_address = open.iter().filter(|other| **other == address).count();
        let is_crowd = !address.is_loopback() && of_address >= MAX_OF_ADDRESS;
        if open.len() >= MAX_CONNECTIONS || is_crowd {
            return None;
        }
        open.push(address);
        Some(Self { shared: Arc::clone(shared), address })
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let mut open = self.shared.open();
        let found = open.iter().position(|other| *other == self.address);
        found.map(|index| open.swap_remove(index));
    }
}

/// True if the connection leaves descriptors to the session: the system gives the lowest free number.
fn is_spare(stream: &TcpStream) -> bool {
    let limit = rustix::process::getrlimit(rustix::process::Resource::Nofile).current.unwrap_or(u64::MAX);
    let number = u64::try_from(stream.as_raw_fd()).unwrap_or(u64::MAX);
    number < limit.saturating_sub(RESERVED.min(limit / 2))
}

/// Passes a connection on, if it may come in.
fn pass(mut client: TcpStream, place: &Place) -> io::Result<()> {
    client.set_read_timeout(Some(HEAD_TIMEOUT))?;
    let mut head = Vec::new();
    let forwarded = loop {
        let mut chunk = [0; 2048];
        let count = client.read(&mut chunk)?;
        head.extend_from_slice(chunk.get(..count).unwrap_or_default());
        let pages = place.shared.pages.lock().unwrap_or_else(PoisonError::into_inner).clone();
        match judge(&head, &pages) {
            Verdict::Wait if count > 0 && head.len() < MAX_HEAD_BYTES => {}
            Verdict::Pass(forwarded) => break forwarded,
            _ => {
                client.write_all(&forbidden())?;
                return client.shutdown(Shutdown::Both);
            }
        }
    };
    let mut server = connect(place.shared.behind)?;
    for stream in [&client, &server] {
        stream.set_read_timeout(None)?;
        stream.set_nodelay(true)?;
        // A viewer whose machine was switched off gives its place back.
        rustix::net::sockopt::set_socket_keepalive(stream, true)?;
    }
    server.write_all(&forwarded)?;
    let (mut from_client, mut to_server) = (client.try_clone()?, server.try_clone()?);
    let sending = std::thread::Builder::new().name("viewer-door".into()).spawn(move || {
        let _ = io::copy(&mut from_client, &mut to_server);
        let _ = to_server.shutdown(Shutdown::Write);
    })?;
    let _ = io::copy(&mut server, &mut client);
    // Ends the other direction, too.
    let _ = (client.shutdown(Shutdown::Both), server.shutdown(Shutdown::Both));
    let _ = sending.join();
    Ok(())
}

/// The answer to a request that is refused.
fn forbidden() -> Vec<u8> {
    let length = REFUSED.len();
    let head = format!(
        "HTTP/1.1 403 Forbidden\r\nContent-Type: text/plain; charset=utf-8\r\nContent-Length: {length}\r\n\
         X-Content-Type-Options: nosniff\r\nConnection: close\r\n\r\n"
    );
    (head + REFUSED).into_bytes()
}

/// Connects to Rerun's server, which may be about to start.
#[expect(clippy::disallowed_methods, reason = "a server is up when it is up")]
fn connect(address: SocketAddr) -> io::Result<TcpStream> {
    let begin = Instant::now();
    loop {
        match TcpStream::connect(address) {
            Err(error) if error.kind() == ErrorKind::ConnectionRefused && begin.elapsed() < START_TIMEOUT => {
                std::thread::sleep(RETRY);
            }
            connected => return connected,
        }
    }
}

/// What to do with a connection that began so.
#[derive(Debug, PartialEq, Eq)]
enum Verdict {
    Wait,
    /// Pass these bytes on, and all that follow.
    Pass(Vec<u8>),
    Refuse,
}

fn judge(head: &[u8], pages: &[String]) -> Verdict {
    if head.starts_with(PREFACE) {
        return Verdict::Pass(head.to_vec());
    }
    if PREFACE.starts_with(head) {
        return Verdict::Wait;
    }
    let mut headers = [httparse::EMPTY_HEADER; MAX_HEADERS];
    let mut request = httparse::Request::new(&mut headers);
    let body = match request.parse(head) {
        Ok(httparse::Status::Complete(length)) => head.get(length..).unwrap_or_default(),
        Ok(httparse::Status::Partial) => return Verdict::Wait,
        Err(_) => return Verdict::Refuse,
    };
    if !is_own(request.headers, pages) {
        return Verdict::Refuse;
    }
    // One request for each connection: the server does not read what follows it.
    let mut forwarded = Vec::new();
    let (method, path) = (request.method.unwrap_or_default(), request.path.unwrap_or_default());
    forwarded.extend_from_slice(format!("{method} {path} HTTP/1.1\r\n").as_bytes());
    let dropped = ["connection", "upgrade", "http2-settings", "keep-alive", "proxy-connection"];
    for header in request.headers.iter() {
        if !dropped.iter().any(|name| header.name.eq_ignore_ascii_case(name)) {
            forwarded.extend_from_slice(header.name.as_bytes());
            forwarded.extend_from_slice(b": ");
            forwarded.extend_from_slice(header.value);
            forwarded.extend_from_slice(b"\r\n");
        }
    }
    forwarded.extend_from_slice(b"Connection: close\r\n\r\n");
    forwarded.extend_from_slice(body);
    Verdict::Pass(forwarded)
}

/// True if a browser's request names this server by an address, and comes from a page of it or of our web viewer.
fn is_own(headers: &[httparse::Header<'_>], pages: &[String]) -> bool {
    let values = |name: &'static str| {
        let named = headers.iter().filter(move |header| header.name.eq_ignore_ascii_case(name));
        named.map(|header| std::str::from_utf8(header.value).unwrap_or_default())
    };
    let mut hosts = values("host");
    let (Some(host), None) = (hosts.next(), hosts.next()) else { return false };
    let is_of_ours = |origin: &str| {
        let is_same = origin.strip_prefix("http://").is_some_and(|origin| origin.eq_ignore_ascii_case(host));
        is_same || pages.iter().any(|page| page == origin)
    };
    is_address(host) && values("origin").all(is_of_ours)
}

/// True if a `Host` is an IP address or localhost, with or without a port.
fn is_address(host: &str) -> bool {
    let name = host.rsplit_once(':').filter(|(_, port)| port.parse::<u16>().is_ok()).map_or(host, |(name, _)| name);
    let v6 = host.strip_prefix('[').and_then(|host| host.strip_suffix(']'));
    name.eq_ignore_ascii_case("localhost")
        || name.parse::<IpAddr>().is_ok()
        || host.parse::<SocketAddr>().is_ok()
        || v6.is_some_and(|text| text.parse::<Ipv6Addr>().is_ok())
}

#[cfg(test)]
mod tests;
