//! The pipeline's thread: copies what is newest where somebody wants it, and goes on.

use super::mailbox::{Mailbox, Slot};
use super::snapshot::Snapshot;
use crate::source::session::Session;
use slamd_core::link::{Link, LinkCause, LinkState};
use slamd_core::pipeline::Pipeline;
use std::fmt::Write as _;
use std::sync::Arc;

/// Looks at a session between its steps.
#[derive(Debug)]
pub struct Tap {
    mailbox: Arc<Mailbox>,
    robot: String,
    unix_zero_us: Option<u64>,
    /// X
    sweep: Option<u64>,
    link: LinkState,
    cause: LinkCause,
}

impl Tap {
    /// What looks at the session of this robot, for whoever has the other end of the mailbox.
    #[must_use]
    pub fn new(mailbox: Arc<Mailbox>, robot: String) -> Self {
        Self {
            mailbox,
            robot,
            unix_zero_us: None,
            sweep: None,
            link: LinkState::Searching,
            cause: LinkCause::NotOpened,
        }
    }

    /// The session has begun, so many microseconds after 1970.
    pub fn begin(&mut self, unix_zero_us: Option<u64>) {
        self.unix_zero_us = unix_zero_us;
    }

    /// Leaves the moment for the server, where there is something new and somebody wants it. Never waits.
    pub fn look(&mut self, link: &Link, session: Option<&Session>) {
        if !self.mailbox.is_wanted() {
            return;
        }
        let sweep = session.and_then(|session| Some(session.pipeline().sweep()?.index));
        let is_new = sweep != self.sweep || link.state() != self.link || *link.cause() != self.cause;
        if !is_new && !self.mailbox.is_asked() {
            return;
        }
        let Some((mut slot, wants_map)) = self.mailbox.open() else { return };
        let Slot { snapshot, map } = &mut *slot;
        (self.sweep, self.link) = (sweep, link.state());
        if self.cause != *link.cause() {
            self.cause.clone_from(link.cause());
        }
        copy(&mut snapshot.robot, &self.robot);
        snapshot.cause.clear();
        // Nothing can go wrong where a string is written to.
        let _ = write!(snapshot.cause, "{}", self.cause);
        (snapshot.link, snapshot.unix_zero_us) = (link.state(), self.unix_zero_us);
        if let Some(session) = session {
            look_at(session, snapshot);
        }
        if wants_map {
            *map = Some(session.map(|session| (session.now(), session.pipeline().raster())).unwrap_or_default());
        }
        drop(slot);
        self.mailbox.tell();
    }
}

fn look_at(session: &Session, snapshot: &mut Snapshot) {
    let pipeline = session.pipeline();
    snapshot.at = session.now();
    snapshot.counters = pipeline.counters();
    snapshot.estimate = session.estimate().copied();
    snapshot.is_lost = session.is_lost();
    if snapshot.changes != session.changes() {
        snapshot.changes = session.changes().to_vec();
    }
    look_at_board(pipeline, snapshot);
    let Some(sweep) = pipeline.sweep() else { return };
    (snapshot.sweep, snapshot.sweep_at) = (Some(sweep.index), sweep.at);
    snapshot.ranges_m.clear();
    snapshot.ranges_m.extend(sweep.beams.iter().map(|beam| beam.range_m));
    snapshot.verdicts.clear();
    snapshot.verdicts.extend((0..sweep.beams.len()).map(|sensor| pipeline.verdict(sensor)));
}

fn look_at_board(pipeline: &Pipeline, snapshot: &mut Snapshot) {
    if let Some(ring) = pipeline.ring().filter(|ring| **ring != snapshot.ring) {
        snapshot.ring = ring.clone();
    }
    if let Some(hello) = pipeline.board().hello() {
        let [board, firmware] = &mut snapshot.board;
        copy(board, &hello.board);
        copy(firmware, &hello.firmware);
        snapshot.protocol = Some((hello.major, hello.minor));
    }
}

/// Into what is there already.
fn copy(target: &mut String, text: &str) {
    if target != text {
        text.clone_into(target);
    }
}
