//! The state machine of one client: bytes and times go in, lines come out. It has no socket and no clock.

mod changes;

use super::http::is_http;
use super::pace::is_time;
use super::report::{DeviceState, Report};
use super::request::{MAX_LINE_BYTES, Request, RequestError, Watch, parse};
use super::right::{Orders, Right};
use super::send_queue::SendQueue;
use super::token::Token;
use crate::drive::{Granted, Order, Refusal};
use bytes::Bytes;
use slamd_core::{FaultEvent, ModelEvent, Snapshot, Timestamp};
use std::time::Duration;

/// Why a connection is closed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// The client does not read what it is sent.
    Slow,
    /// The client neither requests nor watches.
    Idle,
    /// The client sent a line that is too long.
    LineTooLong,
    /// The client did not send the token.
    Unauthorized,
    /// The client is a browser: a page may have been made to speak to this port.
    Http,
    /// There are too many clients.
    Refused,
    /// The client closed its side and has received every answer.
    Done,
}

/// What a client needs from the session for its open requests.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pending {
    /// A snapshot of the session.
    pub snapshot: bool,
    /// The map.
    pub map: bool,
}

/// One client's state.
#[derive(Debug)]
pub struct Client {
    /// The token that the client must still send.
    token: Option<Token>,
    right: Right,
    orders: Orders,
    failures: u32,
    connected_at: Timestamp,
    requested_at: Timestamp,
    /// The line received so far.
    line: Vec<u8>,
    watch: Option<Watch>,
    due: Due,
    requested: Requested,
    sent: Sent,
    /// The client will send no more.
    is_closing: bool,
    send_queue: SendQueue,
    end: Option<(End, Timestamp)>,
}

/// When the next report of each class is due.
#[derive(Clone, Copy, Debug, Default)]
struct Due {
    pose: Timestamp,
    sweep: Timestamp,
    map: Timestamp,
    stats: Timestamp,
}

/// Requests that wait for the session's answer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Requested {
    poll: bool,
    /// The client has just begun to watch.
    first: bool,
    stats: bool,
    map: bool,
}

/// What the client was sent last.
#[derive(Clone, Debug, Default)]
struct Sent {
    pose: Option<u64>,
    sweep: Option<u64>,
    device: Option<DeviceState>,
    changes: Vec<Option<FaultEvent>>,
    models: Vec<ModelEvent>,
}

/// A client that neither requests nor watches is dropped after this long.
const IDLE_TIMEOUT: Duration = Duration::from_secs(20);
/// The client must send the token within this time, in at most [`MAX_FAILURES`] attempts.
const TOKEN_TIMEOUT: Duration = Duration::from_secs(5);
const MAX_FAILURES: u32 = 3;
/// A dropped client has this long to read the last line.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(5);
const NO_DEADLINE: Duration = Duration::from_secs(3_600);

impl Client {
    /// A client that connected at `at` and must send `token`, if there is one.
    #[must_use]
    pub fn new(at: Timestamp, token: Option<Token>) -> Self {
        Self::with_right(at, token, Right::default())
    }

    /// The same with a right to drive, or a way to get it.
    #[must_use]
    pub fn with_right(at: Timestamp, token: Option<Token>, right: Right) -> Self {
        let mut client = Self {
            token,
            right,
            orders: Orders::default(),
            failures: 0,
            connected_at: at,
            requested_at: at,
            line: Vec::new(),
            watch: None,
            due: Due::default(),
            requested: Requested::default(),
            sent: Sent::default(),
            is_closing: false,
            send_queue: SendQueue::new(at),
            end: None,
        };
        if client.token.is_none() {
            client.send(at, &Report::version());
        }
        client
    }

    /// Takes bytes from the client.
    pub fn received(&mut self, at: Timestamp, bytes: &[u8]) {
        let mut rest = bytes;
        while self.end.is_none() && !rest.is_empty() {
            let end = rest.iter().position(|byte| *byte == b'\n');
            let (piece, next) = end.map_or((rest, &[][..]), |end| (&rest[..end], &rest[end + 1..]));
            if self.line.len() + piece.len() > MAX_LINE_BYTES {
                let message = format!("a line has more than {MAX_LINE_BYTES} bytes: a request is a short line");
                return self.drop_with(at, End::LineTooLong, &message);
            }
            self.line.extend_from_slice(piece);
            rest = next;
            if end.is_some() {
                let line = std::mem::take(&mut self.line);
                if self.is_known() && is_http(&line) {
                    return self.drop_with(at, End::Http, "this port speaks JSON lines, not HTTP");
                }
                self.request(at, parse(&line));
            }
        }
    }

    /// The client closed its sending side. Open requests are still answered.
    pub fn peer_closed(&mut self, at: Timestamp) {
        self.is_closing = true;
        (self.watch, self.requested_at) = (None, at);
        self.close_if_done(at);
    }

    /// Takes a new snapshot of the session; `clients` are connected.
    pub fn update(&mut self, at: Timestamp, snapshot: &Snapshot, clients: usize) {
        if self.end.is_some() {
            return;
        }
        let Requested { poll, stats, .. } = self.requested;
        self.requested = Requested { map: self.requested.map, ..Requested::default() };
        if poll {
            self.send(at, &Report::device(snapshot));
            snapshot.faulty().for_each(|change| self.send(at, &Report::fault(change)));
            snapshot.doubted_models().for_each(|event| self.send(at, &Report::model(event)));
            let newest = [Report::sweep(snapshot), Report::pose(snapshot), Some(Report::stats(snapshot, clients))];
            newest.iter().flatten().for_each(|report| self.send(at, report));
        }
        if let Some(watch) = self.watch {
            self.send_changes(at, snapshot);
            let newest = snapshot.estimate.map(|estimate| estimate.sweep);
            if newest != self.sent.pose && is_time(&mut self.due.pose, watch.pose_hz, at) {
                self.sent.pose = newest;
                Report::pose(snapshot).iter().for_each(|report| self.send(at, report));
            }
            if snapshot.sweep != self.sent.sweep && is_time(&mut self.due.sweep, watch.sweep_hz, at) {
                self.sent.sweep = snapshot.sweep;
                Report::sweep(snapshot).iter().for_each(|report| self.send(at, report));
            }
            if stats {
                self.send(at, &Report::stats(snapshot, clients));
            }
        }
        self.close_if_done(at);
    }

    /// Takes the newest map as a line; none while the map is empty.
    pub fn map(&mut self, at: Timestamp, line: Option<&Bytes>) {
        if !std::mem::take(&mut self.requested.map) || self.end.is_some() {
            return;
        }
        match line {
            Some(line) => self.push(at, line.clone()),
            None if self.watch.is_none() => self.send_error(at, "there is no map yet: it begins with the first sweeps"),
            None => {}
        }
        self.close_if_done(at);
    }

    /// Advances the time; due at [`Client::deadline`].
    pub fn tick(&mut self, at: Timestamp) {
        if self.end.is_some() {
            return;
        }
        if self.token.is_some() && at >= self.connected_at + TOKEN_TIMEOUT {
            return self.drop_with(at, End::Unauthorized, "no token within 5 s");
        }
        if self.send_queue.is_stalled(at) {
            return self.drop_with(at, End::Slow, "too slow: nothing was taken for 10 s");
        }
        match self.watch {
            Some(watch) => {
                self.requested.map |= is_time(&mut self.due.map, watch.map_hz, at);
                self.requested.stats |= is_time(&mut self.due.stats, watch.stats_hz, at);
            }
            None if at >= self.requested_at + IDLE_TIMEOUT => {
                self.drop_with(at, End::Idle, "idle for 20 s: ask something, or ?WATCH; and stay");
            }
            None => {}
        }
    }

    /// When [`Client::tick`] is due; after [`Client::end`], when the connection is closed at the latest.
    #[must_use]
    pub fn deadline(&self) -> Timestamp {
        if let Some((_, close_by)) = self.end {
            return close_by;
        }
        let token_deadline = self.token.map(|_| self.connected_at + TOKEN_TIMEOUT);
        let (map, stats) = match self.watch {
            Some(watch) => (
                Some(self.due.map).filter(|_| watch.map_hz > 0.0),
                Some(self.due.stats).filter(|_| watch.stats_hz > 0.0),
            ),
            None => (Some(self.requested_at + IDLE_TIMEOUT), None),
        };
        let each = [token_deadline, self.send_queue.deadline(), map, stats];
        each.into_iter().flatten().min().unwrap_or(self.requested_at + NO_DEADLINE)
    }

    /// What the open requests need from the session.
    #[must_use]
    pub fn pending(&self) -> Pending {
        let Requested { poll, first, stats, map } = self.requested;
        Pending { snapshot: poll || first || stats, map }
    }

    /// True while the client subscribes to each sweep.
    #[must_use]
    pub fn is_watching(&self) -> bool {
        self.watch.is_some() && self.end.is_none()
    }

    /// True once the client has sent the token, or if there is none.
    #[must_use]
    pub const fn is_known(&self) -> bool {
        self.token.is_none()
    }

    /// The next order for the helm and where it comes from; [`Client::answered`] takes the answer.
    pub fn take_order(&mut self) -> Option<(Order, u8)> {
        Some((self.orders.next()?, self.right.source?))
    }

    /// Takes the helm's answer to the last order.
    pub fn answered(&mut self, at: Timestamp, answer: &Result<Granted, Refusal>) {
        self.orders.answered();
        match answer {
            Ok(granted) => self.send(at, &Report::drive(granted)),
            Err(refusal) => self.send_error(at, &refusal.to_string()),
        }
        self.close_if_done(at);
    }

    /// There are too many clients.
    pub fn refuse(&mut self, at: Timestamp, message: &str) {
        self.drop_with(at, End::Refused, message);
    }

    /// The bytes to write next; empty if there are none.
    #[must_use]
    pub fn outgoing(&self) -> &[u8] {
        self.send_queue.first()
    }

    /// `count` of the outgoing bytes were written.
    pub fn wrote(&mut self, at: Timestamp, count: usize) {
        self.send_queue.wrote(at, count);
    }

    /// Why the connection is closed, if it is.
    #[must_use]
    pub fn end(&self) -> Option<End> {
        self.end.map(|(end, _)| end)
    }

    /// True once the connection can be closed.
    #[must_use]
    pub fn is_over(&self, at: Timestamp) -> bool {
        self.end.is_some_and(|(_, close_by)| at >= close_by || self.outgoing().is_empty())
    }

    fn request(&mut self, at: Timestamp, request: Result<Option<Request>, RequestError>) {
        let request = match request {
            Ok(Some(request)) => request,
            Ok(None) => return,
            Err(error) if self.token.is_none() => {
                self.requested_at = at;
                return self.send_error(at, &error.to_string());
            }
            // Before the token, errors in a line are not reported.
            Err(_) => Request::Token(String::new()),
        };
        self.requested_at = at;
        if let Some(token) = &self.token {
            let Request::Token(word) = &request else { return self.failed(at) };
            let (reads, drives) = (token.is(word), self.right.claim(word));
            if !(reads || drives) {
                return self.failed(at);
            }
            self.token = None;
            return self.send(at, &Report::version());
        }
        match request {
            // Where no token is needed to read, any other word is as good as none.
            Request::Token(word) if self.right.token.is_some() && !self.right.claim(&word) => self.failed(at),
            Request::Drive(_) | Request::Stop if self.right.source.is_none() => {
                self.send_error(at, self.right.refusal());
            }
            Request::Drive(wish) => self.orders.push(Order::Drive(wish.into())),
            Request::Stop => self.orders.push(Order::Stop),
            Request::Version | Request::Token(_) => self.send(at, &Report::version()),
            Request::Poll => self.requested.poll = true,
            Request::Map => self.requested.map = true,
            Request::Watch(watch) => {
                self.watch = Some(watch).filter(|watch| watch.enable);
                self.due = Due { pose: at, sweep: at, map: at, stats: at };
                (self.sent, self.requested.first) = (Sent::default(), watch.enable);
                self.send(at, &Report::Watch(watch));
            }
        }
    }

    /// A line that should have been the right token.
    fn failed(&mut self, at: Timestamp) {
        self.failures += 1;
        if self.failures < MAX_FAILURES {
            self.send_error(at, "begin with the right ?TOKEN=\"...\";");
        } else {
            self.drop_with(at, End::Unauthorized, "three times without the right token");
        }
    }

    /// Ends a client that sends no more and has received every answer.
    fn close_if_done(&mut self, at: Timestamp) {
        if self.is_closing && self.end.is_none() && self.requested == Requested::default() && self.orders.is_empty() {
            self.end = Some((End::Done, at + CLOSE_TIMEOUT));
        }
    }

    fn send_error(&mut self, at: Timestamp, message: &str) {
        self.send(at, &Report::Error { message });
    }

    fn send(&mut self, at: Timestamp, report: &Report<'_>) {
        self.push(at, report.line());
    }

    fn push(&mut self, at: Timestamp, line: Bytes) {
        if self.end.is_some() {
            return;
        }
        if self.send_queue.is_full() {
            return self.drop_with(at, End::Slow, "too slow: too much waits to be taken");
        }
        self.send_queue.push(at, line);
    }

    fn drop_with(&mut self, at: Timestamp, end: End, message: &str) {
        self.send_queue.clear();
        self.send_queue.push(at, Report::Error { message }.line());
        self.end = Some((end, at + CLOSE_TIMEOUT));
    }
}
