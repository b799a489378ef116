//! Scores of the fault detector by kind of fault: sensor-seconds, latencies and false alarms, summed
//! over runs.
//!
//! Between two estimates each sensor adds the elapsed time to sums that tell whether it was truly
//! faulty and whether it was declared faulty. So a late detection costs recall for the delay, and a
//! false alarm costs precision for its duration. By kind:
//!
//! - precision: of the time with a declared fault of this kind, the share with a true fault of any kind;
//! - recall: of the time with a true fault of this kind, the share with a declared fault of any kind;
//! - latency: from the fault's onset, or the first estimate if later, to the output of its declaration.

use super::TrueFault;
use serde::Serialize;
use slamd_core::{FaultKind, SensorState, Timestamp};
use std::time::Duration;

/// Sums of one kind.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct KindSums {
    /// Sensor-seconds with a declared fault of this kind.
    pub declared_s: f64,
    /// The part of `declared_s` in which the sensor was truly faulty.
    pub declared_rightly_s: f64,
    /// Sensor-seconds with a true fault of this kind.
    pub true_s: f64,
    /// The part of `true_s` in which the sensor was declared faulty.
    pub found_s: f64,
    /// Number of true faults of this kind.
    pub faults: usize,
    /// Seconds until the declaration, one for each detected fault.
    pub latencies_s: Vec<f64>,
}

/// Sums over all kinds and runs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Detection {
    /// By kind, in the order of [`FaultKind::ALL`].
    pub kinds: [KindSums; 4],
    /// Declarations of healthy sensors.
    pub false_alarms: usize,
    /// Sensor-seconds without a true fault.
    pub healthy_s: f64,
    /// The part of `healthy_s` in which the sensor was declared faulty.
    pub wronged_s: f64,
}

/// The detector's score over a whole run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FaultScore {
    /// Share of the declared sensor-seconds that were truly faulty; `None` without declarations.
    pub fault_precision: Option<f64>,
    /// Share of the truly faulty sensor-seconds that were declared; `None` without faults.
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

    /// False alarms per hour of one healthy sensor; `None` if no sensor was healthy.
    #[must_use]
    pub fn false_alarms_per_hour(&self) -> Option<f64> {
        (self.healthy_s > 0.0).then(|| self.false_alarms as f64 / (self.healthy_s / 3600.0))
    }

    /// Precision over all kinds; `None` without declarations.
    #[must_use]
    pub fn precision(&self) -> Option<f64> {
        share(self.kinds.iter().map(|k| k.declared_rightly_s).sum(), self.kinds.iter().map(|k| k.declared_s).sum())
    }

    /// Recall over all kinds; `None` without faults.
    #[must_use]
    pub fn recall(&self) -> Option<f64> {
        share(self.kinds.iter().map(|k| k.found_s).sum(), self.kinds.iter().map(|k| k.true_s).sum())
    }
}

impl KindSums {
    /// Precision of this kind; `None` without declarations of it.
    #[must_use]
    pub fn precision(&self) -> Option<f64> {
        share(self.declared_rightly_s, self.declared_s)
    }

    /// Recall of this kind; `None` without faults of it.
    #[must_use]
    pub fn recall(&self) -> Option<f64> {
        share(self.found_s, self.true_s)
    }
}

fn share(part_s: f64, of_s: f64) -> Option<f64> {
    (of_s > 0.0).then(|| part_s / of_s)
}

/// Measures the detector in one run.
#[derive(Clone, Debug)]
pub struct FaultMeter {
    truth: Vec<TrueFault>,
    /// Whether each fault of `truth` was detected.
    is_found: Vec<bool>,
    states: Vec<SensorState>,
    first: Option<Timestamp>,
    last: Option<Timestamp>,
    sums: Detection,
}

/// A declaration within this time after a fault's end is late, not false.
const LATE: Duration = Duration::from_secs(2);

impl FaultMeter {
    /// A meter for the true faults of a ring of `sensors`, or more if states of more are added.
    #[must_use]
    pub fn new(sensors: usize, truth: Vec<TrueFault>) -> Self {
        let mut sums = Detection::default();
        for fault in &truth {
            sums.kinds[kind_index(fault.kind)].faults += 1;
        }
        let is_found = vec![false; truth.len()];
        let sensors = truth.iter().map(|fault| fault.sensor + 1).fold(sensors, usize::max);
        Self { truth, is_found, states: vec![SensorState::Healthy; sensors], first: None, last: None, sums }
    }

    /// Adds a change of a sensor's state at the sweep of `at`.
    pub fn state(&mut self, at: Timestamp, sensor: usize, state: SensorState) {
        self.states.resize(self.states.len().max(sensor + 1), SensorState::Healthy);
        let was_healthy = std::mem::replace(&mut self.states[sensor], state) == SensorState::Healthy;
        let lately = |fault: &TrueFault| TrueFault { until: fault.until.map(|until| until + LATE), ..*fault };
        let is_true = self.truth.iter().any(|fault| fault.sensor == sensor && lately(fault).is_on(at));
        if was_healthy && state != SensorState::Healthy && !is_true {
            self.sums.false_alarms += 1;
        }
    }

    /// Adds the estimate of the sweep of `at`, made with the current states and output at `out`.
    pub fn estimate(&mut self, at: Timestamp, out: Timestamp) {
        let first = *self.first.get_or_insert(at);
        let elapsed_s = self.last.map_or(0.0, |last| at.seconds_since(last));
        self.last = Some(at);
        for sensor in 0..self.states.len() {
            let kind = self.true_kind(sensor, at);
            let sums = &mut self.sums;
            match kind {
                Some(kind) => sums.kinds[kind_index(kind)].true_s += elapsed_s,
                None => sums.healthy_s += elapsed_s,
            }
            let SensorState::Faulty(declared) = self.states[sensor] else { continue };
            sums.kinds[kind_index(declared)].declared_s += elapsed_s;
            match kind {
                Some(kind) => {
                    sums.kinds[kind_index(declared)].declared_rightly_s += elapsed_s;
                    sums.kinds[kind_index(kind)].found_s += elapsed_s;
                }
                None => sums.wronged_s += elapsed_s,
            }
        }
        for (fault, is_found) in self.truth.iter().zip(&mut self.is_found) {
            let is_declared = self.states.get(fault.sensor).is_some_and(|state| *state != SensorState::Healthy);
            if !*is_found && fault.is_on(at) && is_declared {
                *is_found = true;
                let latency_s = out.seconds_since(fault.from.max(first)).max(0.0);
                self.sums.kinds[kind_index(fault.kind)].latencies_s.push(latency_s);
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

const fn kind_index(kind: FaultKind) -> usize {
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
    fn the_index_of_a_kind_is_its_position_in_the_list() {
        assert_eq!(FaultKind::ALL.map(kind_index), [0, 1, 2, 3]);
    }

    #[test]
    fn a_late_detection_a_wrong_kind_and_a_false_alarm() {
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
    fn a_declaration_just_after_the_faults_end_is_late_and_not_false() {
        let mut meter = FaultMeter::new(0, vec!["7:missing@10s-20s".parse().unwrap()]);
        for (at_s, alarms) in [(21, 0), (30, 1)] {
            meter.state(s(at_s), 7, SensorState::Faulty(FaultKind::Missing));
            meter.state(s(at_s + 1), 7, SensorState::Healthy);
            assert_eq!(meter.detection().false_alarms, alarms);
        }
    }

    #[test]
    fn without_faults_and_declarations_there_is_no_score() {
        let mut meter = FaultMeter::new(2, Vec::new());
        meter.estimate(s(0), s(0));
        meter.estimate(s(9), s(9));
        let score = FaultScore { fault_precision: None, fault_recall: None };
        assert_eq!(meter.detection().score(), score);
    }

    #[test]
    fn an_undetected_fault_costs_recall_even_without_events_of_its_sensor() {
        let mut meter = FaultMeter::new(0, vec!["7:missing@0s".parse().unwrap()]);
        meter.estimate(s(0), s(0));
        meter.estimate(s(9), s(9));
        assert_eq!(meter.detection().recall(), Some(0.0));
    }

    #[test]
    fn latency_ends_with_the_output_of_the_declaration() {
        let mut meter = FaultMeter::new(1, vec!["0:missing@0s".parse().unwrap()]);
        meter.estimate(s(2), s(12));
        meter.state(s(3), 0, SensorState::Faulty(FaultKind::Missing));
        meter.estimate(s(3), s(12));
        assert_eq!(meter.detection().kinds[1].latencies_s, [10.0]);
    }
}
