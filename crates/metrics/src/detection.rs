//! Scores of the fault detector: sensor-seconds, latencies and false alarms, by kinds of fault, which add up over runs.
//!
//! Between two estimates each sensor adds the time that has passed to its sums, by whether it truly failed and whether it was declared to
//! fail. So a fault found late costs recall for as long as it stayed hidden, and a false alarm costs precision for as long as it lasted.
//! By kind:
//!
//! - precision: of the time for which sensors were declared to fail in this way, the share in which they failed, in whatever way;
//! - recall: of the time for which sensors failed in this way, the share in which they were declared, in whatever way;
//! - latency: from the fault's begin, or the first estimate where that is later, until the verdict is out.

use super::TrueFault;
use serde::Serialize;
use slamd_core::event::{FaultKind, SensorState};
use slamd_core::time::Timestamp;
use std::time::Duration;

/// Sums of one kind.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct KindSums {
    /// Sensor-seconds declared to be of this kind.
    pub declared_s: f64,
    /// Those of them in which the sensor truly failed.
    pub declared_rightly_s: f64,
    /// Sensor-seconds truly of this kind.
    pub true_s: f64,
    /// Those of them in which the sensor was declared to fail.
    pub found_s: f64,
    /// Faults of this kind.
    pub faults: usize,
    /// Seconds until the verdict, one for each fault that was found.
    pub latencies_s: Vec<f64>,
}

/// Sums over all kinds and runs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Detection {
    /// By kind, in the order of [`FaultKind::ALL`].
    pub kinds: [KindSums; 4],
    /// Verdicts on sensors that did not fail.
    pub false_alarms: usize,
    /// Sensor-seconds without a fault.
    pub healthy_s: f64,
    /// Those of them in which the sensor was declared to fail.
    pub wronged_s: f64,
}

/// The detector's score over a whole run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FaultScore {
    /// Share of the declared sensor-seconds that were truly faulty; none where nothing was declared.
    pub fault_precision: Option<f64>,
    /// Share of the truly faulty sensor-seconds that were declared; none where nothing failed.
    pub fault_recall: Option<f64>,
}

impl Detection {
    /// Precision and recall over all kinds.
    #[must_use]
    pub fn score(&self) -> FaultScore {
        FaultScore { fault_precision: self.precision(), fault_recall: self.recall() }
    }

    /// Adds another run.
    pub fn add(&mut self, other: &Self) {
        for (sums, more) in self.kinds.iter_mut().zip(&other.kinds) {
            sums.declared_s += more.declared_s;
            sums.declared_rightly_s += more.declared_rightly_s;
            sums.true_s += more.true_s;
            sums.found_s += more.found_s;
            sums.faults += more.faults;
            sums.latencies_s.extend(&more.latencies_s);
        }
        self.false_alarms += other.false_alarms;
        self.healthy_s += other.healthy_s;
        self.wronged_s += other.wronged_s;
    }

    /// False alarms per healthy sensor and hour; none where no sensor was healthy.
    #[must_use]
    pub fn false_alarms_per_hour(&self) -> Option<f64> {
        (self.healthy_s > 0.0).then(|| self.false_alarms as f64 / (self.healthy_s / 3600.0))
    }

    /// Precision over all kinds; none where nothing was declared.
    #[must_use]
    pub fn precision(&self) -> Option<f64> {
        share(self.kinds.iter().map(|k| k.declared_rightly_s).sum(), self.kinds.iter().map(|k| k.declared_s).sum())
    }

    /// Recall over all kinds; none where nothing failed.
    #[must_use]
    pub fn recall(&self) -> Option<f64> {
        share(self.kinds.iter().map(|k| k.found_s).sum(), self.kinds.iter().map(|k| k.true_s).sum())
    }
}

impl KindSums {
    /// None where nothing was declared to be of this kind.
    #[must_use]
    pub fn precision(&self) -> Option<f64> {
        share(self.declared_rightly_s, self.declared_s)
    }

    /// None where nothing was of this kind.
    #[must_use]
    pub fn recall(&self) -> Option<f64> {
        share(self.found_s, self.true_s)
    }
}

fn share(part_s: f64, of_s: f64) -> Option<f64> {
    (of_s > 0.0).then(|| part_s / of_s)
}

/// Watches one run.
#[derive(Clone, Debug)]
pub struct FaultMeter {
    truth: Vec<TrueFault>,
    /// By fault of `truth`: whether its verdict is out.
    is_found: Vec<bool>,
    states: Vec<SensorState>,
    first: Option<Timestamp>,
    last: Option<Timestamp>,
    sums: Detection,
}

/// A verdict so soon after a fault has passed is late, not false.
const LATE: Duration = Duration::from_secs(2);

impl FaultMeter {
    /// A meter for a ring of `sensors` (more where more are heard of) and what truly fails.
    #[must_use]
    pub fn new(sensors: usize, truth: Vec<TrueFault>) -> Self {
        let mut sums = Detection::default();
        for fault in &truth {
            sums.kinds[place(fault.kind)].faults += 1;
        }
        let is_found = vec![false; truth.len()];
        let sensors = truth.iter().map(|fault| fault.sensor + 1).fold(sensors, usize::max);
        Self { truth, is_found, states: vec![SensorState::Healthy; sensors], first: None, last: None, sums }
    }

    /// A sensor changed its state at the sweep of `at`.
    pub fn state(&mut self, at: Timestamp, sensor: usize, state: SensorState) {
        self.states.resize(self.states.len().max(sensor + 1), SensorState::Healthy);
        let was_healthy = std::mem::replace(&mut self.states[sensor], state) == SensorState::Healthy;
        let lately = |fault: &TrueFault| TrueFault { until: fault.until.map(|until| until + LATE), ..*fault };
        let is_true = self.truth.iter().any(|fault| fault.sensor == sensor && lately(fault).is_on(at));
        if was_healthy && state != SensorState::Healthy && !is_true {
            self.sums.false_alarms += 1;
        }
    }

    /// An estimate was made for the sweep of `at` with the states as they are now, and was out at `out`.
    pub fn estimate(&mut self, at: Timestamp, out: Timestamp) {
        let first = *self.first.get_or_insert(at);
        let elapsed_s = self.last.map_or(0.0, |last| at.seconds_since(last));
        self.last = Some(at);
        for sensor in 0..self.states.len() {
            let kind = self.true_kind(sensor, at);
            let sums = &mut self.sums;
            match kind {
                Some(kind) => sums.kinds[place(kind)].true_s += elapsed_s,
                None => sums.healthy_s += elapsed_s,
            }
            let SensorState::Faulty(declared) = self.states[sensor] else { continue };
            sums.kinds[place(declared)].declared_s += elapsed_s;
            match kind {
                Some(kind) => {
                    sums.kinds[place(declared)].declared_rightly_s += elapsed_s;
                    sums.kinds[place(kind)].found_s += elapsed_s;
                }
                None => sums.wronged_s += elapsed_s,
            }
        }
        for (fault, is_found) in self.truth.iter().zip(&mut self.is_found) {
            let is_declared = self.states.get(fault.sensor).is_some_and(|state| *state != SensorState::Healthy);
            if !*is_found && fault.is_on(at) && is_declared {
                *is_found = true;
                let latency_s = out.seconds_since(fault.from.max(first)).max(0.0);
                self.sums.kinds[place(fault.kind)].latencies_s.push(latency_s);
            }
        }
    }

    /// The sums so far.
    #[must_use]
    pub const fn detection(&self) -> &Detection {
        &self.sums
    }

    fn true_kind(&self, sensor: usize, at: Timestamp) -> Option<FaultKind> {
        self.truth.iter().find(|fault| fault.sensor == sensor && fault.is_on(at)).map(|fault| fault.kind)
    }
}

const fn place(kind: FaultKind) -> usize {
    match kind {
        FaultKind::Saturated => 0,
        FaultKind::Missing => 1,
        FaultKind::Noisy => 2,
        FaultKind::Stuck => 3,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn s(seconds: u64) -> Timestamp {
        Timestamp::from_us(seconds * 1_000_000)
    }

    #[test]
    fn kinds_stand_where_their_order_says() {
        assert_eq!(FaultKind::ALL.map(place), [0, 1, 2, 3]);
    }

    #[test]
    fn a_late_verdict_a_wrong_name_and_a_false_alarm() {
        let truth = vec!["7:stuck@10s".parse().unwrap(), "2:missing@0s".parse().unwrap()];
        let mut meter = FaultMeter::new(8, truth);
        for t in 1..=100 {
            match t {
                31 => meter.state(s(t), 7, SensorState::Faulty(FaultKind::Noisy)),
                51 => meter.state(s(t), 3, SensorState::Faulty(FaultKind::Noisy)),
                61 => meter.state(s(t), 3, SensorState::Healthy),
                _ => {}
            }
            meter.estimate(s(t), s(t));
        }
        let sums = meter.detection();
        let [_, missing, noisy, stuck] = &sums.kinds;
        assert_eq!((stuck.faults, &stuck.latencies_s[..]), (1, &[21.0][..]));
        assert!((stuck.recall().unwrap() - 70.0 / 91.0).abs() < 1e-12 && stuck.precision().is_none());
        assert!((noisy.precision().unwrap() - 70.0 / 80.0).abs() < 1e-12 && noisy.recall().is_none());
        assert_eq!((missing.faults, missing.recall(), missing.latencies_s.len()), (1, Some(0.0), 0));
        assert_eq!(sums.false_alarms, 1);
        assert!((sums.wronged_s - 10.0).abs() < 1e-9);
        let healthy_h = (6.0 * 99.0 + 8.0) / 3600.0;
        assert!((sums.false_alarms_per_hour().unwrap() - 1.0 / healthy_h).abs() < 1e-9);
        let mut twice = sums.clone();
        twice.add(sums);
        assert_eq!((twice.false_alarms, twice.precision(), twice.recall()), (2, sums.precision(), sums.recall()));
    }

    #[test]
    fn a_verdict_just_after_the_fault_has_passed_is_late_and_not_false() {
        let mut meter = FaultMeter::new(0, vec!["7:missing@10s-20s".parse().unwrap()]);
        for (at_s, alarms) in [(21, 0), (30, 1)] {
            meter.state(s(at_s), 7, SensorState::Faulty(FaultKind::Missing));
            meter.state(s(at_s + 1), 7, SensorState::Healthy);
            assert_eq!(meter.detection().false_alarms, alarms);
        }
    }

    #[test]
    fn nothing_declared_and_nothing_wrong_has_no_score() {
        let mut meter = FaultMeter::new(2, Vec::new());
        meter.estimate(s(0), s(0));
        meter.estimate(s(9), s(9));
        let score = FaultScore { fault_precision: None, fault_recall: None };
        assert_eq!(meter.detection().score(), score);
    }

    #[test]
    fn a_fault_that_is_never_found_costs_recall_though_nothing_is_heard_of_its_sensor() {
        let mut meter = FaultMeter::new(0, vec!["7:missing@0s".parse().unwrap()]);
        meter.estimate(s(0), s(0));
        meter.estimate(s(9), s(9));
        assert_eq!(meter.detection().recall(), Some(0.0));
    }

    #[test]
    fn latency_is_counted_until_the_verdict_is_out() {
        let mut meter = FaultMeter::new(1, vec!["0:missing@0s".parse().unwrap()]);
        meter.estimate(s(2), s(12));
        meter.state(s(3), 0, SensorState::Faulty(FaultKind::Missing));
        meter.estimate(s(3), s(12));
        assert_eq!(meter.detection().kinds[1].latencies_s, [10.0]);
    }
}
