//! Copies a session's state for the screen ten times a second.

use super::log::Clock;
use crate::monitor::{Dashboard, Line, Plan, RateMeter};
use crate::source::session::Session;
use slamd_core::{Config, Snapshot};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// The newest dashboard that has not been drawn; a newer one replaces it.
pub(super) type Slot = Arc<Mutex<Option<Dashboard>>>;

/// Fills dashboards at a limited rate.
pub(super) struct Sampler {
    slot: Slot,
    clock: Clock,
    last: Dashboard,
    meter: RateMeter,
    sampled: Option<Instant>,
    mapped: Option<Instant>,
}

/// Shortest time between two dashboards, unless the link's state changes.
const PERIOD: Duration = Duration::from_millis(100);
/// Time between two copies of the map, which may be large.
const MAP_PERIOD: Duration = Duration::from_secs(1);

impl Sampler {
    pub(super) fn new(config: &Config, slot: Slot, clock: Clock) -> Self {
        let session = Snapshot { robot: config.robot.name.clone(), ..Snapshot::default() };
        let last = Dashboard { session, max_range_m: config.ring.max_range_m, ..Dashboard::default() };
        Self { slot, clock, last, meter: RateMeter::default(), sampled: None, mapped: None }
    }

    /// Fills a dashboard when one is due.
    #[expect(clippy::disallowed_methods, reason = "the screen is updated in real time")]
    pub(super) fn sample(&mut self, session: Option<&Session>, line: impl Fn() -> Line) {
        let now = Instant::now();
        if let Some(session) = session {
            self.clock.set(session.now());
        }
        let line = line();
        let is_due = |last: Option<Instant>, every| last.is_none_or(|last| now.duration_since(last) >= every);
        if line.word == self.last.line.word && !is_due(self.sampled, PERIOD) {
            return;
        }
        self.sampled = Some(now);
        self.last.line = line;
        if let Some(session) = session {
            if is_due(self.mapped, MAP_PERIOD) {
                self.mapped = Some(now);
                self.last.plan = Arc::new(Plan::new(session.pipeline().raster()));
            }
            self.look(session);
        }
        *self.slot.lock().unwrap_or_else(PoisonError::into_inner) = Some(self.last.clone());
    }

    /// Fills the last dashboard, with the newest map.
    pub(super) fn sample_last(&mut self, session: &Session, line: Line) {
        (self.sampled, self.mapped) = (None, None);
        self.sample(Some(session), || line.clone());
    }

    fn look(&mut self, session: &Session) {
        session.copy_to(&mut self.last.session);
        self.last.waiting = session.pipeline().waiting();
        if let Some(estimate) = &self.last.session.estimate {
            self.last.track.push(estimate.pose.position());
        }
        self.last.rates = self.meter.rates(self.last.session.at, self.last.session.counters);
    }
}
