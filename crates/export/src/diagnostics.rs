//! `diagnostic_msgs/msg/DiagnosticArray`: one status per sensor, one for the wheel encoders, one for the place in the map.

use super::message::{Stamp, sonar, with_header};
use slamd_core::event::{EncoderState, Event, LocalizationChange, SensorState, Wheel};
use slamd_core::time::Timestamp;
use std::time::Duration;

/// As in `DiagnosticStatus`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
enum Level {
    Ok = 0,
    Warn = 1,
    Error = 2,
}

/// How one thing fares.
#[derive(Clone, Debug)]
struct Status {
    level: Level,
    message: String,
    /// In a word.
    state: &'static str,
    /// Since when; none where it has always been so.
    since: Option<Timestamp>,
}

/// What is known of sensors, wheels and place, and when it was last told.
pub(super) struct Diagnostics {
    robot: String,
    sensors: Vec<Status>,
    encoders: [Status; 2],
    place: Status,
    is_changed: bool,
    due: Timestamp,
}

/// Told at least this often.
const PERIOD: Duration = Duration::from_secs(1);

impl Status {
    fn well() -> Self {
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
            encoders: [Status::well(), Status::well()],
            place: Status::new(Level::Warn, "unknown", "no pose yet: the robot must drive between walls", None),
            is_changed: true,
            due: Timestamp::default(),
        }
    }

    /// True where a sensor's readings are worth nothing.
    pub(super) fn is_faulty(&self, sensor: usize) -> bool {
        self.sensors.get(sensor).is_some_and(|status| status.level != Level::Ok)
    }

    /// Takes note of what has happened.
    pub(super) fn note(&mut self, event: &Event) {
        match event {
            Event::Ring { sensors, .. } => self.sensors.resize(*sensors, Status::well()),
            Event::Fault(fault) => {
                let status = match fault.state {
                    SensorState::Healthy => Status { since: Some(fault.at), ..Status::well() },
                    SensorState::Faulty(kind) => {
                        Status::new(Level::Error, kind.word(), fault.reason.as_str(), Some(fault.at))
                    }
                };
                if let Some(place) = self.sensors.get_mut(fault.sensor) {
                    *place = status;
                }
            }
            Event::Encoder(encoder) => {
                let level = match encoder.state {
                    EncoderState::Healthy => Level::Ok,
                    // Its counts are used, with the sign turned over.
                    EncoderState::Reversed => Level::Warn,
                    EncoderState::Dead => Level::Error,
                };
                let status = Status::new(level, encoder.state.word(), encoder.reason.as_str(), Some(encoder.at));
                self.encoders[usize::from(encoder.wheel == Wheel::Right)] = status;
            }
            Event::Localization(event) => {
                self.place = match &event.change {
                    LocalizationChange::Lost => Status::new(
                        Level::Error,
                        "lost",
                        "position lost: what is heard contradicts the map",
                        Some(event.since),
                    ),
                    LocalizationChange::Regained { .. } => {
                        Status::new(Level::Ok, "known", "position found again", Some(event.at))
                    }
                    LocalizationChange::Abandoned => Status::new(
                        Level::Warn,
                        "doubtful",
                        "position not found: no other place explains what is heard",
                        Some(event.at),
                    ),
                    LocalizationChange::KnownMap(search) => {
                        let (level, state) =
                            if event.is_lost() { (Level::Error, "unknown") } else { (Level::Ok, "known") };
                        Status::new(level, state, search.reason.as_str(), Some(event.at))
                    }
                };
            }
            Event::Estimate(estimate) if self.place.state == "unknown" => {
                self.place = Status::new(Level::Ok, "known", "position known", Some(estimate.at));
            }
            _ => return,
        }
        self.is_changed = true;
    }

    /// The message, where something has changed or it is time.
    pub(super) fn tell(&mut self, now: Timestamp, at: Stamp) -> Option<Vec<u8>> {
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
        write("localisation", self.place.level, &self.place.message, &values(&self.place));
        Some(cdr.finish())
    }
}

fn values(status: &Status) -> Vec<(&'static str, String)> {
    let mut values = vec![("state", status.state.into())];
    values.extend(status.since.map(|since| ("since_s", format!("{:.3}", since.seconds()))));
    values
}
