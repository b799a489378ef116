//! How it fares, in a line for `systemctl status`.

use crate::source::session::Session;
use slamd_core::link::{Link, LinkCause, LinkState};
use std::fmt::Write as _;

/// Appends the line: `streaming, 32 sensors, 3 faulty`, or the line's state and why.
pub(super) fn write_status(text: &mut String, link: &Link, session: Option<&Session>) {
    text.push_str(link.state().word());
    if link.state() != LinkState::Streaming && *link.cause() != LinkCause::NotOpened {
        text.push_str(": ");
        // What a board says of itself may be in it; a message has lines.
        text.extend(link.cause().to_string().chars().filter(|c| !c.is_control()));
    }
    let Some(session) = session else { return };
    let faulty = session.faulty().count();
    if let Some(ring) = session.pipeline().ring() {
        // Nothing can go wrong where a string is written to.
        let _ = write!(text, ", {} sensors, {faulty} faulty", ring.len());
    }
    if session.is_lost() {
        text.push_str(", position uncertain");
    }
}
