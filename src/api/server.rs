//! The thread around all clients: doors, limits, what is newest.

use super::client::End;
use super::listener::Listener;
use super::mailbox::Mailbox;
use super::metrics::Served;
use super::pages;
use super::report::map_line;
use super::tap::Tap;
use super::token::Token;
use super::visit;
use bytes::Bytes;
use slamd_core::{Snapshot, Timestamp};
use std::cell::Cell;
use std::io;
use std::path::PathBuf;
use std::rc::Rc;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tokio::net::{TcpListener, UnixListener};
use tokio::sync::{oneshot, watch};
use tokio::task::{LocalSet, spawn_local};

/// Serves a session to whoever listens, from a thread of its own, until it is dropped.
#[derive(Debug)]
pub struct Server {
    mailbox: Arc<Mailbox>,
    end: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
    files: Vec<PathBuf>,
}

/// More clients are turned away.
const MAX_CLIENTS: usize = 64;
const MAX_PAGES: usize = 8;
/// Those who are told why they must go.
const MAX_PARTING: usize = 16;
/// A map of so long ago need not be copied anew.
const FRESH: Duration = Duration::from_millis(500);
/// Without a descriptor nobody is let in for a moment.
const BREATH: Duration = Duration::from_millis(100);

impl Server {
    /// Begins to serve at these doors. Where a token is given, whoever comes over TCP must know it.
    ///
    /// # Errors
    /// When the system refuses a thread or its event loop.
    pub fn begin(listeners: Vec<Listener>, token: Option<Token>) -> io::Result<Self> {
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
                let state = LocalSet::new();
                state.block_on(&runtime, async move {
                    ServerState::open(mailbox, listeners, token);
                    let _ = is_over.await;
                });
            })?
        };
        Ok(Self { mailbox, end: Some(end), thread: Some(thread), files })
    }

    /// What looks at the session of this robot.
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

/// What all tasks of the thread share.
pub(super) struct ServerState {
    pub(super) mailbox: Arc<Mailbox>,
    pub(super) begin: Instant,
    pub(super) moment: watch::Sender<Arc<Snapshot>>,
    /// The newest map as a line; none where nothing is known of it.
    pub(super) map: watch::Sender<Option<Bytes>>,
    mapped: Cell<Option<Timestamp>>,
    clients: Cell<usize>,
    pages: Cell<usize>,
    parting: Cell<usize>,
    refused: Cell<u64>,
    slow: Cell<u64>,
}

impl ServerState {
    #[expect(clippy::disallowed_methods, reason = "clients live in real time")]
    fn open(mailbox: Arc<Mailbox>, listeners: Vec<Listener>, token: Option<Token>) {
        let state = Rc::new(Self {
            mailbox,
            begin: Instant::now(),
            moment: watch::Sender::default(),
            map: watch::Sender::default(),
            mapped: Cell::default(),
            clients: Cell::default(),
            pages: Cell::default(),
            parting: Cell::default(),
            refused: Cell::default(),
            slow: Cell::default(),
        });
        spawn_local(listen(Rc::clone(&state)));
        for listener in listeners {
            let (place, state) = (listener.place(), Rc::clone(&state));
            spawn_local(async move {
                if let Err(error) = admit(state, listener, token).await {
                    tracing::error!("api: nobody can come in at {place}: {error}");
                }
            });
        }
    }

    pub(super) fn now(&self) -> Timestamp {
        Timestamp::default() + self.begin.elapsed()
    }

    /// The newest map, if it is new enough to be sent again: however many ask, it is copied no more than twice a second.
    pub(super) fn fresh_map(&self, now: Timestamp) -> Option<Option<Bytes>> {
        self.mapped.get().filter(|mapped| *mapped + FRESH > now).map(|_| self.map.borrow().clone())
    }

    pub(super) fn served(&self) -> Served {
        Served { clients: self.clients.get(), refused: self.refused.get(), slow: self.slow.get() }
    }

    pub(super) fn count(&self, end: End) {
        self.slow.set(self.slow.get() + u64::from(end == End::Slow));
    }
}

/// One more of something, for as long as this lives.
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

/// Hands on what the pipeline's thread leaves.
async fn listen(state: Rc<ServerState>) {
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
        state.moment.send_replace(Arc::new(snapshot));
    }
}

/// Lets clients in.
async fn admit(state: Rc<ServerState>, listener: Listener, token: Option<Token>) -> io::Result<()> {
    match listener {
        Listener::Tcp(listener) => {
            let listener = TcpListener::from_std(listener)?;
            loop {
                let Some((stream, from)) = come_in(listener.accept().await).await else { continue };
                // A pose is not held back until there are more.
                let _ = stream.set_nodelay(true);
                welcome(&state, stream, from.to_string(), token);
            }
        }
        Listener::Unix(listener, path) => {
            let (listener, who) = (UnixListener::from_std(listener)?, path.display().to_string());
            loop {
                let Some((stream, _)) = come_in(listener.accept().await).await else { continue };
                // Whoever may open the file is its owner.
                welcome(&state, stream, who.clone(), None);
            }
        }
        Listener::Http(listener) => {
            let listener = TcpListener::from_std(listener)?;
            loop {
                let Some((stream, _)) = come_in(listener.accept().await).await else { continue };
                let counted = Counted::new(&state, |state| &state.pages, MAX_PAGES);
                let Some(counted) = counted else { continue };
                spawn_local(pages::serve(Rc::clone(&state), counted, stream, token));
            }
        }
    }
}

/// Who has come, if anybody. Without a free descriptor nobody can for a while.
async fn come_in<T>(accepted: io::Result<T>) -> Option<T> {
    match accepted {
        Ok(accepted) => Some(accepted),
        Err(error) => {
            tracing::debug!("api: nobody can come in: {error}");
            tokio::time::sleep(BREATH).await;
            None
        }
    }
}

fn welcome<S>(state: &Rc<ServerState>, stream: S, who: String, token: Option<Token>)
where
    S: tokio::io::AsyncRead + tokio::io::AsyncWrite + Unpin + 'static,
{
    if let Some(counted) = Counted::new(state, |state| &state.clients, MAX_CLIENTS) {
        spawn_local(visit::serve(Rc::clone(state), counted, stream, who, token));
        return;
    }
    state.refused.set(state.refused.get() + 1);
    if let Some(counted) = Counted::new(state, |state| &state.parting, MAX_PARTING) {
        spawn_local(visit::turn_away(counted, stream));
    }
}
