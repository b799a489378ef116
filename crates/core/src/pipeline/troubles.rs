//! Messages beside the sweeps, and what is wrong with the board: said as events, and kept with its topic.

use super::{Pipeline, Start, Topic};
use crate::align::trouble::Trouble;
use crate::event::Event;
use crate::robot_model::{ModelAspect, ModelEvent, ticks_remedy};
use crate::sweep::Sweep;
use crate::time::Timestamp;
use slamd_protocol::{Message, MessageError};

/// What was noted of the session.
#[derive(Clone, Debug, Default)]
pub(super) struct Noted {
    troubles: Vec<(Topic, String)>,
    invalid: u32,
    first_group_at: Option<Timestamp>,
    /// When the robot last moved, or the first sweep's time.
    still_since: Option<Timestamp>,
    now: Timestamp,
    rolled_m: f64,
    has_pose: bool,
}

/// Kept troubles; later ones are events only.
const MAX_KEPT: usize = 64;
/// Invalid messages that are reported; the others are counted.
const MAX_INVALID: u32 = 3;
/// A board that streams for this long without HELLO does not identify itself, seconds.
const NO_HELLO_S: f64 = 3.0;
/// A robot that rolls less than this in this time has not moved, metres and seconds.
const STILL_M: f64 = 0.03;
const STILL_S: f64 = 10.0;

impl Noted {
    /// A sweep with the travel of the wheels since the one before.
    pub(super) fn moves(&mut self, sweep: &Sweep) {
        self.now = sweep.at;
        self.still_since.get_or_insert(sweep.at);
        self.rolled_m += sweep.left_m.abs().max(sweep.right_m.abs());
        if self.rolled_m > STILL_M {
            (self.still_since, self.rolled_m) = (Some(sweep.at), 0.0);
        }
    }
}

impl Pipeline {
    /// What was wrong with the board so far, by topic.
    #[must_use]
    pub fn troubles(&self) -> &[(Topic, String)] {
        &self.noted.troubles
    }

    /// What is wrong with the line or with what the board says of itself, for the state of the link.
    #[must_use]
    pub fn line_trouble(&self) -> Option<&str> {
        let is_of_line = |topic: Topic| match topic {
            Topic::Text | Topic::Content | Topic::SensorIds | Topic::Clock => true,
            Topic::Identity => self.board().hello().is_none(),
            Topic::Settings => self.ring().is_none(),
            Topic::Wheels | Topic::Temperature | Topic::Groups | Topic::Crosstalk | Topic::FlightUnit => false,
        };
        self.noted.troubles.iter().rev().find(|(topic, _)| is_of_line(*topic)).map(|(_, text)| text.as_str())
    }

    /// True if sweeps arrive, there is no pose yet, and the robot has not moved for ten seconds: the map begins when it does.
    #[must_use]
    pub fn waits_for_movement(&self) -> bool {
        let since = self.noted.still_since.filter(|_| !self.noted.has_pose);
        since.is_some_and(|since| self.noted.now.seconds_since(since) >= STILL_S)
    }

    /// A stamp of the board in microseconds: some boards count milliseconds.
    #[must_use]
    pub fn stamp_us(&self, stamp: u32) -> u32 {
        self.aligner.stamp_us(stamp)
    }

    /// Microseconds of flight per number that the board sends: 1, unless its readings show that it sends another unit.
    #[must_use]
    pub fn flight_factor(&self) -> f64 {
        self.aligner.flight_factor()
    }

    /// True over reported ranges where the readings show that they are ten times too short or too long; otherwise 1.
    #[must_use]
    pub fn range_factor(&self) -> f64 {
        self.aligner.range_factor()
    }

    /// True while no reading lies beyond half a metre, so that the readings do not tell their unit: the robot must move.
    #[must_use]
    pub fn is_range_unit_open(&self) -> bool {
        self.aligner.is_unit_open()
    }

    /// Says what is wrong with the board, if it has not been said.
    pub(super) fn trouble(&mut self, topic: Topic, text: String, at: Timestamp) {
        if self.noted.troubles.iter().any(|(_, said)| *said == text) {
            return;
        }
        if self.noted.troubles.len() < MAX_KEPT {
            self.noted.troubles.push((topic, text.clone()));
        }
        self.events.push(Event::BoardTrouble { at, text });
    }

    /// Says that a ring has too few sensors to correct the pose.
    pub(super) fn note_small_ring(&mut self, sensors: usize, at: Timestamp) {
        let least = self.params.wall_slam.min_sensors_to_correct;
        if sensors < least {
            let text = format!(
                "a ring of {sensors} cannot correct the pose, which follows the encoders alone: use {least} sensors or more, better 8"
            );
            self.trouble(Topic::Settings, text, at);
        }
    }

    /// What an unknown sensor means where the configured ring is not the board's; none elsewhere.
    fn other_ring(&self, trouble: &Trouble) -> Option<String> {
        let Trouble::UnknownSensor(sensor, count) = trouble else { return None };
        let has = self.conversation.board().hello()?.sensors;
        let ring = &self.config.ring;
        let is_other = ring.ring().is_some() && usize::from(has) != *count;
        is_other.then(|| {
            let (key, remedy) = if ring.circle.is_some() {
                ("ring.circle.count", format!("set ring.circle.count = {has}, or leave [ring.circle] out"))
            } else {
                ("ring.sensors", format!("name {has} sensors in ring.sensors, or none"))
            };
            format!(
                "{key} gives the robot {count} sensors, but the board has {has} and reports sensor {sensor}: {remedy} to take \
                 the places that the board says"
            )
        })
    }

    /// Says what the aligner found.
    pub(super) fn take_troubles(&mut self, at: Timestamp) {
        while let Some(trouble) = self.aligner.take_trouble() {
            let text = self.other_ring(&trouble).unwrap_or_else(|| trouble.to_string());
            self.trouble(trouble.topic(), text, at);
            if matches!(trouble, Trouble::RangesOff { .. })
                && matches!(self.start, Start::Fresh)
                && let Some(estimator) = &mut self.estimator
            {
                estimator.begin_anew(at, &mut self.events);
            }
        }
    }

    /// A valid frame has invalid content.
    pub(super) fn invalid(&mut self, error: &MessageError, at: Timestamp) {
        self.counters.refused += 1;
        if self.noted.invalid < MAX_INVALID {
            let said = self.events.len();
            let text = format!("the board sends an invalid message, {error}: correct it as protocol/README.md says");
            self.trouble(Topic::Content, text, at);
            self.noted.invalid += u32::from(self.events.len() > said);
        }
    }

    /// Says that a board streams without HELLO.
    pub(super) fn note_silence(&mut self, at: Timestamp) {
        if self.counters.groups == 0 || self.board().hello().is_some() {
            return;
        }
        let first = *self.noted.first_group_at.get_or_insert(at);
        if at.seconds_since(first) > NO_HELLO_S {
            let text = "the board sends sensor groups but does not say who it is (no HELLO): check the wire from the \
                        computer to the board (its RX) and its answer to HELLO_REQUEST, or name [ring.circle] and \
                        robot.ticks_per_turn in the robot's configuration";
            self.trouble(Topic::Identity, text.into(), at);
        }
    }

    /// Keeps the troubles that events of this input tell. Wheels of a wrong scale are mended by the ticks per turn that the board tells, too.
    pub(super) fn note_events(&mut self) {
        let told = self.config.robot.ticks_per_turn.is_none().then(|| self.board().ticks_per_turn()).flatten();
        for event in &mut self.events {
            match event {
                Event::Model(ModelEvent { finding, .. })
                    if finding.aspect == ModelAspect::WheelScale && !finding.remedies.is_empty() =>
                {
                    if let (Some(ticks), Some(("robot.wheel_radius_m", _))) = (told, finding.remedies.first()) {
                        finding.remedies.insert(0, ticks_remedy(ticks, finding.measured));
                    }
                }
                Event::Estimate(_) => self.noted.has_pose = true,
                Event::BoardTrouble { text, .. } => {
                    let is_new = self.noted.troubles.iter().all(|(_, said)| said != text);
                    if is_new && self.noted.troubles.len() < MAX_KEPT {
                        self.noted.troubles.push((Topic::Settings, text.clone()));
                    }
                }
                _ => {}
            }
        }
    }

    /// A message without a stamp that sweeps are made of.
    pub(super) fn aside(&mut self, message: &Message, at: Timestamp) {
        let Self { conversation, events, .. } = self;
        match message {
            Message::Geometry(geometry) => {
                if let Some(ring) = conversation.geometry(geometry, at, events) {
                    self.use_ring(self.config.ring.ring().unwrap_or_else(|| self.config.ring.mounted(ring)), at);
                }
            }
            Message::ConfigValue { key, value } => conversation.setting(*key, *value, at),
            Message::Ack { of_type, result, .. } => conversation.acknowledged(*of_type, *result, at, events),
            Message::Motion(motion) => {
                let before = self.motion.replace(*motion);
                if before.is_none_or(|before| before.state != motion.state) {
                    events.push(Event::Motion { at, state: motion.state });
                }
            }
            Message::Status(status) => {
                if let Some(cdeg) = status.temperature_cdeg {
                    self.aligner.measured_air(0.01 * f64::from(cdeg), at);
                }
            }
            Message::Log(log) => {
                events.push(Event::BoardLog { at, text: log.text.to_string() });
            }
            _ => {}
        }
    }

    /// Numbers between the newest and this one are missing; one that comes late was counted as missing and is not.
    pub(super) fn count_lost(&mut self, seq: u8) {
        match seq.wrapping_sub(self.last_seq.unwrap_or_else(|| seq.wrapping_sub(1))) {
            ahead @ 1..128 => {
                self.counters.lost_frames += u64::from(ahead - 1);
                self.last_seq = Some(seq);
            }
            _ => self.counters.lost_frames = self.counters.lost_frames.saturating_sub(1),
        }
    }
}
