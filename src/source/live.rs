//! A live session: everything that the daemon does between two wake-ups.
//!
//! A state machine around session and link. Bytes read and written, hang-ups, deadlines and their times go in; frames to write, chunks to
//! record and recovery actions for the port come out. The daemon runs it with a real port and a real clock; `tests/wire/simulation.rs` with
//! simulated ones.

use super::session::Session;
use crate::recorder::Chunk;
use bytes::{Buf as _, Bytes};
use slamd_core::{
    Timestamp, introduction,
    link::{Link, Remedy},
};
use std::collections::VecDeque;

/// A session on a serial link.
pub struct LiveSession<'a> {
    port: String,
    link: &'a mut Link,
    session: &'a mut Session,
    /// Frames to write; the first holds only its unwritten rest.
    outgoing: VecDeque<Bytes>,
    /// The newest command for the motors. It overtakes the frames that wait, and an older one that waits is not sent: late commands are wrong.
    command: Option<Bytes>,
}

/// Largest number of frames that wait for the port; further frames are discarded, because they would be late.
pub const MAX_OUTGOING: usize = 16;

impl<'a> LiveSession<'a> {
    /// A session on a link whose port was just opened for the first time.
    pub fn begin(port: String, now: Timestamp, link: &'a mut Link, session: &'a mut Session) -> Self {
        link.opened(now, &port, &session.reception());
        Self { port, link, session, outgoing: VecDeque::new(), command: None }
    }

    /// When [`LiveSession::tick`] is due, unless an input comes earlier.
    #[must_use]
    pub fn deadline(&self) -> Timestamp {
        self.link.deadline().into_iter().fold(self.session.next_deadline(), Ord::min)
    }

    /// Bytes to write next.
    #[must_use]
    pub fn outgoing(&self) -> Option<&[u8]> {
        self.outgoing.front().map(|frame| &frame[..])
    }

    /// Number of waiting frames.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.outgoing.len()
    }

    /// Takes bytes that were read; returns the chunk to record.
    pub fn read(&mut self, now: Timestamp, bytes: Bytes) -> Chunk {
        let at = self.session.run_until(now);
        self.session.received(at, &bytes);
        self.link.heard(at, &bytes, &self.session.reception());
        self.queue();
        Chunk::Received(at, bytes)
    }

    /// The first `count` of the outgoing bytes were written; returns the chunk to record.
    pub fn wrote(&mut self, now: Timestamp, count: usize) -> Chunk {
        let at = self.session.run_until(now);
        let written = self.outgoing.front_mut().map(|first| first.split_to(count.min(first.len()))).unwrap_or_default();
        self.outgoing.pop_front_if(|first| !first.has_remaining());
        // A frame ends with a zero, and has no other: half a one is never broken by another.
        if written.last() == Some(&slamd_protocol::DELIMITER)
            && let Some(command) = self.command.take()
        {
            self.outgoing.push_front(command);
        }
        self.session.sent(at, &written);
        self.queue();
        Chunk::Sent(at, written)
    }

    /// Handles the deadlines up to `now`.
    pub fn tick(&mut self, now: Timestamp) {
        let at = self.session.run_until(now);
        self.link.tick(at, &self.session.reception());
        self.queue();
    }

    /// A command for the motors.
    pub fn command(&mut self, frame: Bytes) {
        if self.outgoing.is_empty() {
            self.outgoing.push_back(frame);
        } else {
            self.command = Some(frame);
        }
    }

    /// The recovery action for the port that is due now.
    pub fn take_remedy(&mut self) -> Option<Remedy> {
        self.link.take_remedy()
    }

    /// Requests the board's description and ring again, so that each file of a recording can be replayed alone.
    pub fn introduce(&mut self) {
        self.extend(introduction());
    }

    /// The port is closed, because it is gone or must be reopened.
    pub fn closed(&mut self, now: Timestamp, cause: impl Into<String>) {
        let at = self.session.run_until(now);
        self.queue();
        self.outgoing.clear();
        self.command = None;
        self.link.closed(at, cause);
    }

    /// The port was opened again, perhaps under another name; returns the chunk to record.
    pub fn reopened(&mut self, port: String, now: Timestamp) -> Chunk {
        let at = self.session.run_until(now);
        self.session.take_transmit();
        self.session.opened(at);
        self.port = port;
        self.link.opened(at, &self.port, &self.session.reception());
        Chunk::Opened(at)
    }

    /// The port's name.
    #[must_use]
    pub fn port(&self) -> &str {
        &self.port
    }

    /// The link and the session.
    #[must_use]
    pub fn parts(&mut self) -> (&mut Link, &mut Session) {
        (&mut *self.link, &mut *self.session)
    }

    fn queue(&mut self) {
        let frames = self.session.take_transmit();
        self.extend(frames);
    }

    fn extend(&mut self, frames: impl IntoIterator<Item = Bytes>) {
        let room = MAX_OUTGOING.saturating_sub(self.outgoing.len());
        self.outgoing.extend(frames.into_iter().take(room));
    }
}
