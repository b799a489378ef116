//! The paper's fault detector: chained MSPE over nine instants, then a threshold.
//!
//! Three instants make a block; each block's MSPE (equation 4) influences the next, and so does each sensor's share q_i of it:
//! `MSPE ← λ MSPE(previous) + (1 − λ) MSPE`, λ = 0.5. From the third block (nine instants) on, an MSPE above its threshold says
//! that some sensor is wrong and q_i above its own says which; that sensor's readings are ignored for
//! [`Params::ignored_sweeps`], renewed by every further verdict. While ignored it has no weight in the first component.
//!
//! The thresholds are tuned on simulated sweeps with 2 cm of range noise: healthy sensors then have q ≈ σ² / 6 = 0.7 cm² and
//! MSPE ≈ 0.6 cm²; 20 cm of noise have q ≈ 70 cm².
//!
//! **Two additions.** [`pca`](slamd_core::stages::PcaBlock) cannot see a row that never changes, so a sensor without a single measurement in nine
//! instants is declared missing, and one that reads the same distance nine times while the robot moves is declared stuck.
//!
//! **What it cannot see.** A sensor that always saturates is such a row, too, and silence in an open room is healthy: only
//! the *change* to silence is noticed, and forgotten [`Params::ignored_sweeps`] later. A *single* wild sensor is itself the
//! first component and has no residual either; of several, all are found. And healthy sonars jump whenever the nearest
//! reflector in their cone changes, which three instants cannot tell from noise: expect one healthy sensor in four or five to be
//! ignored among furniture.

use crate::params::Params;
use slamd_core::{
    Beam, Event, FaultEvent, FaultKind, Pose2, SensorState, Sweep, Timestamp,
    stages::{INSTANTS, PcaBlock},
};

/// The recent readings of one sensor.
#[derive(Clone, Debug, Default)]
struct Record {
    /// Chained q_i, square metres.
    residual_m2: f64,
    /// Consecutive sweeps without a measurement.
    missing: u64,
    /// Consecutive sweeps with nothing in range.
    silent: u64,
    /// Consecutive sweeps with the same distance.
    same: u64,
    same_range_m: f64,
    /// Odometry where that distance was first read.
    same_since: Pose2,
    /// True where the robot has moved since.
    moved: bool,
    /// Sweeps until it is used again.
    ignored: u64,
}

/// The detector.
#[derive(Clone, Debug)]
pub struct PaperDetector {
    params: Params,
    block: PcaBlock,
    sweeps: u64,
    mspe_m2: Option<f64>,
    records: Vec<Record>,
    states: Vec<SensorState>,
}

impl PaperDetector {
    /// A detector for `sensors` sensors that saturate at `max_range_m`; all are healthy until proven otherwise.
    #[must_use]
    pub fn new(sensors: usize, max_range_m: f64, params: Params) -> Self {
        Self {
            params,
            block: PcaBlock::new(sensors, max_range_m),
            sweeps: 0,
            mspe_m2: None,
            records: vec![Record::default(); sensors],
            states: vec![SensorState::Healthy; sensors],
        }
    }

    /// Root of a sensor's chained residual q_i, metres.
    #[must_use]
    pub fn residual_m(&self, sensor: usize) -> f64 {
        self.records.get(sensor).map_or(f64::NAN, |record| record.residual_m2.sqrt())
    }

    /// Takes the next sweep and pushes an [`Event::Fault`] for each sensor whose state it changes.
    pub fn inspect(&mut self, sweep: &Sweep, events: &mut Vec<Event>) {
        self.sweeps += 1;
        for (sensor, record) in self.records.iter_mut().enumerate() {
            record.hear(sweep.beams.get(sensor), sweep.odometry, &self.params);
            record.ignored = record.ignored.saturating_sub(1);
        }
        self.block.push(sweep);
        let whole_block = self.sweeps.is_multiple_of(INSTANTS as u64);
        if whole_block {
            self.chain();
        }
        for sensor in 0..self.records.len() {
            let verdict = self.verdict(&self.records[sensor], whole_block);
            self.apply(sensor, verdict, sweep.at, events);
        }
    }

    /// The state of each sensor.
    #[must_use]
    pub fn states(&self) -> &[SensorState] {
        &self.states
    }

    /// The chained MSPE (equation 4), square metres; none before the first block.
    #[must_use]
    pub fn mspe_m2(&self) -> Option<f64> {
        self.mspe_m2
    }

    /// Equation 4 for this block, mixed with the blocks before.
    fn chain(&mut self) {
        let records = &self.records;
        let mspe = self.block.analyse(|sensor, _| f64::from(u8::from(records[sensor].ignored == 0)));
        let chain = self.params.chain;
        let mix = |old: f64, new: f64| chain * old + (1.0 - chain) * new;
        let first = self.mspe_m2.is_none();
        self.mspe_m2 = Some(self.mspe_m2.map_or(mspe, |old| mix(old, mspe)));
        for (record, &q) in self.records.iter_mut().zip(self.block.residuals_m2()) {
            record.residual_m2 = if first { q } else { mix(record.residual_m2, q) };
        }
    }

    /// The fault found at this sweep.
    fn verdict(&self, record: &Record, whole_block: bool) -> Option<FaultKind> {
        if self.sweeps < self.params.first_verdict_sweeps {
            return None;
        }
        if record.missing >= self.params.first_verdict_sweeps {
            return Some(FaultKind::Missing);
        }
        if record.same >= self.params.first_verdict_sweeps && record.moved {
            return Some(FaultKind::Stuck);
        }
        let anomaly = self.mspe_m2.is_some_and(|mspe| mspe > self.params.mspe_limit_m2);
        if !(whole_block && anomaly && record.residual_m2 > self.params.residual_limit_m2) {
            return None;
        }
        Some(if record.silent >= INSTANTS as u64 {
            FaultKind::Saturated
        } else if record.missing >= INSTANTS as u64 {
            FaultKind::Missing
        } else {
            FaultKind::Noisy
        })
    }

    /// Starts, renews or ends the time for which the sensor is ignored.
    fn apply(&mut self, sensor: usize, verdict: Option<FaultKind>, at: Timestamp, events: &mut Vec<Event>) {
        let record = &mut self.records[sensor];
        let state = match verdict {
            Some(kind) => {
                record.ignored = self.params.ignored_sweeps;
                SensorState::Faulty(kind)
            }
            None if record.ignored == 0 => SensorState::Healthy,
            None => return,
        };
        if self.states[sensor] != state {
            self.states[sensor] = state;
            let reason = record.reason(verdict, &self.params);
            events.push(Event::Fault(FaultEvent { at, sensor, state, reason }));
        }
    }
}

impl Record {
    fn hear(&mut self, beam: Option<&Beam>, odometry: Pose2, params: &Params) {
        let range_m = beam.map_or(f64::NAN, |beam| beam.range_m);
        self.missing = if range_m.is_nan() { self.missing + 1 } else { 0 };
        self.silent = if beam.is_some_and(Beam::is_clear) { self.silent + 1 } else { 0 };
        if !range_m.is_finite() {
            self.same = 0;
        } else if self.same > 0 && (range_m - self.same_range_m).abs() < params.same_m {
            self.same += 1;
            let moved = self.same_since.inverse() * odometry;
            self.moved |= moved.position().coords.norm() > params.moved || moved.theta_rad.abs() > params.moved;
        } else {
            (self.same, self.same_range_m, self.same_since, self.moved) = (1, range_m, odometry, false);
        }
    }

    /// The verdict in words.
    fn reason(&self, verdict: Option<FaultKind>, params: &Params) -> String {
        let outside = format!("{:.0} cm outside the common motion over nine instants", 100.0 * self.residual_m2.sqrt());
        match verdict {
            None => format!("no fault seen for {} sweeps", params.ignored_sweeps),
            Some(FaultKind::Stuck) => {
                format!("read {:.3} m {} times while the robot moved", self.same_range_m, self.same)
            }
            Some(FaultKind::Missing) if self.missing >= params.first_verdict_sweeps => {
                format!("no measurement in {} sweeps", self.missing)
            }
            Some(FaultKind::Missing) => format!("stopped measuring: {outside}"),
            Some(FaultKind::Saturated) => format!("fell silent: {outside}"),
            Some(FaultKind::Noisy) => outside,
        }
    }
}
