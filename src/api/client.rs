//! One client: bytes and time go in, lines come out. No socket and no clock.

use super::outbox::Outbox;
use super::report::Report;
use super::request::{LONGEST_LINE, Request, RequestError, Watch, parse};
use super::token::Token;
use bytes::Bytes;
use slamd_core::{FaultEvent, SensorState, Snapshot, Timestamp, link::LinkState};
use std::time::Duration;

/// Why a client is dropped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// It does not take what it gets.
    Slow,
    /// It neither asks nor watches.
    Idle,
    /// It sent a line that does not end.
    Long,
    /// It does not know the token.
    Stranger,
    /// It has said that it will ask no more, and has got all it asked for.
    Done,
}

/// What a client waits for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Asks {
    /// The moment as it is.
    pub moment: bool,
    /// The map.
    pub map: bool,
}

/// A client's side of the conversation.
#[derive(Debug)]
pub struct Client {
    /// What it must know before anything else.
    token: Option<Token>,
    failures: u32,
    came: Timestamp,
    heard: Timestamp,
    /// The unfinished line.
    line: Vec<u8>,
    watch: Option<Watch>,
    due: Due,
    wants: Wants,
    told: Told,
    /// It will ask no more.
    is_leaving: bool,
    outbox: Outbox,
    end: Option<(End, Timestamp)>,
}

/// What a client is told of anew where it changes: the line's state and cause, the board's protocol, how many sensors there are.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Line {
    link: LinkState,
    cause: String,
    protocol: Option<(u8, u8)>,
    sensors: usize,
}

impl Line {
    fn is(&self, snapshot: &Snapshot) -> bool {
        (self.link, &self.cause, self.protocol, self.sensors)
            == (snapshot.link, &snapshot.cause, snapshot.protocol, snapshot.ring.len())
    }

    fn new(snapshot: &Snapshot) -> Self {
        let (cause, sensors) = (snapshot.cause.clone(), snapshot.ring.len());
        Self { link: snapshot.link, cause, protocol: snapshot.protocol, sensors }
    }
}

/// When the next of each is due.
#[derive(Clone, Copy, Debug, Default)]
struct Due {
    pose: Timestamp,
    sweep: Timestamp,
    map: Timestamp,
    stats: Timestamp,
}

/// What it is to get as soon as it is there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Wants {
    poll: bool,
    /// It has just begun to watch.
    first: bool,
    stats: bool,
    map: bool,
}

/// What it has been told last.
#[derive(Clone, Debug, Default)]
struct Told {
    pose: Option<u64>,
    sweep: Option<u64>,
    device: Option<Line>,
    changes: Vec<Option<FaultEvent>>,
}

/// One that neither asks nor watches is not waited for longer.
const IDLE: Duration = Duration::from_secs(20);
/// The token is to be said within this, and guessed no more often.
const INTRODUCTION: Duration = Duration::from_secs(5);
const MAX_FAILURES: u32 = 3;
/// A client that is dropped may still take what it is told.
const FAREWELL: Duration = Duration::from_secs(5);
const FOR_EVER: Duration = Duration::from_secs(3_600);

impl Client {
    /// A client that has come at `at`; `token` is what it must know.
    #[must_use]
    pub fn new(at: Timestamp, token: Option<Token>) -> Self {
        let mut client = Self {
            token,
            failures: 0,
            came: at,
            heard: at,
            line: Vec::new(),
            watch: None,
            due: Due::default(),
            wants: Wants::default(),
            told: Told::default(),
            is_leaving: false,
            outbox: Outbox::new(at),
            end: None,
        };
        if client.token.is_none() {
            client.say(at, &Report::version());
        }
        client
    }

    /// It has sent bytes.
    pub fn received(&mut self, at: Timestamp, bytes: &[u8]) {
        let mut rest = bytes;
        while self.end.is_none() && !rest.is_empty() {
            let end = rest.iter().position(|byte| *byte == b'\n');
            let (piece, next) = end.map_or((rest, &[][..]), |end| (&rest[..end], &rest[end + 1..]));
            if self.line.len() + piece.len() > LONGEST_LINE {
                let words = format!("a line has more than {LONGEST_LINE} bytes: a request is a short line");
                return self.drop_because(at, End::Long, &words);
            }
            self.line.extend_from_slice(piece);
            rest = next;
            if end.is_some() {
                let line = std::mem::take(&mut self.line);
                self.request(at, parse(&line));
            }
        }
    }

    /// It will send no more: what it has asked for it still gets.
    pub fn hung_up(&mut self, at: Timestamp) {
        self.is_leaving = true;
        (self.watch, self.heard) = (None, at);
        self.leave(at);
    }

    /// There is a new moment; so many clients are connected.
    pub fn news(&mut self, at: Timestamp, snapshot: &Snapshot, clients: usize) {
        if self.end.is_some() {
            return;
        }
        let Wants { poll, stats, .. } = self.wants;
        self.wants = Wants { map: self.wants.map, ..Wants::default() };
        if poll {
            self.say(at, &Report::device(snapshot));
            snapshot.faulty().for_each(|change| self.say(at, &Report::fault(change)));
            let newest = [Report::sweep(snapshot), Report::pose(snapshot), Some(Report::stats(snapshot, clients))];
            newest.iter().flatten().for_each(|report| self.say(at, report));
        }
        if let Some(watch) = self.watch {
            self.tell_changes(at, snapshot);
            let newest = snapshot.estimate.map(|estimate| estimate.sweep);
            if newest != self.told.pose && is_time(&mut self.due.pose, watch.pose_hz, at) {
                self.told.pose = newest;
                Report::pose(snapshot).iter().for_each(|report| self.say(at, report));
            }
            if snapshot.sweep != self.told.sweep && is_time(&mut self.due.sweep, watch.sweep_hz, at) {
                self.told.sweep = snapshot.sweep;
                Report::sweep(snapshot).iter().for_each(|report| self.say(at, report));
            }
            if stats {
                self.say(at, &Report::stats(snapshot, clients));
            }
        }
        self.leave(at);
    }

    /// Here is the newest map, as a line; none where nothing is known.
    pub fn map(&mut self, at: Timestamp, line: Option<&Bytes>) {
        if !std::mem::take(&mut self.wants.map) || self.end.is_some() {
            return;
        }
        match line {
            Some(line) => self.push(at, line.clone()),
            None if self.watch.is_none() => self.complain(at, "there is no map yet: it begins with the first sweeps"),
            None => {}
        }
        self.leave(at);
    }

    /// Time has passed; due at [`Client::deadline`].
    pub fn tick(&mut self, at: Timestamp) {
        if self.end.is_some() {
            return;
        }
        if self.token.is_some() && at >= self.came + INTRODUCTION {
            return self.drop_because(at, End::Stranger, "no token within 5 s");
        }
        if self.outbox.is_stuck(at) {
            return self.drop_because(at, End::Slow, "too slow: nothing was taken for 10 s");
        }
        match self.watch {
            Some(watch) => {
                self.wants.map |= is_time(&mut self.due.map, watch.map_hz, at);
                self.wants.stats |= is_time(&mut self.due.stats, watch.stats_hz, at);
            }
            None if at >= self.heard + IDLE => {
                self.drop_because(at, End::Idle, "idle for 20 s: ask something, or ?WATCH; and stay");
            }
            None => {}
        }
    }

    /// When [`Client::tick`] is due, or the farewell over.
    #[must_use]
    pub fn deadline(&self) -> Timestamp {
        if let Some((_, farewell)) = self.end {
            return farewell;
        }
        let introduction = self.token.map(|_| self.came + INTRODUCTION);
        let (map, stats) = match self.watch {
            Some(watch) => (
                Some(self.due.map).filter(|_| watch.map_hz > 0.0),
                Some(self.due.stats).filter(|_| watch.stats_hz > 0.0),
            ),
            None => (Some(self.heard + IDLE), None),
        };
        let each = [introduction, self.outbox.deadline(), map, stats];
        each.into_iter().flatten().min().unwrap_or(self.heard + FOR_EVER)
    }

    /// What it waits for.
    #[must_use]
    pub fn asks(&self) -> Asks {
        let Wants { poll, first, stats, map } = self.wants;
        Asks { moment: poll || first || stats, map }
    }

    /// True while it is to hear of each sweep.
    #[must_use]
    pub fn is_watching(&self) -> bool {
        self.watch.is_some() && self.end.is_none()
    }

    /// The bytes to be written next; empty where there are none.
    #[must_use]
    pub fn outgoing(&self) -> &[u8] {
        self.outbox.first()
    }

    /// So many of those have been written.
    pub fn wrote(&mut self, at: Timestamp, count: usize) {
        self.outbox.wrote(at, count);
    }

    /// Why it is dropped, if it is.
    #[must_use]
    pub fn end(&self) -> Option<End> {
        self.end.map(|(end, _)| end)
    }

    /// True where nothing more is to be done for it.
    #[must_use]
    pub fn is_over(&self, at: Timestamp) -> bool {
        self.end.is_some_and(|(_, farewell)| at >= farewell || self.outgoing().is_empty())
    }

    fn request(&mut self, at: Timestamp, request: Result<Option<Request>, RequestError>) {
        let request = match request {
            Ok(Some(request)) => request,
            Ok(None) => return,
            Err(error) if self.token.is_none() => {
                self.heard = at;
                return self.complain(at, &error.to_string());
            }
            // What a stranger says is not looked at.
            Err(_) => Request::Token(String::new()),
        };
        self.heard = at;
        if let Some(token) = &self.token {
            if matches!(&request, Request::Token(word) if token.is(word)) {
                self.token = None;
                return self.say(at, &Report::version());
            }
            self.failures += 1;
            return if self.failures < MAX_FAILURES {
                self.complain(at, "begin with the right ?TOKEN=\"...\";");
            } else {
                self.drop_because(at, End::Stranger, "three times without the right token");
            };
        }
        match request {
            Request::Version | Request::Token(_) => self.say(at, &Report::version()),
            Request::Poll => self.wants.poll = true,
            Request::Map => self.wants.map = true,
            Request::Watch(watch) => {
                self.watch = Some(watch).filter(|watch| watch.enable);
                self.due = Due { pose: at, sweep: at, map: at, stats: at };
                (self.told, self.wants.first) = (Told::default(), watch.enable);
                self.say(at, &Report::Watch(watch));
            }
        }
    }

    /// What has changed of the line and the sensors since it was told.
    fn tell_changes(&mut self, at: Timestamp, snapshot: &Snapshot) {
        if !self.told.device.as_ref().is_some_and(|line| line.is(snapshot)) {
            self.told.device = Some(Line::new(snapshot));
            self.say(at, &Report::device(snapshot));
        }
        if self.told.changes != snapshot.changes {
            let before = std::mem::replace(&mut self.told.changes, snapshot.changes.clone());
            for (sensor, change) in snapshot.changes.iter().enumerate() {
                let before = before.get(sensor).and_then(Option::as_ref);
                // Whoever begins to watch is told what is broken, not what was mended before.
                let is_worth = |change: &&FaultEvent| before.is_some() || change.state != SensorState::Healthy;
                if let Some(change) = change.as_ref().filter(|change| Some(*change) != before).filter(is_worth) {
                    self.say(at, &Report::fault(change));
                }
            }
        }
    }

    /// Where it will ask no more and has got everything, that is its end.
    fn leave(&mut self, at: Timestamp) {
        if self.is_leaving && self.end.is_none() && self.wants == Wants::default() {
            self.end = Some((End::Done, at + FAREWELL));
        }
    }

    fn complain(&mut self, at: Timestamp, message: &str) {
        self.say(at, &Report::Error { message });
    }

    fn say(&mut self, at: Timestamp, report: &Report<'_>) {
        self.push(at, report.line());
    }

    fn push(&mut self, at: Timestamp, line: Bytes) {
        if self.end.is_some() {
            return;
        }
        if self.outbox.is_full() {
            return self.drop_because(at, End::Slow, "too slow: too much waits to be taken");
        }
        self.outbox.push(at, line);
    }

    fn drop_because(&mut self, at: Timestamp, end: End, message: &str) {
        self.outbox.clear();
        self.outbox.push(at, Report::Error { message }.line());
        self.end = Some((end, at + FAREWELL));
    }
}

/// True where the next is due at this rate, which it then is no more. What comes a little early is taken: sweeps do not keep time exactly.
fn is_time(due: &mut Timestamp, hz: f64, at: Timestamp) -> bool {
    if hz <= 0.0 {
        return false;
    }
    let period = Duration::from_secs_f64(1.0 / hz);
    let is_time = at + period / 4 >= *due;
    if is_time {
        *due = (*due + period).max(at);
    }
    is_time
}
