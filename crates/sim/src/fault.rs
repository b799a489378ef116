//! Faults of sensors: which sensor, which kind and when.
//!
//! How each kind is simulated:
//!
//! - saturated: the sensor always reports "no echo";
//! - missing: the sensor is in no message;
//! - noisy: each reading has a random error of 20 to 80 cm;
//! - stuck: the sensor repeats its last distance before the fault, or the first one after it if there is none.

use super::random::Random;
use super::sonar::{MAX_RANGE_M, MIN_RANGE_M};
use slamd_core::FaultKind;
use std::str::FromStr;

/// One fault of one sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorFault {
    /// The sensor's id.
    pub sensor: u8,
    /// The kind of fault.
    pub kind: FaultKind,
    /// Start of the fault, seconds from the session's start.
    pub from_s: f64,
    /// End of the fault, seconds from the session's start. Infinite: the fault is permanent.
    pub until_s: f64,
}

impl FromStr for SensorFault {
    type Err = String;

    /// Parses `SENSOR:KIND`, `SENSOR:KIND@SECONDS` or `SENSOR:KIND@SECONDS-SECONDS`, for example
    /// `7:saturated@30s-40s`. The `s` is optional.
    fn from_str(text: &str) -> Result<Self, String> {
        let malformed = || format!("fault \"{text}\" is not SENSOR:KIND@TIME, for example 7:saturated@30s");
        let (sensor, rest) = text.split_once(':').ok_or_else(malformed)?;
        let (kind, span) = rest.split_once('@').unwrap_or((rest, "0"));
        let (from, until) = span.split_once('-').map_or((span, None), |(from, until)| (from, Some(until)));
        let seconds = |time: &str| {
            let parsed =
                time.strip_suffix('s').unwrap_or(time).parse().ok().filter(|s: &f64| s.is_finite() && *s >= 0.0);
            parsed.ok_or_else(|| format!("fault \"{text}\": \"{time}\" is not a time in seconds, for example 30s"))
        };
        Ok(Self {
            sensor: sensor
                .parse()
                .map_err(|_| format!("fault \"{text}\": \"{sensor}\" is not a sensor's number, for example 7"))?,
            kind: kind.parse().map_err(|error| format!("fault \"{text}\": {error}"))?,
            from_s: seconds(from)?,
            until_s: until.map_or(Ok(f64::INFINITY), seconds)?,
        })
    }
}

/// Writes the form that [`SensorFault::from_str`] parses.
impl std::fmt::Display for SensorFault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}:{}@{}s", self.sensor, self.kind.word(), self.from_s)?;
        if self.until_s.is_finite() { write!(f, "-{}s", self.until_s) } else { Ok(()) }
    }
}

/// A named mix of faults.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FaultMix {
    /// Every sensor is healthy.
    #[default]
    None,
    /// The paper's test: of n sensors, n/16 are saturated, n/16 missing and n/8 noisy from the
    /// start (2, 2 and 4 of 32).
    Paper,
    /// Each kind on n/16 of n sensors (at least one), all from [`LATE_S`] on. Before, the detector
    /// sees healthy sensors.
    Late,
}

/// When the faults of [`FaultMix::Late`] begin, seconds.
pub const LATE_S: f64 = 60.0;

impl FromStr for FaultMix {
    type Err = String;

    fn from_str(word: &str) -> Result<Self, String> {
        match word {
            "none" => Ok(Self::None),
            "paper" => Ok(Self::Paper),
            "late" => Ok(Self::Late),
            _ => Err(format!("unknown fault mix \"{word}\": it is none, paper or late")),
        }
    }
}

impl FaultMix {
    /// The word used on the command line.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Paper => "paper",
            Self::Late => "late",
        }
    }

    /// The faults for a ring of `sensors`, in order of sensor ids. `random` selects the sensors.
    pub fn faults(self, sensors: u8, random: &mut Random) -> Vec<SensorFault> {
        let kinds = match self {
            Self::None => Vec::new(),
            Self::Paper => {
                let (few, more) = (usize::from(sensors / 16), usize::from(sensors / 8));
                [vec![FaultKind::Saturated; few], vec![FaultKind::Missing; few], vec![FaultKind::Noisy; more]].concat()
            }
            Self::Late => {
                let each = usize::from(sensors / 16).max(1);
                FaultKind::ALL.map(|kind| vec![kind; each]).concat()
            }
        };
        let from_s = if self == Self::Late { LATE_S } else { 0.0 };
        let mut healthy: Vec<u8> = (0..sensors).collect();
        let mut faults: Vec<SensorFault> = kinds
            .into_iter()
            .take(usize::from(sensors))
            .map(|kind| SensorFault {
                sensor: healthy.swap_remove(random.below(healthy.len())),
                kind,
                from_s,
                until_s: f64::INFINITY,
            })
            .collect();
        faults.sort_by_key(|fault| fault.sensor);
        faults
    }
}

/// The result of one ping.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reading {
    /// A distance, metres.
    Range(f64),
    /// No echo within range.
    NoEcho,
    /// The sensor does not answer at all.
    Missing,
}

/// Applies the scheduled faults to healthy readings.
#[derive(Clone, Debug)]
pub struct Faults {
    schedule: Vec<SensorFault>,
    /// The last distance of each sensor. A stuck sensor repeats it.
    last_m: Vec<Option<f64>>,
    random: Random,
}

impl Faults {
    /// Faults for a ring of `sensors`. If two overlap on one sensor, the one that began last counts.
    #[must_use]
    pub fn new(schedule: Vec<SensorFault>, sensors: u8, random: Random) -> Self {
        Self { schedule, last_m: vec![None; usize::from(sensors)], random }
    }

    /// Every fault of the session.
    #[must_use]
    pub fn schedule(&self) -> &[SensorFault] {
        &self.schedule
    }

    /// The result of `sensor` at `at_s` seconds, given its healthy reading `read_m` (`None`: no echo).
    pub fn apply(&mut self, sensor: u8, at_s: f64, read_m: Option<f64>) -> Reading {
        let is_on = |fault: &&SensorFault| fault.sensor == sensor && fault.from_s <= at_s && at_s < fault.until_s;
        let begun = self.schedule.iter().filter(is_on);
        let kind = begun.max_by(|a, b| a.from_s.total_cmp(&b.from_s)).map(|fault| fault.kind);
        let given_m = match kind {
            None => read_m,
            Some(FaultKind::Saturated) => None,
            Some(FaultKind::Missing) => return Reading::Missing,
            Some(FaultKind::Noisy) => Some(self.noisy(read_m)),
            Some(FaultKind::Stuck) => self.last_m.get(usize::from(sensor)).copied().flatten().or(read_m),
        };
        if let (Some(last_m), Some(given_m)) = (self.last_m.get_mut(usize::from(sensor)), given_m) {
            *last_m = Some(given_m);
        }
        given_m.map_or(Reading::NoEcho, Reading::Range)
    }

    fn noisy(&mut self, read_m: Option<f64>) -> f64 {
        match read_m {
            Some(read_m) => {
                let off_m = self.random.sign() * self.random.uniform(0.2, 0.8);
                (read_m + off_m).clamp(MIN_RANGE_M, MAX_RANGE_M)
            }
            None => self.random.uniform(0.5, MAX_RANGE_M),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    fn faults(texts: &[&str]) -> Faults {
        let schedule = texts.iter().map(|text| text.parse().unwrap()).collect();
        Faults::new(schedule, 8, Random::new(1, Stream::Fault))
    }

    #[test]
    fn the_form_of_the_command_line_is_parsed() {
        let fault = |kind, from_s| Ok(SensorFault { sensor: 7, kind, from_s, until_s: f64::INFINITY });
        assert_eq!("7:saturated@30s".parse(), fault(FaultKind::Saturated, 30.0));
        assert_eq!("7:stuck@2.5".parse(), fault(FaultKind::Stuck, 2.5));
        assert_eq!("7:missing".parse(), fault(FaultKind::Missing, 0.0));
        let temporary: SensorFault = "7:noisy@3s-4.5s".parse().unwrap();
        assert_eq!(
            (temporary.from_s, temporary.until_s, temporary.to_string().as_str()),
            (3.0, 4.5, "7:noisy@3s-4.5s")
        );
    }

    #[test]
    fn errors_say_what_is_wrong() {
        let error = |text: &str| text.parse::<SensorFault>().unwrap_err();
        assert_eq!(error("seven"), "fault \"seven\" is not SENSOR:KIND@TIME, for example 7:saturated@30s");
        assert!(error("x:noisy").contains("\"x\" is not a sensor's number"));
        assert!(error("7:odd").contains("unknown fault kind \"odd\": it is saturated, missing, noisy or stuck"));
        assert!(error("7:noisy@soon").contains("\"soon\" is not a time in seconds"));
        assert!(error("7:noisy@-1").contains("not a time"));
    }

    #[test]
    fn the_papers_mix_hits_a_quarter_of_the_sensors_once_each() {
        for (sensors, counts) in [(32, [2, 2, 4]), (16, [1, 1, 2]), (24, [1, 1, 3]), (8, [0, 0, 1])] {
            let faults = FaultMix::Paper.faults(sensors, &mut Random::new(9, Stream::Fault));
            let count = |kind| faults.iter().filter(|fault| fault.kind == kind).count();
            assert_eq!([FaultKind::Saturated, FaultKind::Missing, FaultKind::Noisy].map(count), counts);
            assert!(faults.windows(2).all(|pair| pair[0].sensor < pair[1].sensor));
        }
    }

    #[test]
    fn each_kind_changes_readings_as_stated() {
        let mut faults = faults(&["0:saturated@5", "1:missing", "2:noisy", "3:stuck@5"]);
        assert_eq!(faults.apply(0, 4.9, Some(1.0)), Reading::Range(1.0));
        assert_eq!(faults.apply(0, 5.0, Some(1.0)), Reading::NoEcho);
        assert_eq!(faults.apply(1, 0.0, Some(1.0)), Reading::Missing);
        for _ in 0..100 {
            let Reading::Range(range_m) = faults.apply(2, 0.0, Some(1.5)) else { panic!("no range") };
            assert!((0.2..=0.8).contains(&(range_m - 1.5).abs()));
            let Reading::Range(range_m) = faults.apply(2, 0.0, None) else { panic!("no range") };
            assert!((0.5..=3.0).contains(&range_m));
        }
        assert_eq!(faults.apply(3, 4.0, Some(1.2)), Reading::Range(1.2));
        assert_eq!(faults.apply(3, 4.9, None), Reading::NoEcho);
        assert_eq!(faults.apply(3, 6.0, Some(2.0)), Reading::Range(1.2));
        assert_eq!(faults.apply(3, 7.0, None), Reading::Range(1.2));
        assert_eq!(faults.apply(4, 7.0, Some(0.4)), Reading::Range(0.4));
    }

    #[test]
    fn a_sensor_is_healthy_after_a_temporary_fault() {
        let mut faults = faults(&["0:saturated@5-6", "0:missing@8-9"]);
        let mut at = |at_s| faults.apply(0, at_s, Some(1.0));
        assert_eq!([4.9, 5.0, 6.0, 8.5, 9.0].map(&mut at), {
            let healthy = Reading::Range(1.0);
            [healthy, Reading::NoEcho, healthy, Reading::Missing, healthy]
        });
    }
}
