//! Runs on the pipeline's thread: copies the newest state for the clients and never waits for them.

use super::mailbox::{Mailbox, Slot};
use crate::source::session::{Session, copy_state};
use slamd_core::link::{Link, LinkCause, LinkState};
use std::sync::Arc;

/// Copies a session's state between its steps.
#[derive(Debug)]
pub struct Tap {
    mailbox: Arc<Mailbox>,
    robot: String,
    unix_zero_us: Option<u64>,
    /// The last copy's sweep.
    sweep: Option<u64>,
    link: LinkState,
    cause: LinkCause,
}

impl Tap {
    /// A tap of this robot's session that fills `mailbox`.
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

    /// The session has begun, `unix_zero_us` microseconds after 1970.
    pub fn begin(&mut self, unix_zero_us: Option<u64>) {
        self.unix_zero_us = unix_zero_us;
    }

    /// Copies the state if it has changed and a client needs it. Never waits.
    pub fn look(&mut self, link: &Link, session: Option<&Session>) {
        if !self.mailbox.is_wanted() {
            return;
        }
        let sweep = session.and_then(|session| Some(session.pipeline().sweep()?.index));
        let is_new = sweep != self.sweep || link.state() != self.link || *link.cause() != self.cause;
        if !is_new && !self.mailbox.is_requested() {
            return;
        }
        let Some((mut slot, wants_map)) = self.mailbox.open() else { return };
        let Slot { snapshot, map } = &mut *slot;
        (self.sweep, self.link) = (sweep, link.state());
        if self.cause != *link.cause() {
            self.cause.clone_from(link.cause());
        }
        copy(&mut snapshot.robot, &self.robot);
        snapshot.unix_zero_us = self.unix_zero_us;
        copy_state(snapshot, link, session);
        if wants_map {
            *map = Some(session.map(|session| (session.now(), session.pipeline().raster())).unwrap_or_default());
        }
        drop(slot);
        self.mailbox.notify();
    }
}

/// Copies into the existing buffer, without an allocation.
fn copy(target: &mut String, text: &str) {
    if target != text {
        text.clone_into(target);
    }
}
