//! Fetches what a robot offers, with one thread per robot and one query at a time.

use super::Update;
use super::copy::{Copy, CopyError, Files};
use super::replica::Replica;
use crate::name::{Name, Topic, key};
use crate::session::SessionId;
use crate::wire::{Grid, Offer, Piece};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;
use zenoh::{Session, Wait as _};

/// A request to fetch from a robot.
#[derive(Clone, Debug)]
pub struct Request {
    /// The captures that the robot offers.
    pub captures: Vec<Offer>,
    /// True if the robot's map is far ahead of the fetched capture.
    pub map: bool,
}

/// Fetches from one robot.
struct Fetcher {
    robot: Name,
    folder: PathBuf,
    session: Session,
    keys: [String; 2],
    open: BTreeMap<SessionId, (Copy, Replica)>,
    updates: Sender<Update>,
}

/// Timeout of a query. The robot's next status message triggers it again.
const PATIENCE: Duration = Duration::from_secs(5);
const MAX_WORDS: usize = 200;

/// Starts a thread that fetches from a robot into its folder. Only the newest request counts.
pub fn begin(
    site: &Name,
    robot: &Name,
    folder: PathBuf,
    session: &Session,
    updates: &Sender<Update>,
) -> Sender<Request> {
    let (requests, wanted) = channel();
    let mut fetcher = Fetcher {
        robot: robot.clone(),
        folder,
        session: session.clone(),
        keys: [Topic::Capture, Topic::Map].map(|topic| key(site, robot, topic)),
        open: BTreeMap::new(),
        updates: updates.clone(),
    };
    std::thread::spawn(move || {
        while let Some(request) = newest(&wanted) {
            if let Err(words) = fetcher.fetch(&request) {
                fetcher.tell(Update::Trouble(fetcher.robot.clone(), words));
            }
        }
    });
    requests
}

/// Waits for a request and skips outdated ones.
fn newest(wanted: &Receiver<Request>) -> Option<Request> {
    let first = wanted.recv().ok()?;
    Some(wanted.try_iter().last().unwrap_or(first))
}

impl Fetcher {
    fn fetch(&mut self, request: &Request) -> Result<(), String> {
        if request.map
            && let Some(bytes) = self.ask(&self.keys[1])?
        {
            let grid = Grid::decode(&bytes).map_err(|error| format!("its map {error}"))?;
            self.tell(Update::Map(self.robot.clone(), grid));
        }
        // The current drive first.
        for offer in request.captures.iter().rev() {
            let files = Files::new(&self.folder, offer.session);
            if !files.capture().exists() {
                self.capture(offer, &files).map_err(|error| error.to_string())?;
            }
        }
        Ok(())
    }

    /// Fetches the offered part of a capture.
    fn capture(&mut self, offer: &Offer, files: &Files) -> Result<(), CopyError> {
        let session = offer.session;
        let (mut copy, mut replica) = match self.open.remove(&session) {
            Some(open) => open,
            None => {
                let copy = Copy::open(files.clone())?;
                (copy, Replica::begin(&self.robot, files, &self.updates))
            }
        };
        let mut has_begun_again = false;
        while copy.bytes() < offer.bytes || offer.is_whole {
            let question = format!("{}?session={session};from={}", self.keys[0], copy.bytes());
            let Some(piece) = self.piece(&question, session) else { break };
            match copy.take(&piece) {
                Ok(()) if piece.is_last => {
                    let finished = copy.finish();
                    match finished {
                        Ok(()) => replica.end(),
                        Err(_) => drop(self.open.insert(session, (copy, replica))),
                    }
                    return finished;
                }
                Ok(()) if piece.bytes.is_empty() => break,
                Ok(()) => self.tell(Update::Fetched(self.robot.clone(), session, copy.bytes())),
                Err(CopyError::Digest) if !has_begun_again => {
                    tracing::warn!("{}: session {session}: {}; it is fetched anew", self.robot, CopyError::Digest);
                    has_begun_again = true;
                    replica.abandon();
                    copy = copy.begin_again()?;
                    replica = Replica::begin(&self.robot, files, &self.updates);
                }
                Err(error) => {
                    self.open.insert(session, (copy, replica));
                    return Err(error);
                }
            }
        }
        self.open.insert(session, (copy, replica));
        Ok(())
    }

    /// Queries a piece; `None` if it is not available now.
    fn piece(&self, question: &str, session: SessionId) -> Option<Piece> {
        let answer = self.ask(question).and_then(|bytes| match bytes {
            Some(bytes) => Piece::decode(&bytes).map(Some).map_err(|error| format!("a piece of a capture {error}")),
            None => Ok(None),
        });
        match answer {
            Ok(piece) => piece.filter(|piece| piece.session == session),
            Err(words) => {
                tracing::debug!("{}: {words}", self.robot);
                None
            }
        }
    }

    /// The answer to a query; `None` without an answer in time.
    fn ask(&self, question: &str) -> Result<Option<Vec<u8>>, String> {
        let answers = self.session.get(question).timeout(PATIENCE).wait().map_err(|error| error.to_string())?;
        let Ok(answer) = answers.recv() else { return Ok(None) };
        match answer.into_result() {
            Ok(sample) => Ok(Some(sample.payload().to_bytes().into_owned())),
            Err(refusal) => {
                // Untrusted text: cut it, and remove control characters.
                let words = String::from_utf8_lossy(&refusal.payload().to_bytes()).into_owned();
                Err(words.chars().filter(|character| !character.is_control()).take(MAX_WORDS).collect())
            }
        }
    }

    fn tell(&self, update: Update) {
        // Sending fails only when the hub is ending.
        let _ = self.updates.send(update);
    }
}
