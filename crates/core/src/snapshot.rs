//! The state of a session, for everything that shows it: the API, MQTT, the terminal monitor, the service manager.
//!
//! [`SessionState`] follows the events; [`Snapshot`] is a copy of it, of the pipeline's newest sweep and of the link's health, that another
//! thread can keep. Each consumer only formats it.

#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing, clippy::string_slice)]
#![deny(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)]
#![deny(clippy::allow_attributes, clippy::allow_attributes_without_reason)]

use crate::event::{Calibration, Counters, EncoderState, Estimate, Event, FaultEvent, SensorState, Verdict, Wheel};
use crate::geometry::Ring;
use crate::link::{Link, LinkState};
use crate::pipeline::Pipeline;
use crate::robot_model::{ModelEvent, ModelState};
use crate::time::Timestamp;
use std::fmt::Write as _;

/// What the events so far add up to.
#[derive(Clone, Debug, Default)]
pub struct SessionState {
    changes: Vec<Option<FaultEvent>>,
    is_lost: bool,
    encoders: [EncoderState; 2],
    models: Vec<ModelEvent>,
    estimate: Option<Estimate>,
}

impl SessionState {
    /// Takes the next event.
    pub fn take(&mut self, event: &Event) {
        match event {
            Event::Estimate(estimate) => self.estimate = Some(*estimate),
            Event::Localization(event) => self.is_lost = event.is_lost(),
            Event::Model(event) => {
                match self.models.iter_mut().find(|known| known.finding.aspect == event.finding.aspect) {
                    Some(known) => known.clone_from(event),
                    None => self.models.push(event.clone()),
                }
            }
            Event::Encoder(encoder) => {
                let [left, right] = &mut self.encoders;
                *if encoder.wheel == Wheel::Right { right } else { left } = encoder.state;
            }
            Event::Fault(fault) => {
                if self.changes.len() <= fault.sensor {
                    self.changes.resize(fault.sensor.saturating_add(1), None);
                }
                if let Some(change) = self.changes.get_mut(fault.sensor) {
                    *change = Some(fault.clone());
                }
            }
            Event::Board { .. }
            | Event::Ring { .. }
            | Event::Revised { .. }
            | Event::BoardLog { .. }
            | Event::Motion { .. }
            | Event::BoardReset { .. }
            | Event::BoardTrouble { .. } => {}
        }
    }

    /// The last change of each sensor's state, by id; none where it has not changed yet. Shorter than the ring where the last sensors have
    /// not changed.
    #[must_use]
    pub fn changes(&self) -> &[Option<FaultEvent>] {
        &self.changes
    }

    /// The sensors that are faulty now, with the reason in words.
    pub fn faulty(&self) -> impl Iterator<Item = &FaultEvent> {
        faulty(&self.changes)
    }

    /// True while the poses cannot be relied on: the echoes contradict the map, or the position in a known map is not known yet.
    #[must_use]
    pub const fn is_lost(&self) -> bool {
        self.is_lost
    }

    /// The left and the right wheel's encoder.
    #[must_use]
    pub const fn encoders(&self) -> [EncoderState; 2] {
        self.encoders
    }

    /// The newest event of each way in which the robot differs, or differed, from its configuration.
    #[must_use]
    pub fn models(&self) -> &[ModelEvent] {
        &self.models
    }

    /// The newest pose.
    #[must_use]
    pub const fn estimate(&self) -> Option<&Estimate> {
        self.estimate.as_ref()
    }
}

/// A copy of a session's state at one instant. It is filled in place again and again, so that a copy allocates nothing once its buffers
/// have grown.
#[derive(Clone, Debug, Default)]
pub struct Snapshot {
    /// Session time.
    pub at: Timestamp,
    /// Microseconds from 1970 to session time zero; none before the session has begun, or without a clock.
    pub unix_zero_us: Option<u64>,
    /// The robot's name.
    pub robot: String,
    /// The link's health.
    pub link: LinkState,
    /// Its cause, in words.
    pub cause: String,
    /// The board's name and firmware; empty while unknown.
    pub board: [String; 2],
    /// Its major and minor version of the protocol.
    pub protocol: Option<(u8, u8)>,
    /// Where its sensors sit; empty while unknown.
    pub ring: Ring,
    /// The number of the last sweep.
    pub sweep: Option<u64>,
    /// Its reference instant.
    pub sweep_at: Timestamp,
    /// Its ranges, by sensor, metres or as in REP-117.
    pub ranges_m: Vec<f64>,
    /// How the estimator used them.
    pub verdicts: Vec<Verdict>,
    /// Each sensor's state, by id; empty before the first sweep.
    pub states: Vec<SensorState>,
    /// The newest pose.
    pub estimate: Option<Estimate>,
    /// The pose cannot be relied on.
    pub is_lost: bool,
    /// The last change of each sensor's state, by id.
    pub changes: Vec<Option<FaultEvent>>,
    /// The left and the right wheel's encoder.
    pub encoders: [EncoderState; 2],
    /// The newest event of each way in which the robot differs, or differed, from its configuration.
    pub models: Vec<ModelEvent>,
    /// The wheels as learnt so far, where the method learns them.
    pub calibration: Option<Calibration>,
    /// What has been counted.
    pub counters: Counters,
}

impl Snapshot {
    /// The sensors that are faulty now.
    pub fn faulty(&self) -> impl Iterator<Item = &FaultEvent> {
        faulty(&self.changes)
    }

    /// In what the robot differs from its configuration now.
    pub fn doubted_models(&self) -> impl Iterator<Item = &ModelEvent> {
        self.models.iter().filter(|event| event.state != ModelState::Resolved)
    }

    /// Copies the link's health.
    pub fn copy_link(&mut self, link: &Link) {
        self.link = link.state();
        self.cause.clear();
        // Writing to a string cannot fail.
        let _ = write!(self.cause, "{}", link.cause());
    }

    /// Copies the state of a session at `now`.
    pub fn copy_session(&mut self, pipeline: &Pipeline, state: &SessionState, now: Timestamp) {
        self.at = now;
        self.counters = pipeline.counters();
        self.calibration = pipeline.calibration();
        self.estimate = state.estimate;
        self.is_lost = state.is_lost;
        self.encoders = state.encoders;
        if self.changes != state.changes {
            self.changes.clone_from(&state.changes);
        }
        if self.models != state.models {
            self.models.clone_from(&state.models);
        }
        self.states.clear();
        self.states.extend_from_slice(pipeline.states());
        self.copy_board(pipeline);
        let Some(sweep) = pipeline.sweep() else { return };
        (self.sweep, self.sweep_at) = (Some(sweep.index), sweep.at);
        self.ranges_m.clear();
        self.ranges_m.extend(sweep.beams.iter().map(|beam| beam.range_m));
        self.verdicts.clear();
        self.verdicts.extend((0..sweep.beams.len()).map(|sensor| pipeline.verdict(sensor)));
    }

    fn copy_board(&mut self, pipeline: &Pipeline) {
        if let Some(ring) = pipeline.ring().filter(|ring| **ring != self.ring) {
            self.ring = ring.clone();
        }
        if let Some(hello) = pipeline.board().hello() {
            let [board, firmware] = &mut self.board;
            copy(board, &hello.board);
            copy(firmware, &hello.firmware);
            self.protocol = Some((hello.major, hello.minor));
        }
    }
}

fn faulty(changes: &[Option<FaultEvent>]) -> impl Iterator<Item = &FaultEvent> {
    changes.iter().flatten().filter(|change| change.state != SensorState::Healthy)
}

/// Into the buffer that is there.
fn copy(target: &mut String, text: &str) {
    if target != text {
        text.clone_into(target);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::{EncoderEvent, FaultKind};
    use crate::robot_model::{ModelAspect, ModelFinding};

    #[test]
    fn each_way_in_which_the_robot_differs_is_kept_once() {
        let (mut state, at) = (SessionState::default(), Timestamp::default());
        let mut model = |aspect, to| {
            let finding =
                ModelFinding { aspect, measured: 2.0, sigma: 0.1, clause: "a test".into(), remedies: Vec::new() };
            state.take(&Event::Model(ModelEvent { at, since: at, finding, state: to }));
            let snapshot = Snapshot { models: state.models().to_vec(), ..Snapshot::default() };
            snapshot.doubted_models().map(|event| event.finding.aspect).collect::<Vec<_>>()
        };
        let (wheels, third) = (ModelAspect::WheelScale, ModelAspect::SensorBearing(3));
        assert_eq!(model(wheels, ModelState::Doubted), [wheels]);
        assert_eq!(model(third, ModelState::Corrected), [wheels, third]);
        assert_eq!(model(wheels, ModelState::Resolved), [third]);
        assert_eq!(model(wheels, ModelState::Doubted), [wheels, third]);
    }

    #[test]
    fn the_last_change_of_each_sensor_and_encoder_is_kept() {
        let mut state = SessionState::default();
        let at = Timestamp::default();
        let mut fault = |sensor, to| {
            state.take(&Event::Fault(FaultEvent { at, sensor, state: to, reason: "a test".into() }));
            state.faulty().map(|change| change.sensor).collect::<Vec<_>>()
        };
        assert_eq!(fault(2, SensorState::Faulty(FaultKind::Stuck)), [2]);
        assert_eq!(fault(0, SensorState::Faulty(FaultKind::Noisy)), [0, 2]);
        assert_eq!(fault(2, SensorState::Healthy), [0]);
        let dead = EncoderEvent { at, wheel: Wheel::Right, state: EncoderState::Dead, reason: "a test".into() };
        state.take(&Event::Encoder(dead));
        assert_eq!((state.changes().len(), state.encoders()), (3, [EncoderState::Healthy, EncoderState::Dead]));
    }
}
