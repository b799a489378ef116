//! `diagnostic_msgs/msg/DiagnosticArray`: one status per sensor, one for the wheel
//! encoders, one for the localization.

use super::message::{Stamp, sonar, with_header};
use slamd_core::{EncoderState, Event, LocalizationChange, SensorState, Timestamp, Wheel};
use std::time::Duration;

/// As in `DiagnosticStatus`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
enum Level {
    Ok = 0,
    Warn = 1,
    Error = 2,
}

/// The status of one component.
#[derive(Clone, Debug)]
struct Status {
    level: Level,
    message: String,
    /// The state in one word.
    state: &'static str,
    /// Start of the state; `None` if it never changed.
    since: Option<Timestamp>,
}

/// The states of sensors, encoders and localization, and when the next message is due.
pub(super) struct Diagnostics {
    robot: String,
    sensors: Vec<Status>,
    encoders: [Status; 2],
    localization: Status,
    is_changed: bool,
    due: Timestamp,
}

/// Maximum time between two messages.
const PERIOD: Duration = Duration::from_secs(1);

impl Status {
    fn healthy() -> Self {
        Self::new(Level::Ok, "healthy", "OK", None)
    }

    fn new(level: Level, state: &'static str, message: impl Into<String>, since: Option<Timestamp>) -> Self {
        Self { level, message: message.into(), state, since }
    }
}

impl Diagnostics {
    pub(super) fn new(robot: &str) -> Self {
        Self {
            robot: robot.into(),
            sensors: Vec::new(),
            encoders: [Status::healthy(), Status::healthy()],
            localization: Status::new(Level::Warn, "unknown", "no pose yet: the robot must drive between walls", None),
            is_changed: true,
            due: Timestamp::default(),
        }
    }

    /// True if a sensor is faulty.
    pub(super) fn is_faulty(&self, sensor: usize) -> bool {
        self.sensors.get(sensor).is_some_and(|status| status.level != Level::Ok)
    }

    /// Updates the states.
    pub(super) fn note(&mut self, event: &Event) {
        match event {
            Event::Ring { sensors, .. } => self.sensors.resize(*sensors, Status::healthy()),
            Event::Fault(fault) => {
                let status = match fault.state {
                    SensorState::Healthy => Status { since: Some(fault.at), ..Status::healthy() },
                    SensorState::Faulty(kind) => {
                        Status::new(Level::Error, kind.word(), fault.reason.as_str(), Some(fault.at))
                    }
                };
                if let Some(slot) = self.sensors.get_mut(fault.sensor) {
                    *slot = status;
                }
            }
            Event::Encoder(encoder) => {
                let level = match encoder.state {
                    EncoderState::Healthy => Level::Ok,
                    // Its counts are used with the sign reversed.
                    EncoderState::Reversed => Level::Warn,
                    EncoderState::Dead => Level::Error,
                };
                let status = Status::new(level, encoder.state.word(), encoder.reason.as_str(), Some(encoder.at));
                self.encoders[usize::from(encoder.wheel == Wheel::Right)] = status;
            }
            Event::Localization(event) => {
                self.localization = match &event.change {
                    LocalizationChange::Lost => Status::new(
                        Level::Error,
                        "lost",
                        "position lost: the echoes contradict the map",
                        Some(event.since),
                    ),
                    LocalizationChange::Regained { .. } => {
                        Status::new(Level::Ok, "known", "position found again", Some(event.at))
                    }
                    LocalizationChange::Doubted { reason } => {
                        Status::new(Level::Error, "doubtful", reason.as_str(), Some(event.since))
                    }
                    LocalizationChange::Trusted => Status::new(Level::Ok, "known", "position known", Some(event.at)),
                    LocalizationChange::KnownMap(search) => {
                        let (level, state) =
                            if event.is_lost() { (Level::Error, "unknown") } else { (Level::Ok, "known") };
                        Status::new(level, state, search.reason.as_str(), Some(event.at))
                    }
                };
            }
            Event::Estimate(estimate) if self.localization.state == "unknown" => {
                self.localization = Status::new(Level::Ok, "known", "position known", Some(estimate.at));
            }
            _ => return,
        }
        self.is_changed = true;
    }

    /// The message, if a state has changed or the period is over.
    pub(super) fn message_if_due(&mut self, now: Timestamp, at: Stamp) -> Option<Vec<u8>> {
        if !self.is_changed && now < self.due {
            return None;
        }
        (self.is_changed, self.due) = (false, now + PERIOD);
        let mut cdr = with_header(at, "");
        cdr.count(self.sensors.len() + 2);
        let mut write = |name: &str, level: Level, message: &str, values: &[(&str, String)]| {
            cdr.u8(level as u8);
            cdr.text(&format!("slamd: {name}"));
            cdr.text(message);
            cdr.text(&self.robot);
            cdr.count(values.len());
            for (key, value) in values {
                cdr.text(key);
                cdr.text(value);
            }
        };
        for (sensor, status) in self.sensors.iter().enumerate() {
            write(&sonar(sensor), status.level, &status.message, &values(status));
        }
        let [left, right] = &self.encoders;
        let worse = if right.level > left.level { right } else { left };
        let states = [("left", left.state.into()), ("right", right.state.into())];
        write("wheel encoders", worse.level, &worse.message, &states);
        write("localisation", self.localization.level, &self.localization.message, &values(&self.localization));
        Some(cdr.finish())
    }
}

fn values(status: &Status) -> Vec<(&'static str, String)> {
    let mut values = vec![("state", status.state.into())];
    values.extend(status.since.map(|since| ("since_s", format!("{:.3}", since.seconds()))));
    values
}
