//! The sensors: which respond, which receive echoes, which are stuck.

use super::finding::{Finding, Level};
use super::troubles::Troubles;
use serde::Serialize;
use slamd_core::{Ring, Topic};
use slamd_protocol::{Echo, Sonar, Status};
use std::f64::consts::TAU;

/// Half the speed of sound at room temperature, metres per microsecond.
const METRES_PER_US: f64 = 171.7e-6;
/// Least number of pings to judge a sensor.
const MIN_PINGS: u64 = 20;
/// Largest spread of a stuck sensor's readings while the robot moves, microseconds (5 mm).
const STUCK_SPREAD_US: u16 = 30;
/// Least path of the robot to call a sensor stuck, metres.
const MIN_PATH_M: f64 = 0.3;
/// Least share of pings with an echo at both neighbours to expect echoes from a sensor too.
const MIN_ECHO_SHARE: f64 = 0.5;
/// Least share of the expected sweeps that must arrive.
const MIN_SWEEPS: f64 = 0.9;
const MAX_GROUPS: usize = 256;
/// If no sensor reads more than this, microseconds (12 cm), the readings have another unit.
const MIN_FARTHEST_US: u16 = 700;

/// Statistics of one sensor.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SensorStatistics {
    /// The sensor's id.
    pub sensor: usize,
    /// Number of times that its group fired; if the groups are unknown, number of its answers.
    pub pings: u64,
    /// Answers of any kind.
    pub answers: u64,
    /// Echoes.
    pub echoes: u64,
    /// Pings without an echo within range.
    pub no_echo: u64,
    /// Pings whose echo pin did not fall, or was high before the trigger.
    pub pin_stuck: u64,
    /// Pings while it was switched off.
    pub disabled: u64,
    /// Nearest echo, metres.
    pub least_m: Option<f64>,
    /// Mean of the echoes, metres.
    pub mean_m: Option<f64>,
    /// Farthest echo, metres.
    pub most_m: Option<f64>,
    #[serde(skip)]
    least_us: u16,
    #[serde(skip)]
    most_us: u16,
    #[serde(skip)]
    bearing_rad: f64,
}

/// Counts of one sensor's answers.
#[derive(Clone, Debug, Default)]
struct Tally {
    answers: u64,
    echoes: u64,
    no_echo: u64,
    pin_stuck: u64,
    disabled: u64,
    sum_us: u64,
    range_us: Option<(u16, u16)>,
}

/// Evidence about the sensors.
#[derive(Default)]
pub(super) struct SensorEvidence {
    tallies: Vec<Tally>,
    /// Number of times that each group fired.
    fired: Vec<u64>,
    stuck_mask: u64,
    last_us: Option<u32>,
    slots_us: Vec<u32>,
    cycles: u64,
    span_us: u64,
}

impl SensorEvidence {
    /// Takes a group that fired at `t_us`.
    pub(super) fn sonar(&mut self, sonar: &Sonar, t_us: u32) {
        let group = usize::from(sonar.group);
        self.fired.resize(MAX_GROUPS.min(self.fired.len().max(group + 1)), 0);
        if let Some(fired) = self.fired.get_mut(group) {
            *fired += 1;
        }
        self.cycles += u64::from(sonar.last_of_cycle);
        if let Some(last_us) = self.last_us.replace(t_us) {
            let slot_us = t_us.wrapping_sub(last_us);
            if slot_us < 10_000_000 {
                self.slots_us.push(slot_us);
                self.span_us += u64::from(slot_us);
            }
        }
        for result in &sonar.echoes {
            let sensor = usize::from(result.sensor);
            self.tallies.resize(self.tallies.len().max(sensor + 1), Tally::default());
            if let Some(tally) = self.tallies.get_mut(sensor) {
                tally.add(result.echo);
            }
        }
    }

    pub(super) fn status(&mut self, status: &Status) {
        self.stuck_mask |= status.stuck_mask;
    }

    /// The board's clock restarted.
    pub(super) fn restart(&mut self) {
        self.last_us = None;
    }

    /// What each sensor has measured, where a number that the board sends is so many microseconds of flight.
    pub(super) fn statistics(&self, sensors: usize, ring: Option<&Ring>, us_per_number: f64) -> Vec<SensorStatistics> {
        let none = Tally::default();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a cast from f64 saturates")]
        let us = |flight: u16| (us_per_number * f64::from(flight)).round() as u16;
        let known = ring.map_or(self.tallies.len(), |_| 0);
        (0..sensors.max(known))
            .map(|sensor| {
                let tally = self.tallies.get(sensor).unwrap_or(&none);
                let mounting = ring.and_then(|ring| ring.mountings.get(sensor));
                let fired = mounting.and_then(|mounting| self.fired.get(usize::from(mounting.group)));
                // If the ring is unknown: all groups fire about equally often.
                let fired = fired.or_else(|| self.fired.iter().filter(|&&fired| fired > 0).min());
                let (least, most) = tally.range_us.unwrap_or_default();
                let (least_us, most_us) = (us(least), us(most));
                let mean_us = tally.sum_us as f64 / tally.echoes.max(1) as f64 * us_per_number;
                let metres = |us: u16| tally.range_us.map(|_| f64::from(us) * METRES_PER_US);
                SensorStatistics {
                    sensor,
                    pings: fired.copied().unwrap_or_default().max(tally.answers),
                    answers: tally.answers,
                    echoes: tally.echoes,
                    no_echo: tally.no_echo,
                    pin_stuck: tally.pin_stuck,
                    disabled: tally.disabled,
                    least_m: metres(least_us),
                    mean_m: (tally.echoes > 0).then_some(mean_us * METRES_PER_US),
                    most_m: metres(most_us),
                    least_us,
                    most_us,
                    bearing_rad: mounting.map_or(sensor as f64, |mounting| mounting.robot_from_sensor.theta_rad),
                }
            })
            .collect()
    }

    pub(super) fn findings(
        &self,
        statistics: &[SensorStatistics],
        path_m: f64,
        max_range_m: f64,
        slot_us: Option<i32>,
        ring: Option<&Ring>,
        troubles: &Troubles<'_>,
    ) -> Vec<Finding> {
        if self.fired.iter().sum::<u64>() == 0 {
            // A message that does not fit the specification has its own finding: slamd starts the ring once it knows it.
            if troubles.has(Topic::Content) || ring.is_none() && troubles.has(Topic::Settings) {
                return Vec::new();
            }
            let fix = "press the board's reset button; if that does not help, flash protocol/firmware again";
            return vec![Finding::new(Level::Problem, "sensors.silent", "the board answers but fires no sensor", fix)];
        }
        // Stamps that run back or count something else tell no rate.
        let mut findings = Vec::from_iter(self.rate(slot_us).filter(|_| !troubles.has(Topic::Clock)));
        if troubles.has(Topic::SensorIds) {
            return findings;
        }
        if let Some(finding) = unit(statistics) {
            findings.push(finding);
            return findings;
        }
        let per_sensor: Vec<Option<Finding>> = statistics
            .iter()
            .map(|sensor| {
                let neighbours = neighbours_have_echoes(sensor, statistics);
                let is_stuck = sensor.sensor < 64 && self.stuck_mask >> sensor.sensor & 1 == 1;
                examine(sensor, is_stuck, neighbours, path_m, max_range_m)
            })
            .collect();
        let silent = statistics.iter().filter(|sensor| sensor.echoes == 0).count();
        let whole = per_sensor.iter().filter(|finding| finding.is_none()).count();
        let text = format!("{whole} of {} sensors measure, {silent} give no distance at all", statistics.len());
        findings.push(if silent * 2 > statistics.len() {
            let fix = "check the common supply, ground and trigger lines; hold something 30 cm in front of the sensors";
            Finding::new(Level::Problem, "sensors.count", text, fix)
        } else {
            Finding::ok("sensors.count", text)
        });
        findings.extend(per_sensor.into_iter().flatten());
        findings
    }

    /// Compares the sweep rate with the rate that follows from the slots.
    fn rate(&self, slot_us: Option<i32>) -> Option<Finding> {
        let mut slots_us = self.slots_us.clone();
        slots_us.sort_unstable();
        let median_us = slots_us.get(slots_us.len() / 2).copied().filter(|&us| us > 0)?;
        let slot_us = slot_us.and_then(|us| u32::try_from(us).ok()).filter(|&us| us > 0).unwrap_or(median_us);
        let groups = self.fired.iter().filter(|&&fired| fired > 0).count().max(1);
        if self.cycles < 5 || self.span_us == 0 {
            return None;
        }
        let expected_hz = 1e6 / (f64::from(slot_us) * groups as f64);
        let seen_hz = self.cycles as f64 / (self.span_us as f64 * 1e-6);
        let text = format!("{seen_hz:.1} sweeps/s of the {expected_hz:.1} that {groups} groups of {slot_us} us allow");
        Some(if seen_hz < MIN_SWEEPS * expected_hz {
            let fix = "see the link's findings; if there are none, the board cannot keep its slots: set [board] slot_us higher";
            Finding::new(Level::Warning, "sensors.rate", text, fix)
        } else {
            Finding::ok("sensors.rate", text)
        })
    }
}

/// Readings that are all nearer than a sensor can measure: the board converts them.
fn unit(statistics: &[SensorStatistics]) -> Option<Finding> {
    let measuring: Vec<&SensorStatistics> = statistics.iter().filter(|sensor| sensor.echoes >= MIN_PINGS).collect();
    let most_us = measuring.iter().map(|sensor| sensor.most_us).max().unwrap_or(u16::MAX);
    (measuring.len() >= 3 && most_us < MIN_FARTHEST_US).then(|| {
        let text = format!(
            "no sensor ever reads more than {:.0} cm: the board sends centimetres instead of microseconds?",
            100.0 * f64::from(most_us) * METRES_PER_US
        );
        let fix = "send the round-trip time of flight in microseconds, as pulseIn() gives it, without dividing by 58";
        Finding::new(Level::Problem, "sensors.unit", text, fix)
    })
}

impl Tally {
    fn add(&mut self, echo: Echo) {
        self.answers += 1;
        match echo {
            Echo::Flight { us } => {
                self.echoes += 1;
                self.sum_us += u64::from(us);
                let (least, most) = self.range_us.unwrap_or((us, us));
                self.range_us = Some((least.min(us), most.max(us)));
            }
            Echo::NoEcho => self.no_echo += 1,
            Echo::PinStuck | Echo::HighAtTrigger => self.pin_stuck += 1,
            Echo::Disabled => self.disabled += 1,
            Echo::Blanked => {}
        }
    }
}

/// True if the nearest measuring sensors on both sides receive echoes of most of their pings.
fn neighbours_have_echoes(sensor: &SensorStatistics, all: &[SensorStatistics]) -> bool {
    let away = |other: &SensorStatistics| (other.bearing_rad - sensor.bearing_rad).rem_euclid(TAU);
    let mut others: Vec<&SensorStatistics> =
        all.iter().filter(|other| other.sensor != sensor.sensor && other.echoes > 0).collect();
    others.sort_by(|a, b| away(a).total_cmp(&away(b)));
    let has_echoes = |other: Option<&&SensorStatistics>| {
        other.is_some_and(|other| other.echoes as f64 > MIN_ECHO_SHARE * other.pings as f64)
    };
    has_echoes(others.first()) && has_echoes(others.last())
}

/// The finding about one sensor, if it has a problem.
fn examine(
    sensor: &SensorStatistics,
    is_stuck: bool,
    neighbours_have_echoes: bool,
    path_m: f64,
    max_range_m: f64,
) -> Option<Finding> {
    let SensorStatistics { sensor: id, pings, answers, echoes, .. } = *sensor;
    if is_stuck || sensor.pin_stuck * 10 > pings {
        let text = format!("sensor {id}: its echo pin is stuck high ({} of {pings} pings)", sensor.pin_stuck);
        let fix =
            format!("check sensor {id}'s echo wire for a short to 5 V, switch its supply off and on, or replace it");
        return Some(Finding::new(Level::Warning, "sensor.pin", text, fix));
    }
    if pings < MIN_PINGS {
        return None;
    }
    if sensor.disabled > 0 && sensor.disabled == answers {
        return Some(Finding {
            id: "sensor.disabled",
            level: Level::Note,
            text: format!("sensor {id} is switched off by the board's settings"),
            fix: None,
        });
    }
    if answers == 0 {
        let text = format!("sensor {id} is dead: it answered none of {pings} pings");
        let fix = format!("check sensor {id}'s plug, supply and trigger wire, or replace it");
        return Some(Finding::new(Level::Warning, "sensor.dead", text, fix));
    }
    if echoes == 0 {
        let text = format!("sensor {id} heard no echo of {pings} pings");
        let fix = format!(
            "hold a book 30 cm in front of sensor {id} while this runs; if it still receives no echo, replace it"
        );
        let level = if neighbours_have_echoes { Level::Warning } else { Level::Note };
        return Some(Finding::new(level, "sensor.no_echo", text, fix));
    }
    if echoes >= MIN_PINGS && f64::from(sensor.least_us) * METRES_PER_US > max_range_m {
        let text = format!("sensor {id} always reads its maximum, beyond {max_range_m} m");
        let fix = format!("clean sensor {id} and look for what covers it, or replace it");
        let level = if neighbours_have_echoes { Level::Warning } else { Level::Note };
        return Some(Finding::new(level, "sensor.maximum", text, fix));
    }
    let is_same = sensor.most_us - sensor.least_us <= STUCK_SPREAD_US;
    if echoes >= MIN_PINGS && is_same && path_m > MIN_PATH_M {
        let text = format!(
            "sensor {id} is stuck at {:.2} m although the robot moved {path_m:.1} m",
            sensor.mean_m.unwrap_or_default()
        );
        let fix = format!("look for a cable or a part of the robot in front of sensor {id}, or replace it");
        return Some(Finding::new(Level::Warning, "sensor.stuck", text, fix));
    }
    None
}
