//! Doubt in the poses because of the robot, and the events that tell it.

use crate::event::{Event, LocalizationChange, LocalizationEvent};
use crate::time::Timestamp;

/// Whether the poses are in doubt because of the robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Doubt {
    None,
    /// Until the check has an answer. Since then.
    Open(Timestamp),
    /// To the end: no correction is possible, or two robots explain the walls alike.
    Lasting,
}

/// Reason of a doubt that the check has not confirmed yet.
pub(super) const SUSPECTED: &str = "the walls fit another robot better than the configured one; this is being checked";

pub(super) fn doubted(at: Timestamp, since: Timestamp, reason: &str) -> Event {
    let change = LocalizationChange::Doubted { reason: reason.into() };
    Event::Localization(LocalizationEvent { at, since, change })
}

pub(super) fn lost(event: &Event) -> Option<bool> {
    if let Event::Localization(event) = event { Some(event.is_lost()) } else { None }
}
