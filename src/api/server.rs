//! The thread that serves all clients: listeners, limits, and the newest snapshot.

use super::client::End;
use super::connection;
use super::listener::Listener;
use super::mailbox::Mailbox;
use super::metrics::Served;
use super::pages;
use super::report::map_line;
use super::right::Right;
use super::tap::Tap;
use super::token::Token;
use super::waiting::{Seat, WaitingRoom};
use crate::descriptors;
use crate::drive::Desk;
use crate::recorder::DiskHealth;
use bytes::Bytes;
use slamd_core::{Snapshot, Timestamp};
use std::cell::Cell;
use std::io;
use std::os::fd::AsFd;
use std::path::PathBuf;
use std::rc::Rc;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tokio::net::{TcpListener, UnixListener};
use tokio::sync::{oneshot, watch};
use tokio::task::{LocalSet, spawn_local};

/// Serves a session to clients from its own thread until it is dropped.
#[derive(Debug)]
pub struct Server {
    mailbox: Arc<Mailbox>,
    end: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
    files: Vec<PathBuf>,
}

/// Limits on open connections; further ones are refused. Clients of the Unix socket, which only its owner can open, have places of their own.
const MAX_CLIENTS: usize = 64;
const MAX_OWNERS: usize = 16;
const MAX_PAGES: usize = 16;
/// Connections that have not sent the token or the request, and how many of them may be of one address. Newcomers take the places of those that
/// have waited longest.
const MAX_WAITING: usize = 64;
const MAX_WAITING_OF_ADDRESS: usize = 16;
/// What a client is told that is refused.
pub(super) const TOO_MANY: &str = "too many clients: all places are taken; try again later";
/// Refused clients that are sent the reason at the same time; others are closed without one.
const MAX_REFUSING: usize = 16;
/// A map younger than this is sent again instead of being copied.
const MAP_REUSE: Duration = Duration::from_millis(500);
/// Wait after a failed accept, as when no file descriptor is free.
const ACCEPT_RETRY: Duration = Duration::from_millis(100);

/// How clients come to drive, where slamd runs with `--drive`.
#[derive(Clone, Debug)]
pub struct DriveAccess {
    /// Where their orders go. Clients of the Unix socket need nothing more.
    pub desk: Arc<Desk>,
    /// The token that TCP clients need; without one they never drive.
    pub token: Option<Token>,
}

impl Server {
    /// Begins to serve on these listeners. TCP clients must send the token, if there is one. Nobody drives without `drive`.
    ///
    /// # Errors
    /// When the system refuses a thread or its event loop.
    pub fn begin(
        listeners: Vec<Listener>,
        token: Option<Token>,
        drive: Option<DriveAccess>,
        disk: Arc<DiskHealth>,
    ) -> io::Result<Self> {
        let mailbox = Arc::<Mailbox>::default();
        let files = listeners.iter().filter_map(|listener| match listener {
            Listener::Unix(_, path) => Some(path.clone()),
            _ => None,
        });
        let files = files.collect();
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        let (end, is_over) = oneshot::channel::<()>();
        let thread = {
            let mailbox = Arc::clone(&mailbox);
            std::thread::Builder::new().name("api".into()).spawn(move || {
                let tasks = LocalSet::new();
                tasks.block_on(&runtime, async move {
                    ServerState::open(mailbox, disk, listeners, token, drive);
                    let _ = is_over.await;
                });
            })?
        };
        Ok(Self { mailbox, end: Some(end), thread: Some(thread), files })
    }

    /// The tap that copies the session of this robot.
    #[must_use]
    pub fn tap(&self, robot: &str) -> Tap {
        Tap::new(Arc::clone(&self.mailbox), robot.into())
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.end.take();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
        for file in &self.files {
            let _ = std::fs::remove_file(file);
        }
    }
}

/// State shared by all tasks of the thread.
pub(super) struct ServerState {
    drive: Option<DriveAccess>,
    pub(super) mailbox: Arc<Mailbox>,
    pub(super) disk: Arc<DiskHealth>,
    pub(super) begin: Instant,
    pub(super) snapshot: watch::Sender<Arc<Snapshot>>,
    /// The newest map as a line; none while the map is empty.
    pub(super) map: watch::Sender<Option<Bytes>>,
    mapped: Cell<Option<Timestamp>>,
    clients: Cell<usize>,
    owners: Cell<usize>,
    strangers: Rc<WaitingRoom>,
    visitors: Rc<WaitingRoom>,
    pages: Cell<usize>,
    refusing: Cell<usize>,
    refused: Cell<u64>,
    slow: Cell<u64>,
}

impl ServerState {
    #[expect(clippy::disallowed_methods, reason = "clients live in real time")]
    fn open(
        mailbox: Arc<Mailbox>,
        disk: Arc<DiskHealth>,
        listeners: Vec<Listener>,
        token: Option<Token>,
        drive: Option<DriveAccess>,
    ) {
        let state = Rc::new(Self {
            mailbox,
            disk,
            drive,
            begin: Instant::now(),
            snapshot: watch::Sender::default(),
            map: watch::Sender::default(),
            mapped: Cell::default(),
            clients: Cell::default(),
            owners: Cell::default(),
            strangers: WaitingRoom::new(MAX_WAITING, MAX_WAITING_OF_ADDRESS),
            visitors: WaitingRoom::new(MAX_WAITING, MAX_WAITING_OF_ADDRESS),
            pages: Cell::default(),
            refusing: Cell::default(),
            refused: Cell::default(),
            slow: Cell::default(),
        });
        spawn_local(distribute(Rc::clone(&state)));
        for listener in listeners {
            let (address, state) = (listener.address(), Rc::clone(&state));
            spawn_local(async move {
                if let Err(error) = accept_all(state, listener, token).await {
                    tracing::error!("api: cannot accept connections on {address}: {error}");
                }
            });
        }
    }

    pub(super) fn now(&self) -> Timestamp {
        Timestamp::default() + self.begin.elapsed()
    }

    /// The newest map, if it is younger than [`MAP_REUSE`]: the pipeline copies it at most twice a second for any number of clients.
    pub(super) fn fresh_map(&self, now: Timestamp) -> Option<Option<Bytes>> {
        self.mapped.get().filter(|mapped| *mapped + MAP_REUSE > now).map(|_| self.map.borrow().clone())
    }

    pub(super) fn served(&self) -> Served {
        Served {
            clients: self.clients.get() + self.owners.get(),
            refused: self.refused.get(),
            sent_away: self.strangers.sent_away() + self.visitors.sent_away(),
            slow: self.slow.get(),
        }
    }

    /// Where orders go; none without `--drive`.
    pub(super) fn desk(&self) -> Option<Arc<Desk>> {
        self.drive.as_ref().map(|drive| Arc::clone(&drive.desk))
    }

    /// The right of a client at the socket of slamd's owner, or of another one.
    fn right(&self, is_owner: bool) -> Right {
        match &self.drive {
            None => Right::default(),
            Some(_) if is_owner => Right::of_owner(),
            Some(drive) => Right::with_token(drive.token),
        }
    }

    /// A place for an answer; none if there are too many.
    pub(super) fn answering(self: &Rc<Self>) -> Option<Counted> {
        Counted::new(self, |state| &state.pages, MAX_PAGES)
    }

    pub(super) fn count(&self, end: End) {
        self.refused.set(self.refused.get() + u64::from(end == End::Refused));
        self.slow.set(self.slow.get() + u64::from(end == End::Slow));
    }
}

/// Counts one connection until it is dropped.
pub(super) struct Counted(Rc<ServerState>, fn(&ServerState) -> &Cell<usize>);

impl Counted {
    fn new(state: &Rc<ServerState>, which: fn(&ServerState) -> &Cell<usize>, most: usize) -> Option<Self> {
        let cell = which(state);
        (cell.get() < most).then(|| {
            cell.set(cell.get() + 1);
            Self(Rc::clone(state), which)
        })
    }
}

impl Drop for Counted {
    fn drop(&mut self) {
        let cell = self.1(&self.0);
        cell.set(cell.get() - 1);
    }
}

/// What a client of the JSON lines takes.
pub(super) enum Place {
    /// It has not shown the token yet.
    Stranger(Seat),
    /// A place that is kept until it leaves.
    Client(#[expect(dead_code, reason = "it is given back when it is dropped")] Counted),
}

impl Place {
    /// Gives a client that has shown the token a place of its own. False if there is none.
    pub(super) fn take(&mut self, state: &Rc<ServerState>) -> bool {
        if matches!(self, Self::Client(_)) {
            return true;
        }
        match Counted::new(state, |state| &state.clients, MAX_CLIENTS) {
            Some(counted) => {
                *self = Self::Client(counted);
                true
            }
            None => false,
        }
    }

    /// Returns when a newcomer takes it.
    pub(super) async fn lost(&mut self) {
        match self {
            Self::Stranger(seat) => seat.lost().await,
            Self::Client(_) => std::future::pending().await,
        }
    }
}

/// Passes the pipeline's snapshots and maps to all clients.
async fn distribute(state: Rc<ServerState>) {
    loop {
        let (snapshot, map) = state.mailbox.next().await;
        if let Some((at, raster)) = map {
            let line = map_line(at, &raster).unwrap_or_else(|error| {
                tracing::warn!("api: a map cannot be drawn: {error}");
                None
            });
            state.mapped.set(Some(state.now()));
            state.map.send_replace(line);
        }
        state.snapshot.send_replace(Arc::new(snapshot));
    }
}

/// Accepts connections.
async fn accept_all(state: Rc<ServerState>, listener: Listener, token: Option<Token>) -> io::Result<()> {
    match listener {
        Listener::Tcp(listener) => {
            let listener = TcpListener::from_std(listener)?;
            loop {
                let Some((stream, from)) = accepted(&state, listener.accept().await).await else { continue };
                // Send each pose at once instead of collecting several (Nagle's algorithm).
                let _ = stream.set_nodelay(true);
                let place = match token {
                    Some(_) => Some(Place::Stranger(state.strangers.enter(Some(from.ip())))),
                    None => Counted::new(&state, |state| &state.clients, MAX_CLIENTS).map(Place::Client),
                };
                serve_client(&state, place, stream, from.to_string(), (token, state.right(false)));
            }
        }
        Listener::Unix(listener, path) => {
            let (listener, peer) = (UnixListener::from_std(listener)?, path.display().to_string());
            loop {
                let Some((stream, _)) = accepted(&state, listener.accept().await).await else { continue };
                // The file's mode lets only its owner connect, so no token is needed.
                let place = Counted::new(&state, |state| &state.owners, MAX_OWNERS).map(Place::Client);
                serve_client(&state, place, stream, peer.clone(), (None, state.right(true)));
            }
        }
        Listener::Http(listener) => {
            let listener = TcpListener::from_std(listener)?;
            loop {
                let Some((stream, from)) = accepted(&state, listener.accept().await).await else { continue };
                let seat = state.visitors.enter(Some(from.ip()));
                spawn_local(pages::serve(Rc::clone(&state), seat, stream, token));
            }
        }
    }
}

/// The accepted connection, if it leaves descriptors for the session; after a failure it waits, because a missing descriptor would make the
/// loop spin.
async fn accepted<T: AsFd, A>(state: &ServerState, result: io::Result<(T, A)>) -> Option<(T, A)> {
    match result {
        Ok((stream, from)) if descriptors::is_spare(&stream) => Some((stream, from)),
        Ok(_) => {
            state.refused.set(state.refused.get() + 1);
            tracing::warn!("api: a connection is refused: too few file descriptors are free; see `ulimit -n`");
            None
        }
        Err(error) => {
            tracing::warn!("api: cannot accept a connection: {error}");
            tokio::time::sleep(ACCEPT_RETRY).await;
            None
        }
    }
}

fn serve_client<S>(
    state: &Rc<ServerState>,
    place: Option<Place>,
    stream: S,
    peer: String,
    access: (Option<Token>, Right),
) where
    S: tokio::io::AsyncRead + tokio::io::AsyncWrite + Unpin + 'static,
{
    if let Some(place) = place {
        spawn_local(connection::serve(Rc::clone(state), place, stream, peer, access));
        return;
    }
    state.refused.set(state.refused.get() + 1);
    if let Some(counted) = Counted::new(state, |state| &state.refusing, MAX_REFUSING) {
        spawn_local(connection::refuse(counted, stream));
    }
}
