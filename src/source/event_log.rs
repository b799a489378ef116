//! The log of a session: one line for each event that matters to a person.

use slamd_core::{Event, LocalizationChange, LocalizationEvent, ModelState};

/// Writes the log lines of one session.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct EventLog {
    has_pose: bool,
}

impl EventLog {
    /// Writes the event's line, if it has one; `now_s` is session time.
    pub(super) fn note(&mut self, event: &Event, now_s: f64) {
        match event {
            Event::Board { description, compatible: true, .. } => tracing::info!("board: {description}"),
            Event::Board { description, .. } => tracing::error!("board: {description}"),
            Event::Ring { sensors, .. } => tracing::info!("ring of {sensors} sensors"),
            Event::BoardReset { .. } => tracing::warn!("board restarted; map and pose are kept"),
            Event::BoardTrouble { text, .. } => tracing::error!("board: {text}"),
            Event::Motion { state, .. } => tracing::info!("motors: {}", state.word()),
            Event::BoardLog { text, .. } => tracing::info!("board says: {text}"),
            Event::Localization(event) => note_localization(event),
            Event::Model(event) if event.state == ModelState::Resolved => {
                tracing::info!("{:.1} s: {}", event.at.seconds(), event.sentence());
            }
            Event::Model(event) => tracing::warn!("{:.1} s: {}", event.at.seconds(), event.sentence()),
            Event::Fault(fault) => tracing::warn!("{:.1} s: {}", fault.at.seconds(), fault.reason),
            Event::Encoder(encoder) => tracing::warn!("{:.1} s: {}", encoder.at.seconds(), encoder.reason),
            Event::Revised { .. } => {}
            Event::Estimate(_) => {
                if !std::mem::replace(&mut self.has_pose, true) {
                    tracing::info!("poses and map begin after {now_s:.0} s");
                }
            }
        }
    }
}

fn note_localization(event: &LocalizationEvent) {
    let since_s = event.since.seconds();
    match &event.change {
        LocalizationChange::Lost => {
            tracing::warn!("position lost: the echoes contradict the map; poses are uncertain since {since_s:.1} s");
        }
        LocalizationChange::Regained { moved_m, turned_rad } => tracing::info!(
            "position found again, {moved_m:.2} m and {:.0} degrees off; poses since {since_s:.1} s were uncertain",
            turned_rad.to_degrees()
        ),
        LocalizationChange::Doubted { reason } => {
            tracing::warn!("poses are uncertain since {since_s:.1} s: {reason}");
        }
        LocalizationChange::Trusted => tracing::info!("poses are certain again; those since {since_s:.1} s were not"),
        LocalizationChange::KnownMap(search) if event.is_lost() => tracing::warn!("{}", search.reason),
        LocalizationChange::KnownMap(search) => tracing::info!("{}", search.reason),
    }
}
