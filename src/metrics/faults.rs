//! Scores of the fault detector: precision and recall in sensor-seconds, false alarms, and how long each fault stayed hidden.
//!
//! Between two calls each sensor adds the time that has passed to one of four sums: it was truly faulty or not, and it was
//! declared faulty or not. Then
//!
//! precision = truly faulty and declared / declared,  recall = truly faulty and declared / truly faulty.
//!
//! So a fault found late costs recall for as long as it stayed hidden, and a false alarm costs precision for as long as it
//! lasted. Over all kinds, any verdict on a faulty sensor counts ([`FaultMeter::score`]); by kind, only the verdict that names
//! the true kind does ([`FaultMeter::tally`]).

use crate::event::{FaultEvent, FaultKind, SensorState};
use crate::time::Timestamp;
use serde::Serialize;
use std::collections::BTreeMap;
use std::str::FromStr;
use std::time::Duration;

/// A sensor that truly fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TrueFault {
    /// The sensor's id.
    pub sensor: usize,
    /// How it fails.
    pub kind: FaultKind,
    /// When it begins to fail.
    pub from: Timestamp,
    /// When it works again; none for never.
    pub until: Option<Timestamp>,
}

impl TrueFault {
    pub(super) fn is_on(&self, at: Timestamp) -> bool {
        self.from <= at && self.until.is_none_or(|until| at < until)
    }
}

/// A text that is not `SENSOR:KIND@TIME[-TIME]`.
#[derive(Clone, Debug, thiserror::Error, PartialEq, Eq)]
#[error("`{0}` is not SENSOR:KIND@TIME with a KIND of saturated, missing, noisy or stuck, such as 7:saturated@30s")]
pub struct TrueFaultError(String);

impl FromStr for TrueFault {
    type Err = TrueFaultError;

    fn from_str(text: &str) -> Result<Self, TrueFaultError> {
        parse(text).ok_or_else(|| TrueFaultError(text.into()))
    }
}

/// The detector's score over a whole run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FaultScore {
    /// Share of the declared sensor-seconds that were truly faulty; none where nothing was declared.
    pub fault_precision: Option<f64>,
    /// Share of the truly faulty sensor-seconds that were declared; none where nothing failed.
    pub fault_recall: Option<f64>,
}

/// Sensor-seconds of one kind.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tally {
    /// Declared to be of this kind, seconds.
    pub declared_s: f64,
    /// Truly of this kind, seconds.
    pub true_s: f64,
    /// Both, seconds.
    pub both_s: f64,
}

/// Scores states against the true faults as they come in.
#[derive(Clone, Debug)]
pub struct FaultMeter {
    truth: Vec<TrueFault>,
    declared: BTreeMap<usize, FaultKind>,
    last: Option<Timestamp>,
    whole: Tally,
    kinds: BTreeMap<FaultKind, Tally>,
    found: Vec<Option<Timestamp>>,
    false_alarms: u32,
}

/// A verdict so soon after a fault has passed is late, not false.
const LATE: Duration = Duration::from_secs(2);

impl FaultMeter {
    /// Nothing is declared yet.
    #[must_use]
    pub fn new(truth: Vec<TrueFault>) -> Self {
        Self {
            found: vec![None; truth.len()],
            truth,
            declared: BTreeMap::new(),
            last: None,
            whole: Tally::default(),
            kinds: BTreeMap::new(),
            false_alarms: 0,
        }
    }

    /// A sensor changed its state.
    pub fn fault(&mut self, event: &FaultEvent) {
        self.estimate(event.at);
        let sensor = event.sensor;
        let SensorState::Faulty(kind) = event.state else {
            self.declared.remove(&sensor);
            return;
        };
        let is_true = |fault: &TrueFault| {
            let end = fault.until.map(|until| until + LATE);
            fault.sensor == sensor && TrueFault { until: end, ..*fault }.is_on(event.at)
        };
        if self.declared.insert(sensor, kind).is_none() && !self.truth.iter().any(is_true) {
            self.false_alarms += 1;
        }
    }

    /// Time has come to `at` with the states as they are now; an earlier time than before changes nothing.
    pub fn estimate(&mut self, at: Timestamp) {
        let last = self.last.unwrap_or(at);
        if at < last {
            return;
        }
        let elapsed_s = at.seconds_since(last);
        self.last = Some(at);
        for &kind in self.declared.values() {
            self.whole.declared_s += elapsed_s;
            self.kinds.entry(kind).or_default().declared_s += elapsed_s;
        }
        for (fault, found) in self.truth.iter().zip(&mut self.found).filter(|(fault, _)| fault.is_on(at)) {
            let tally = self.kinds.entry(fault.kind).or_default();
            self.whole.true_s += elapsed_s;
            tally.true_s += elapsed_s;
            if let Some(kind) = self.declared.get(&fault.sensor) {
                found.get_or_insert(at);
                self.whole.both_s += elapsed_s;
                tally.both_s += if *kind == fault.kind { elapsed_s } else { 0.0 };
            }
        }
    }

    /// The score so far.
    #[must_use]
    pub fn score(&self) -> FaultScore {
        FaultScore { fault_precision: self.whole.precision(), fault_recall: self.whole.recall() }
    }

    /// The sensor-seconds of one kind so far.
    #[must_use]
    pub fn tally(&self, kind: FaultKind) -> Tally {
        self.kinds.get(&kind).copied().unwrap_or_default()
    }

    /// The sensor-seconds so far, any verdict on a faulty sensor being right.
    #[must_use]
    pub const fn whole(&self) -> Tally {
        self.whole
    }

    /// Healthy sensors that were declared faulty so far, each time they were.
    #[must_use]
    pub const fn false_alarms(&self) -> u32 {
        self.false_alarms
    }

    /// Each true fault and when it was first seen to be declared, of whatever kind.
    pub fn found(&self) -> impl Iterator<Item = (&TrueFault, Option<Timestamp>)> {
        self.truth.iter().zip(self.found.iter().copied())
    }
}

impl Tally {
    /// Share of what was declared that was right; none where nothing was declared.
    #[must_use]
    pub fn precision(&self) -> Option<f64> {
        (self.declared_s > 0.0).then(|| self.both_s / self.declared_s)
    }

    /// Share of what was true that was declared; none where nothing was true.
    #[must_use]
    pub fn recall(&self) -> Option<f64> {
        (self.true_s > 0.0).then(|| self.both_s / self.true_s)
    }
}

impl std::ops::AddAssign for Tally {
    fn add_assign(&mut self, other: Self) {
        self.declared_s += other.declared_s;
        self.true_s += other.true_s;
        self.both_s += other.both_s;
    }
}

fn parse(text: &str) -> Option<TrueFault> {
    let (sensor, rest) = text.split_once(':')?;
    let (word, span) = rest.split_once('@')?;
    let kinds = [FaultKind::Saturated, FaultKind::Missing, FaultKind::Noisy, FaultKind::Stuck];
    let kind = kinds.into_iter().find(|kind| kind.word() == word)?;
    let time = |text: &str| {
        let time_s: f64 = text.strip_suffix('s').unwrap_or(text).parse().ok()?;
        Some(Timestamp::default() + Duration::try_from_secs_f64(time_s).ok()?)
    };
    let (from, until) = match span.split_once('-') {
        Some((from, until)) => (time(from)?, Some(time(until)?)),
        None => (time(span)?, None),
    };
    Some(TrueFault { sensor: sensor.parse().ok()?, kind, from, until })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn s(seconds: u64) -> Timestamp {
        Timestamp::from_us(seconds * 1_000_000)
    }

    fn event(at_s: u64, sensor: usize, state: SensorState) -> FaultEvent {
        FaultEvent { at: s(at_s), sensor, state, reason: String::new() }
    }

    #[test]
    fn schedules_are_read() {
        let fault = TrueFault { sensor: 7, kind: FaultKind::Saturated, from: s(30), until: None };
        assert_eq!("7:saturated@30s".parse(), Ok(fault));
        assert_eq!("7:saturated@30".parse(), Ok(fault));
        assert_eq!("7:saturated@30s-40s".parse(), Ok(TrueFault { until: Some(s(40)), ..fault }));
        for text in ["", "7", "7:saturated", "7:broken@3s", "x:noisy@3s", "7:noisy@-3s", "7:noisy@nan", "7:noisy@3-"] {
            assert!(text.parse::<TrueFault>().is_err(), "{text}");
        }
    }

    #[test]
    fn late_detection_costs_recall_and_a_false_alarm_costs_precision() {
        let mut meter = FaultMeter::new(vec!["7:stuck@10s".parse().unwrap()]);
        for t in 0..=100 {
            match t {
                30 => meter.fault(&event(t, 7, SensorState::Faulty(FaultKind::Noisy))),
                50 => meter.fault(&event(t, 3, SensorState::Faulty(FaultKind::Noisy))),
                60 => meter.fault(&event(t, 3, SensorState::Healthy)),
                _ => {}
            }
            meter.estimate(s(t));
        }
        let score = meter.score();
        assert!((score.fault_recall.unwrap() - 70.0 / 91.0).abs() < 1e-12, "{score:?}");
        assert!((score.fault_precision.unwrap() - 70.0 / 80.0).abs() < 1e-12, "{score:?}");
        assert_eq!(meter.false_alarms(), 1);
        let found: Vec<_> = meter.found().map(|(fault, at)| (fault.sensor, at)).collect();
        assert_eq!(found, [(7, Some(s(30)))]);
        // It was found, but for noisy: a verdict that names another kind is right of neither.
        assert_eq!(meter.tally(FaultKind::Stuck).recall(), Some(0.0));
        assert_eq!(meter.tally(FaultKind::Noisy).precision(), Some(0.0));
    }

    #[test]
    fn a_verdict_just_after_the_fault_has_passed_is_late_and_not_false() {
        let mut meter = FaultMeter::new(vec!["7:missing@10s-20s".parse().unwrap()]);
        meter.fault(&event(21, 7, SensorState::Faulty(FaultKind::Missing)));
        meter.fault(&event(22, 7, SensorState::Healthy));
        assert_eq!(meter.false_alarms(), 0);
        meter.fault(&event(30, 7, SensorState::Faulty(FaultKind::Missing)));
        assert_eq!(meter.false_alarms(), 1);
    }

    #[test]
    fn nothing_declared_and_nothing_wrong_has_no_score() {
        let mut meter = FaultMeter::new(Vec::new());
        meter.estimate(s(0));
        meter.estimate(s(9));
        assert_eq!(meter.score(), FaultScore { fault_precision: None, fault_recall: None });
    }
}
