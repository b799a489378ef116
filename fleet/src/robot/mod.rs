//! The robot's side: an agent beside a running slamd. It plays the growing capture that slamd records,
//! and publishes the results.

pub mod shelf;

use crate::clock::{Moment, wait};
use crate::failure::{Failure, Kind};
use crate::follow::{Follow, Grip};
use crate::name::{Name, Topic, key};
use crate::network::{Endpoint, connect};
use crate::player::{PlayError, Player, Report};
use crate::session::SessionId;
use crate::wire::{Grid, MAX_SESSIONS, Status, VERSION, to_json};
use shelf::{Book, Extent, Shelf};
use slamd_core::Timestamp;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use zenoh::bytes::Encoding;
use zenoh::query::Query;
use zenoh::{Session, Wait as _};

/// The robot's options.
#[derive(Clone, Debug)]
pub struct Robot {
    /// The site.
    pub site: Name,
    /// Its name.
    pub name: Name,
    /// Its captures; the last one is being recorded.
    pub captures: Vec<PathBuf>,
    /// Play the last capture at this multiple of real time, instead of following it while it grows.
    pub speed: Option<f64>,
}

/// State shared by the threads.
#[derive(Debug, Default)]
struct Shared {
    shelf: Shelf,
    map: Mutex<Option<Vec<u8>>>,
    map_seq: AtomicU64,
}

const STATUS_EVERY: Duration = Duration::from_secs(1);
/// Period of making the map, session time.
const MAP_EVERY: Duration = Duration::from_secs(2);
const LOOK: Duration = Duration::from_millis(500);

impl Robot {
    /// Connects and runs until killed.
    ///
    /// # Errors
    /// When a capture or the password cannot be used.
    pub fn run(&self, hub: &Endpoint, password: Option<&Path>) -> Result<(), Failure> {
        let shared = Arc::new(Shared::default());
        let Some((last, older)) = self.captures.split_last() else {
            return Err(Failure::new(Kind::Usage, "name the capture that slamd records with --capture"));
        };
        if self.captures.len() > MAX_SESSIONS {
            return Err(Failure::new(Kind::Usage, format!("{MAX_SESSIONS} captures at most can be offered")));
        }
        for path in older {
            match Book::finished(path)? {
                Some(book) => shared.shelf.put(book),
                None => tracing::warn!("{} holds no record and is left out", path.display()),
            }
        }
        tracing::info!("{}: connecting to the hub", self.name);
        let session = connect(hub, &self.name, password)?;
        tracing::info!("{}: connected", self.name);
        let refused = |error: zenoh::Error| Failure::new(Kind::Unavailable, error.to_string());
        let _alive = session.liveliness().declare_token(self.key(Topic::Alive)).wait().map_err(refused)?;
        self.answer(&session, &shared).map_err(refused)?;
        self.tell(&session, &shared);
        self.play(&session, &shared, last)?;
        loop {
            // Other threads still answer queries.
            wait(STATUS_EVERY);
        }
    }

    fn key(&self, topic: Topic) -> String {
        key(&self.site, &self.name, topic)
    }

    /// Answers queries for the map and for captures, with one thread each.
    fn answer(&self, session: &Session, shared: &Arc<Shared>) -> zenoh::Result<()> {
        let [map, capture] = [Topic::Map, Topic::Capture].map(|topic| self.key(topic));
        let (maps, captures) = (session.declare_queryable(&map).wait()?, session.declare_queryable(&capture).wait()?);
        let (first, second) = (Arc::clone(shared), Arc::clone(shared));
        std::thread::spawn(move || {
            while let Ok(query) = maps.recv() {
                let encoded = first.map.lock().unwrap_or_else(PoisonError::into_inner).clone();
                reply(&query, &map, encoded.ok_or_else(|| "there is no map yet".into()));
            }
        });
        std::thread::spawn(move || {
            while let Ok(query) = captures.recv() {
                reply(&query, &capture, piece(&second.shelf, &query));
            }
        });
        Ok(())
    }

    /// Publishes the status once per second, on a thread of its own.
    fn tell(&self, session: &Session, shared: &Arc<Shared>) {
        let (key, session, shared) = (self.key(Topic::Status), session.clone(), Arc::clone(shared));
        std::thread::spawn(move || {
            loop {
                let status = Status {
                    version: VERSION,
                    captures: shared.shelf.offers(),
                    map_seq: shared.map_seq.load(Ordering::Acquire),
                };
                put(&session, &key, to_json(&status));
                wait(STATUS_EVERY);
            }
        });
    }

    /// Plays a capture to its end.
    fn play(&self, session: &Session, shared: &Shared, path: &Path) -> Result<(), Failure> {
        let grip = Grip::default();
        if self.speed.is_some() {
            grip.end();
        }
        let mut player = self.begin(path, &grip)?;
        let extent = if self.speed.is_some() { Extent::Played(grip) } else { Extent::Growing };
        let drive = player.session();
        shared.shelf.put(Book { session: drive, path: path.into(), extent });
        tracing::info!("{}: session {drive}", self.name);
        let [pose, sweep] = [Topic::Pose, Topic::Sweep].map(|topic| self.key(topic));
        let publish = |report: Report| match report {
            Report::Pose(report) => put(session, &pose, to_json(&report)),
            Report::Sweep(report) => put(session, &sweep, to_json(&report)),
        };
        let (begin, mut map_due) = (Moment::now(), Timestamp::default());
        while player.step(publish).map_err(|error| unreadable(path, error))? {
            if player.now() >= map_due {
                map_due = player.now() + MAP_EVERY;
                shared.set_map(player.grid());
            }
            if let Some(speed) = self.speed {
                let due = Duration::from_secs_f64(player.now().seconds() / speed);
                wait(due.saturating_sub(begin.elapsed()));
            }
        }
        if let Some(damage) = player.damage() {
            tracing::warn!("{}: {damage}", path.display());
        }
        shared.set_map(player.grid());
        // After damage slamd may still be writing, so the capture is not declared complete.
        if self.speed.is_some() || player.damage().is_none() {
            shared.shelf.put(Book { session: drive, path: path.into(), extent: Extent::Whole });
        }
        let seconds = player.now().seconds();
        tracing::info!(
            "{}: session {drive} has ended after {seconds:.0} s; it is offered until this program ends",
            self.name
        );
        Ok(())
    }

    /// Waits for the capture's first record.
    fn begin(&self, path: &Path, grip: &Grip) -> Result<Player<impl std::io::Read + use<>>, Failure> {
        if self.speed.is_none() && !path.exists() {
            tracing::info!("{}: waiting for {}", self.name, path.display());
        }
        while self.speed.is_none() && !path.exists() {
            wait(LOOK);
        }
        let file = Follow::open(path, grip.clone()).map_err(|error| {
            Failure::new(Kind::NoInput, format!("{}: {error}; name the capture that slamd records", path.display()))
        })?;
        Player::begin(file, path).map_err(|error| unreadable(path, error))
    }
}

impl Shared {
    fn set_map(&self, grid: Option<Grid>) {
        let Some(grid) = grid else { return };
        *self.map.lock().unwrap_or_else(PoisonError::into_inner) = Some(grid.encode());
        self.map_seq.store(grid.seq, Ordering::Release);
    }
}

fn unreadable(path: &Path, error: PlayError) -> Failure {
    match error {
        PlayError::Capture(error) => error.into(),
        other => Failure::new(Kind::Data, format!("{}: {other}", path.display())),
    }
}

/// Publishes a message. A message that the network loses can be recovered from the capture.
fn put(session: &Session, key: &str, payload: Vec<u8>) {
    if let Err(error) = session.put(key, payload).encoding(Encoding::APPLICATION_JSON).wait() {
        tracing::debug!("{key}: {error}");
    }
}

fn reply(query: &Query, key: &str, answer: Result<Vec<u8>, String>) {
    let sent = match answer {
        Ok(bytes) => query.reply(key, bytes).encoding(Encoding::APPLICATION_OCTET_STREAM).wait(),
        Err(words) => query.reply_err(words).wait(),
    };
    if let Err(error) = sent {
        tracing::debug!("{key}: {error}");
    }
}

fn piece(shelf: &Shelf, query: &Query) -> Result<Vec<u8>, String> {
    let parameters = query.parameters();
    let asked = |name: &str| parameters.get(name).ok_or_else(|| format!("the question needs {name}=..."));
    let session: SessionId = asked("session")?.parse()?;
    let from = asked("from")?.parse().map_err(|_| "from= must be a number of bytes".to_owned())?;
    shelf.piece(session, from).map(|piece| piece.encode()).map_err(|error| error.to_string())
}
