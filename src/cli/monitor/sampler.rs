//! Looks at a session ten times a second and leaves what it sees for the screen.

use crate::monitor::{Beam, BeamState, Line, Plan, RateMeter, Snapshot};
use crate::source::session::Session;
use slamd_core::config::Config;
use slamd_core::event::SensorState;
use slamd_core::pipeline::Pipeline;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// The newest snapshot that has not been drawn; a newer one takes its place.
pub(super) type Slot = Arc<Mutex<Option<Snapshot>>>;

/// Takes snapshots, not too often.
pub(super) struct Sampler {
    slot: Slot,
    last: Snapshot,
    meter: RateMeter,
    sampled: Option<Instant>,
    mapped: Option<Instant>,
}

/// Between two snapshots, unless the line's state changes.
const EVERY: Duration = Duration::from_millis(100);
/// Between two copies of the map, which may be large.
const MAP_EVERY: Duration = Duration::from_secs(1);

impl Sampler {
    pub(super) fn new(config: &Config, slot: Slot) -> Self {
        let (robot, max_range_m) = (config.robot.name.clone(), config.ring.max_range_m);
        let last = Snapshot { robot, max_range_m, ..Snapshot::default() };
        Self { slot, last, meter: RateMeter::default(), sampled: None, mapped: None }
    }

    /// Takes a snapshot where it is time for one.
    #[expect(clippy::disallowed_methods, reason = "the screen is for people, who live in real time")]
    pub(super) fn sample(&mut self, session: Option<&Session>, line: impl Fn() -> Line) {
        let now = Instant::now();
        let line = line();
        let is_due = |last: Option<Instant>, every| last.is_none_or(|last| now.duration_since(last) >= every);
        if line.word == self.last.line.word && !is_due(self.sampled, EVERY) {
            return;
        }
        self.sampled = Some(now);
        self.last.line = line;
        if let Some(session) = session {
            if is_due(self.mapped, MAP_EVERY) {
                self.mapped = Some(now);
                self.last.plan = Arc::new(Plan::new(session.pipeline().raster()));
            }
            self.look(session);
        }
        *self.slot.lock().unwrap_or_else(PoisonError::into_inner) = Some(self.last.clone());
    }

    /// Takes one with the newest map: nothing will come after it.
    pub(super) fn sample_last(&mut self, session: &Session, line: Line) {
        (self.sampled, self.mapped) = (None, None);
        self.sample(Some(session), || line.clone());
    }

    fn look(&mut self, session: &Session) {
        let pipeline = session.pipeline();
        let last = &mut self.last;
        last.at = session.now();
        last.counters = pipeline.counters();
        last.rates = self.meter.rates(last.at, last.counters);
        last.beams.clear();
        last.beams.extend(beams(pipeline));
        last.faults.clear();
        last.faults.extend(session.faulty().cloned());
        last.encoders = session.encoders();
        last.estimate = session.estimate().copied();
        last.calibration = pipeline.calibration();
    }
}

/// The last sweep on the ring as it is mounted.
fn beams(pipeline: &Pipeline) -> impl Iterator<Item = Beam> {
    let mountings = pipeline.ring().into_iter().flat_map(|ring| &ring.mountings);
    mountings.enumerate().map(|(sensor, mounting)| {
        let range_m = pipeline.sweep().and_then(|sweep| sweep.beams.get(sensor)).map_or(f64::NAN, |beam| beam.range_m);
        let state = match pipeline.states().get(sensor) {
            Some(SensorState::Faulty(_)) => BeamState::Faulty,
            _ if range_m.is_nan() => BeamState::Silent,
            _ => BeamState::Healthy,
        };
        Beam { robot_from_sensor: mounting.robot_from_sensor, range_m, state }
    })
}
