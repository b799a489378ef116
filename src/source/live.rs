//! A live line as a source: all that the daemon does between two wakes.
//!
//! A state machine around the session and the link: what was read and written, hang-ups, deadlines and their times go in; frames to be
//! written, chunks to be recorded and what to do to the port come out. The daemon is the loop around it on a real port and a real clock;
//! `tests/wire/simulation.rs` has one on a simulated port and a simulated clock.

use super::session::Session;
use crate::recorder::Chunk;
use bytes::{Buf as _, Bytes};
use slamd_core::{
    Timestamp, introduction,
    link::{Link, Remedy},
};
use std::collections::VecDeque;

/// A session on a line.
pub struct LiveSession<'a> {
    port: String,
    link: &'a mut Link,
    session: &'a mut Session,
    /// Frames to be written; of the first, what is left.
    outgoing: VecDeque<Bytes>,
}

/// Frames that wait for a port that takes none; what is older has become useless.
pub const MAX_OUTGOING: usize = 16;

impl<'a> LiveSession<'a> {
    /// A session on a line whose port has just been opened for the first time.
    pub fn begin(port: String, now: Timestamp, link: &'a mut Link, session: &'a mut Session) -> Self {
        link.opened(now, &port, &session.reception());
        Self { port, link, session, outgoing: VecDeque::new() }
    }

    /// When [`LiveSession::tick`] is due, unless something else comes earlier.
    #[must_use]
    pub fn deadline(&self) -> Timestamp {
        self.link.deadline().into_iter().fold(self.session.next_deadline(), Ord::min)
    }

    /// Bytes to be written next.
    #[must_use]
    pub fn outgoing(&self) -> Option<&[u8]> {
        self.outgoing.front().map(|frame| &frame[..])
    }

    /// Frames that wait to be written.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.outgoing.len()
    }

    /// Bytes have been read; what is to be recorded.
    pub fn read(&mut self, now: Timestamp, bytes: Bytes) -> Chunk {
        let at = self.session.run_until(now);
        self.session.received(at, &bytes);
        self.link.heard(at, &bytes, &self.session.reception());
        self.queue();
        Chunk::Received(at, bytes)
    }

    /// The first `count` of the outgoing bytes have been written; what is to be recorded.
    pub fn wrote(&mut self, now: Timestamp, count: usize) -> Chunk {
        let at = self.session.run_until(now);
        let written = self.outgoing.front_mut().map(|first| first.split_to(count.min(first.len()))).unwrap_or_default();
        self.outgoing.pop_front_if(|first| !first.has_remaining());
        self.session.sent(at, &written);
        self.queue();
        Chunk::Sent(at, written)
    }

    /// The deadline has come.
    pub fn tick(&mut self, now: Timestamp) {
        let at = self.session.run_until(now);
        self.link.tick(at, &self.session.reception());
        self.queue();
    }

    /// What to do to the port now.
    pub fn take_remedy(&mut self) -> Option<Remedy> {
        self.link.take_remedy()
    }

    /// Each capture of a recording can be replayed by itself: who the board is, and its ring, are heard in each.
    pub fn introduce(&mut self) {
        self.extend(introduction());
    }

    /// The port is closed: it is gone, or shall be opened anew.
    pub fn closed(&mut self, now: Timestamp, cause: impl Into<String>) {
        let at = self.session.run_until(now);
        self.queue();
        self.outgoing.clear();
        self.link.closed(at, cause);
    }

    /// The port has been opened again, perhaps under another name; what is to be recorded.
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

    /// How the line fares, and the session.
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
