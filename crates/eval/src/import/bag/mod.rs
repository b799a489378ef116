//! ROS 2 bags: `sensor_msgs/Range` or `LaserScan`, with `sensor_msgs/JointState` or `nav_msgs/Odometry`.
//!
//! Each Range topic, or each frame on one topic, is a sensor; they are those of the ring in the order of their names, numbers by value. A
//! LaserScan gives each sensor what a CARMEN log's laser gives it. Wheels are the joints whose names have `left` and `right`; without them
//! the pose of the odometry becomes the counts that would have given it. Messages of one time are one row.

mod cdr;
mod mcap_file;
mod message;
mod sqlite;
mod storage;

use super::carmen::{Beams, seen};
use super::drive::{Drive, Found};
use super::rows::Row;
use super::{ImportError, Options, WheelTicks, sequence};
use message::Message;
use slamd_core::Config;
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::TAU;
use std::path::Path;
use storage::Bag;

/// Messages whose stamps differ by no more are of one time, seconds.
const SAME_S: f64 = 0.5e-3;
/// So many names in a message.
const MAX_NAMES: usize = 20;

/// Reads and checks a bag: a file or a folder.
///
/// # Errors
/// When it cannot be read, is no ROS 2 bag or has not what a drive needs, or the configuration lacks the ring or `robot.ticks_per_turn`.
pub fn read(path: &Path, config: &Config, options: &Options) -> Result<Drive, ImportError> {
    let ring = config.ring.ring().ok_or(ImportError::Config("ring.circle or ring.sensors"))?;
    let ticks_per_turn = config.robot.ticks_per_turn.ok_or(ImportError::Config("robot.ticks_per_turn"))?;
    let mut poses = WheelTicks::new(&config.robot).ok_or(ImportError::Config("robot.ticks_per_turn"))?;
    let (file, bag) = (path.display().to_string(), Bag::read(path)?);
    let problem = |problem: String| ImportError::Problem { file: file.clone(), problem };
    let sonars = sonars(&bag);
    let has_scan = bag.entries.iter().any(|entry| matches!(entry.message, Message::Scan { .. }));
    if sonars.is_empty() && !has_scan {
        let damage: String = bag.remarks.iter().map(|remark| format!("{remark}; ")).collect();
        return Err(problem(format!(
            "{damage}no sensor_msgs/msg/Range and no LaserScan in {} messages; it has {}",
            bag.messages,
            if bag.others.is_empty() { "no other topic".into() } else { list(&bag.others) }
        )));
    }
    if !sonars.is_empty() && sonars.len() != ring.len() {
        let names: BTreeSet<String> = sonars.keys().map(|(topic, frame)| format!("{topic} ({frame})")).collect();
        return Err(problem(format!(
            "{} Range sensors, and the ring of the configuration has {}: {}",
            sonars.len(),
            ring.len(),
            list(&names)
        )));
    }
    let mut found = Found { kind: "the ROS 2 bag", is_whole: bag.is_whole, collects: true, ..Found::default() };
    found.remarks.clone_from(&bag.remarks);
    found.skipped = (bag.messages - bag.entries.len()) as u64;
    let wheels = Wheels::find(&bag);
    found.remarks.push(wheels.sentence());
    if matches!(wheels, Wheels::None) {
        found.doubts.push("there is neither odometry nor a joint for each wheel: the robot stands still".into());
    }
    if has_scan && !sonars.is_empty() {
        found.remarks.push("the Range topics are used, LaserScan is left out".into());
    }
    let mut turned = Turned::default();
    let mut rows = Vec::new();
    for entry in &bag.entries {
        let mut row =
            Row { line: entry.number, t_s: entry.at_s, ticks: [None; 2], readings: vec![f64::NAN; ring.len()] };
        match &entry.message {
            Message::Range { frame, range_m } => {
                let sensor = sonars.get(&(Natural::new(&entry.topic), Natural::new(frame)));
                if let Some(reading) = sensor.and_then(|sensor| row.readings.get_mut(*sensor)) {
                    *reading = *range_m;
                }
            }
            Message::Scan { first_rad, step_rad, ranges_m } if sonars.is_empty() => {
                let (first_deg, step_deg) = (first_rad.to_degrees(), step_rad.to_degrees());
                let beams = Beams { first_deg, step_deg, count: ranges_m.len() };
                row.readings = seen(&ring.mountings, &beams, ranges_m, config.ring.max_range_m);
            }
            Message::Odometry(pose) if wheels.takes(&entry.topic) => row.ticks = poses.at(*pose).map(Some),
            Message::Joints(named) | Message::Spins(named) => match wheels.both(&entry.topic, named) {
                Some(both) => {
                    let is_angle = matches!(entry.message, Message::Joints(_));
                    let angles_rad = if is_angle { both } else { turned.at(entry.at_s, both) };
                    row.ticks = angles_rad
                        .map(|angle_rad| Some(super::counts::wrapped(angle_rad / TAU * f64::from(ticks_per_turn))));
                }
                None => continue,
            },
            Message::Scan { .. } | Message::Odometry(_) => continue,
        }
        rows.push(row);
    }
    sequence::sort(&mut rows);
    let drive = |rows, found| Drive::new(merged(rows), found, &file, config, options);
    let Some(last) = bag.torn_after else { return drive(rows, found) };
    drive_of_torn(rows, found, last, drive)
}

/// The drive of a bag with a gap after message `last`. Where nobody knows how far the wheels turned in what is lost, it ends before the gap.
fn drive_of_torn(
    rows: Vec<Row>,
    found: Found,
    last: usize,
    drive: impl Fn(Vec<Row>, Found) -> Result<Drive, ImportError>,
) -> Result<Drive, ImportError> {
    let before: Vec<Row> = rows.iter().filter(|row| row.line <= last).cloned().collect();
    let mut only = found.clone();
    only.remarks.push("only what was recorded before the damage is used: the wheels turned in what is lost".into());
    match drive(rows, found) {
        Err(ImportError::Line { .. }) if !before.is_empty() => drive(before, only),
        drive => drive,
    }
}

/// Speeds of both wheels, summed up to angles.
#[derive(Default)]
struct Turned {
    last: Option<(f64, [f64; 2])>,
    angles_rad: [f64; 2],
}

impl Turned {
    /// The angles at this time, with the mean speed since the last message. Nothing turns over a pause or back in time.
    fn at(&mut self, at_s: f64, spins: [f64; 2]) -> [f64; 2] {
        if let Some((last_s, last)) = self.last {
            let step_s = at_s - last_s;
            if (0.0..=MAX_STEP_S).contains(&step_s) {
                for (angle_rad, (from, to)) in self.angles_rad.iter_mut().zip(last.into_iter().zip(spins)) {
                    *angle_rad += 0.5 * (from + to) * step_s;
                }
            }
        }
        self.last = Some((at_s, spins));
        self.angles_rad
    }
}

/// Speeds that are farther apart say nothing of the time between them, seconds.
const MAX_STEP_S: f64 = 1.0;

/// Where the counts come from.
enum Wheels {
    /// A topic, the names of the left and the right joint, and whether only their speeds are known.
    Joints(String, [String; 2], bool),
    Odometry(String),
    None,
}

impl Wheels {
    fn find(bag: &Bag) -> Self {
        let joints = bag.entries.iter().find_map(|entry| {
            let (Message::Joints(joints) | Message::Spins(joints)) = &entry.message else { return None };
            let named = |word: &str| {
                let mut names = joints.iter().map(|(name, _)| name).filter(|name| name.to_lowercase().contains(word));
                // Four wheels: the ones behind turn as those in front.
                names.next().cloned()
            };
            let is_speed = matches!(entry.message, Message::Spins(_));
            Some(Self::Joints(entry.topic.clone(), [named("left")?, named("right")?], is_speed))
        });
        let odometry: BTreeSet<&String> = bag
            .entries
            .iter()
            .filter(|entry| matches!(entry.message, Message::Odometry(_)))
            .map(|entry| &entry.topic)
            .collect();
        let usual = odometry.iter().find(|topic| topic.as_str() == "/odom").or_else(|| odometry.first());
        joints.or_else(|| usual.map(|topic| Self::Odometry((*topic).clone()))).unwrap_or(Self::None)
    }

    fn sentence(&self) -> String {
        match self {
            Self::Joints(topic, [left, right], is_speed) => {
                let how = if *is_speed { ", summed up from their speeds" } else { "" };
                format!("counts from {topic}: joints {left} and {right}{how}")
            }
            Self::Odometry(topic) => format!("counts from the poses of {topic}"),
            Self::None => "no counts".into(),
        }
    }

    fn takes(&self, topic: &str) -> bool {
        matches!(self, Self::Odometry(own) if own == topic)
    }

    /// The numbers of the left and the right joint.
    fn both(&self, topic: &str, named: &[(String, f64)]) -> Option<[f64; 2]> {
        let Self::Joints(own, [left, right], _) = self else { return None };
        let number = |wanted: &String| named.iter().find(|(name, _)| name == wanted).map(|(_, number)| *number);
        if own == topic { Some([number(left)?, number(right)?]) } else { None }
    }
}

/// A name in whose order numbers stand by their values.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Natural(Vec<(String, u64)>);

impl Natural {
    fn new(name: &str) -> Self {
        let (mut parts, mut text, mut number) = (Vec::new(), String::new(), None::<u64>);
        for character in name.chars() {
            match character.to_digit(10) {
                Some(digit) => {
                    number = Some(number.unwrap_or_default().saturating_mul(10).saturating_add(digit.into()))
                }
                None => {
                    if let Some(number) = number.take() {
                        parts.push((std::mem::take(&mut text), number + 1));
                    }
                    text.push(character);
                }
            }
        }
        parts.push((text, number.map_or(0, |number| number.saturating_add(1))));
        Self(parts)
    }
}

impl std::fmt::Display for Natural {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.iter().try_for_each(|(text, number)| match number {
            0 => write!(f, "{text}"),
            number => write!(f, "{text}{}", number - 1),
        })
    }
}

/// The sensors by topic and frame.
fn sonars(bag: &Bag) -> BTreeMap<(Natural, Natural), usize> {
    let names: BTreeSet<(Natural, Natural)> = bag
        .entries
        .iter()
        .filter_map(|entry| match &entry.message {
            Message::Range { frame, .. } => Some((Natural::new(&entry.topic), Natural::new(frame))),
            _ => None,
        })
        .collect();
    names.into_iter().zip(0..).collect()
}

/// Joins rows of one time.
fn merged(rows: Vec<Row>) -> Vec<Row> {
    let mut merged: Vec<Row> = Vec::with_capacity(rows.len());
    for row in rows {
        let is_free = |last: &Row| {
            let readings = last.readings.iter().zip(&row.readings).all(|(a, b)| a.is_nan() || b.is_nan());
            let ticks = last.ticks.iter().zip(&row.ticks).all(|(a, b)| a.is_none() || b.is_none());
            (row.t_s - last.t_s).abs() <= SAME_S && readings && ticks
        };
        match merged.last_mut().filter(|last| is_free(last)) {
            Some(last) => {
                for (reading, further) in last.readings.iter_mut().zip(&row.readings).filter(|(_, new)| !new.is_nan()) {
                    *reading = *further;
                }
                for (ticks, further) in last.ticks.iter_mut().zip(&row.ticks) {
                    *ticks = ticks.or(*further);
                }
            }
            None => merged.push(row),
        }
    }
    merged
}

fn list(names: &BTreeSet<String>) -> String {
    let few = names.iter().take(MAX_NAMES).cloned().collect::<Vec<_>>().join(", ");
    if names.len() > MAX_NAMES { format!("{few} and {} more", names.len() - MAX_NAMES) } else { few }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_in_the_order_of_their_numbers() {
        let mut names = ["/sonar10", "/sonar9/range", "/sonar9", "/front", "/sonar010a"].map(Natural::new);
        names.sort();
        let names: Vec<String> = names.iter().map(ToString::to_string).collect();
        assert_eq!(names, ["/front", "/sonar9", "/sonar9/range", "/sonar10", "/sonar10a"]);
    }

    #[test]
    #[expect(clippy::float_cmp, reason = "these sums are exact")]
    fn speeds_are_summed_up_but_not_over_pauses() {
        let mut turned = Turned::default();
        let both = |turned: &mut Turned, at_s, spin| turned.at(at_s, [spin, -spin]);
        assert_eq!(both(&mut turned, 10.0, 2.0), [0.0, 0.0]);
        assert_eq!(both(&mut turned, 10.5, 4.0), [1.5, -1.5]);
        assert_eq!(both(&mut turned, 20.0, 4.0), [1.5, -1.5], "a pause");
        assert_eq!(both(&mut turned, 19.9, 4.0), [1.5, -1.5], "back in time");
    }

    #[test]
    fn messages_of_one_time_are_one_row() {
        let row = |t_s, ticks: Option<i32>, readings: &[f64]| Row {
            line: 1,
            t_s,
            ticks: [ticks; 2],
            readings: readings.to_vec(),
        };
        let nan = f64::NAN;
        let rows = merged(vec![
            row(1.0, Some(5), &[nan, nan]),
            row(1.0, None, &[0.5, nan]),
            row(1.0001, None, &[nan, 0.7]),
            row(1.0002, None, &[0.6, nan]),
            row(2.0, None, &[nan, 0.8]),
        ]);
        assert_eq!(rows.len(), 3);
        assert_eq!((rows[0].ticks, rows[0].readings.as_slice()), ([Some(5); 2], &[0.5, 0.7][..]));
    }
}
