//! What the pipeline says is wrong with the board, as findings.

use super::finding::{Finding, Level};
use slamd_core::{Counters, Topic};

/// The troubles of a session, by topic.
pub(super) struct Troubles<'a> {
    all: &'a [(Topic, String)],
}

impl<'a> Troubles<'a> {
    pub(super) const fn new(all: &'a [(Topic, String)]) -> Self {
        Self { all }
    }

    pub(super) fn has(&self, topic: Topic) -> bool {
        self.all.iter().any(|(said, _)| *said == topic)
    }

    /// One finding each, except for a board that does not say who it is: that belongs to `line.board`.
    pub(super) fn findings(&self, counters: &Counters) -> impl Iterator<Item = Finding> {
        self.all.iter().filter(|(topic, _)| *topic != Topic::Identity).map(|(topic, text)| {
            let (text, fix) = parts(text);
            let text = match topic {
                Topic::Text => format!("{} times {text}", counters.stray_texts),
                _ => text.to_owned(),
            };
            let (level, id) = kind(*topic);
            Finding::new(level, id, text, fix)
        })
    }

    /// True if sensors and places belong together; otherwise no sensor and no wall tells anything.
    pub(super) fn is_ring_known(&self) -> bool {
        self.all.iter().all(|(topic, _)| *topic != Topic::SensorIds)
    }

    /// What is wrong with the board's identity, and what to do.
    pub(super) fn identity(&self) -> Option<(&'a str, &'a str)> {
        self.all.iter().find(|(topic, _)| *topic == Topic::Identity).map(|(_, text)| parts(text))
    }
}

/// Observation and remedy.
fn parts(text: &str) -> (&str, &str) {
    text.rsplit_once(": ").unwrap_or((text, "see the board's settings in configs/README.md"))
}

const fn kind(topic: Topic) -> (Level, &'static str) {
    match topic {
        Topic::Settings => (Level::Problem, "line.settings"),
        Topic::Identity => (Level::Problem, "line.board"),
        Topic::Content => (Level::Problem, "line.content"),
        Topic::Text => (Level::Warning, "line.text"),
        Topic::Clock => (Level::Problem, "clock.stamps"),
        Topic::Wheels => (Level::Warning, "wheels.counts"),
        Topic::Temperature => (Level::Warning, "sensors.temperature"),
        Topic::SensorIds => (Level::Problem, "sensors.ids"),
        Topic::Groups => (Level::Warning, "sensors.groups"),
        Topic::Crosstalk => (Level::Warning, "sensors.crosstalk"),
        Topic::FlightUnit => (Level::Problem, "sensors.unit"),
    }
}
