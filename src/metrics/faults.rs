//! Precision and recall of the fault detector, in sensor-seconds.
//!
//! From the first estimate to the last, each sensor adds the time between two estimates to one of four sums: it was truly
//! faulty or not, and its state at the end of that time was faulty or not, of whatever kind. Then
//!
//! precision = truly faulty and declared / declared,  recall = truly faulty and declared / truly faulty.
//!
//! So a fault found late costs recall for as long as it stayed hidden, and a false alarm costs precision for as long as it
//! lasted.

use crate::event::{FaultKind, SensorState};
use crate::time::Timestamp;
use serde::Serialize;
use std::collections::BTreeSet;
use std::str::FromStr;

/// A sensor that truly fails, from a given time to the end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TrueFault {
    /// The sensor's id.
    pub sensor: usize,
    /// How it fails.
    pub kind: FaultKind,
    /// When it begins to fail.
    pub from: Timestamp,
}

/// A text that is not `SENSOR:KIND@TIME`.
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

/// Scores states against the true faults as they come in.
#[derive(Clone, Debug)]
pub struct FaultMeter {
    truth: Vec<TrueFault>,
    declared: BTreeSet<usize>,
    last: Option<Timestamp>,
    declared_s: f64,
    true_s: f64,
    both_s: f64,
}

impl FaultMeter {
    /// Nothing is declared yet.
    #[must_use]
    pub const fn new(truth: Vec<TrueFault>) -> Self {
        Self { truth, declared: BTreeSet::new(), last: None, declared_s: 0.0, true_s: 0.0, both_s: 0.0 }
    }

    /// A sensor changed its state.
    pub fn state(&mut self, sensor: usize, state: SensorState) {
        match state {
            SensorState::Healthy => self.declared.remove(&sensor),
            SensorState::Faulty(_) => self.declared.insert(sensor),
        };
    }

    /// An estimate was made at `at` with the states as they are now.
    pub fn estimate(&mut self, at: Timestamp) {
        let elapsed_s = self.last.map_or(0.0, |last| at.seconds_since(last));
        self.last = Some(at);
        let faulty: BTreeSet<usize> =
            self.truth.iter().filter(|fault| fault.from <= at).map(|fault| fault.sensor).collect();
        self.declared_s += elapsed_s * self.declared.len() as f64;
        self.true_s += elapsed_s * faulty.len() as f64;
        self.both_s += elapsed_s * self.declared.intersection(&faulty).count() as f64;
    }

    /// The score so far.
    #[must_use]
    pub fn score(&self) -> FaultScore {
        let share = |of_s: f64| (of_s > 0.0).then(|| self.both_s / of_s);
        FaultScore { fault_precision: share(self.declared_s), fault_recall: share(self.true_s) }
    }
}

fn parse(text: &str) -> Option<TrueFault> {
    let (sensor, rest) = text.split_once(':')?;
    let (word, time) = rest.split_once('@')?;
    let kinds = [FaultKind::Saturated, FaultKind::Missing, FaultKind::Noisy, FaultKind::Stuck];
    let kind = kinds.into_iter().find(|kind| kind.word() == word)?;
    let time_s: f64 = time.strip_suffix('s').unwrap_or(time).parse().ok()?;
    let from = std::time::Duration::try_from_secs_f64(time_s).ok()?;
    Some(TrueFault { sensor: sensor.parse().ok()?, kind, from: Timestamp::default() + from })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn s(seconds: u64) -> Timestamp {
        Timestamp::from_us(seconds * 1_000_000)
    }

    #[test]
    fn schedules_are_read() {
        let fault = TrueFault { sensor: 7, kind: FaultKind::Saturated, from: s(30) };
        assert_eq!("7:saturated@30s".parse(), Ok(fault));
        assert_eq!("7:saturated@30".parse(), Ok(fault));
        for text in ["", "7", "7:saturated", "7:broken@3s", "x:noisy@3s", "7:noisy@-3s", "7:noisy@nan"] {
            assert!(text.parse::<TrueFault>().is_err(), "{text}");
        }
    }

    #[test]
    fn late_detection_costs_recall_and_a_false_alarm_costs_precision() {
        let mut meter = FaultMeter::new(vec!["7:stuck@10s".parse().unwrap()]);
        for t in 0..=100 {
            match t {
                31 => meter.state(7, SensorState::Faulty(FaultKind::Noisy)),
                51 => meter.state(3, SensorState::Faulty(FaultKind::Noisy)),
                61 => meter.state(3, SensorState::Healthy),
                _ => {}
            }
            meter.estimate(s(t));
        }
        let score = meter.score();
        assert!((score.fault_recall.unwrap() - 70.0 / 91.0).abs() < 1e-12, "{score:?}");
        assert!((score.fault_precision.unwrap() - 70.0 / 80.0).abs() < 1e-12, "{score:?}");
    }

    #[test]
    fn nothing_declared_and_nothing_wrong_has_no_score() {
        let mut meter = FaultMeter::new(Vec::new());
        meter.estimate(s(0));
        meter.estimate(s(9));
        assert_eq!(meter.score(), FaultScore { fault_precision: None, fault_recall: None });
    }
}
