//! The session's state in one line, for `systemctl status`.

use slamd_core::{Snapshot, link::LinkState};
use std::fmt::Write as _;

/// Appends the line: `streaming, 32 sensors, 3 faulty`, or the link's state and cause.
pub(super) fn write_status(text: &mut String, snapshot: &Snapshot) {
    text.push_str(snapshot.link.word());
    if snapshot.link != LinkState::Streaming && !snapshot.cause.is_empty() {
        text.push_str(": ");
        // It may hold text from the board, and a message ends at a line feed.
        text.extend(snapshot.cause.chars().filter(|c| !c.is_control()));
    }
    if !snapshot.ring.mountings.is_empty() {
        // Writing to a string cannot fail.
        let _ = write!(text, ", {} sensors, {} faulty", snapshot.ring.len(), snapshot.faulty().count());
    }
    if snapshot.is_lost {
        text.push_str(", position uncertain");
    }
}
