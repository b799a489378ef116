//! One sequential test per sensor and kind of fault.
//!
//! Each sweep adds to a log-likelihood ratio per sensor and kind: how much more probable the reading is from a sensor broken in
//! that way than from a healthy one (Wald's sequential probability ratio test, with both sides clamped so that a
//! change is noticed). The evidence is what the board reports, what PCA over three instants leaves unexplained, and what the
//! map expects. A single odd reading is the pose filter's gate's business: it declares no fault.

use crate::event::{Event, FaultEvent, FaultKind, SensorState};
use crate::memory::SensorMemory;
use crate::sweep::{NoMeasurement, Sweep};

/// The evidence gathered against one sensor.
#[derive(Clone, Copy, Debug, Default)]
struct Suspicion {
    saturated: f64,
    missing: f64,
    noisy: f64,
    last_range_m: f64,
    heard_in_row: u32,
    repeats: u32,
    moved_m: f64,
    state: SensorState,
}

/// Watches all sensors.
#[derive(Clone, Debug)]
pub struct Detector {
    sensors: Vec<Suspicion>,
    states: Vec<SensorState>,
    max_range_m: f64,
}

/// Above this a sensor is faulty; below the other it is healthy again.
const CONVICT: f64 = 6.0;
const ACQUIT: f64 = 0.0;
const FLOOR: f64 = -3.0;
const CEILING: f64 = 12.0;

/// A wall squarely in the cone is silent in one healthy reading of twelve, but misses come in rows.
const SILENT_AT_WALL: f64 = 0.6;
const HEARD: f64 = -1.5;
const NO_ANSWER: f64 = 1.5;
const ANSWER: f64 = -2.0;
/// A reading that PCA cannot explain: four of five from a noisy sensor, one of five from a healthy one in clutter.
const JUMP: f64 = 0.9;
const NO_JUMP: f64 = -1.1;
/// Root of the PCA residual from which a reading counts as a jump, metres.
const JUMP_M: f64 = 0.06;
/// Heard beyond a wall that is squarely in the cone: impossible for the nearest surface.
const BEYOND_WALL: f64 = 1.2;
const BEYOND_M: f64 = 0.15;
/// The same value to the micrometre so many times over so much motion is no measurement.
const STUCK_REPEATS: u32 = 25;
const STUCK_MOVED_M: f64 = 0.4;
/// A turning robot's beams sweep over the walls: one radian counts as this many metres.
const TURN_M_PER_RAD: f64 = 0.5;

impl Detector {
    /// A detector for `sensors` sensors that all begin healthy.
    #[must_use]
    pub fn new(sensors: usize, max_range_m: f64) -> Self {
        Self { sensors: vec![Suspicion::default(); sensors], states: vec![SensorState::Healthy; sensors], max_range_m }
    }

    /// Each sensor's state.
    #[must_use]
    pub fn states(&self) -> &[SensorState] {
        &self.states
    }

    /// Takes over what was known of the sensors; each keeps its state until its readings speak against it.
    pub fn restore(&mut self, sensors: &[SensorMemory]) {
        let known = self.sensors.iter_mut().zip(&mut self.states).zip(sensors);
        for ((suspicion, state), SensorMemory { state: remembered }) in known {
            (suspicion.state, *state) = (*remembered, *remembered);
            match remembered {
                SensorState::Faulty(FaultKind::Saturated) => suspicion.saturated = CONVICT,
                SensorState::Faulty(FaultKind::Missing) => suspicion.missing = CONVICT,
                SensorState::Faulty(FaultKind::Noisy) => suspicion.noisy = CONVICT,
                SensorState::Faulty(FaultKind::Stuck) => suspicion.repeats = STUCK_REPEATS,
                SensorState::Healthy => {}
            }
        }
    }

    /// True where the sensor's readings may be used.
    #[must_use]
    pub fn is_trusted(&self, sensor: usize) -> bool {
        self.states.get(sensor) == Some(&SensorState::Healthy)
    }

    /// Weighs one sweep. `residual_m2` is each sensor's mean square outside the first principal component (NaN where
    /// unknown), `expected_m` the range at which a healthy sensor must hear a wall.
    pub fn inspect(
        &mut self,
        sweep: &Sweep,
        residual_m2: &[f64],
        expected_m: impl Fn(usize) -> Option<f64>,
        events: &mut Vec<Event>,
    ) {
        let turned_m = TURN_M_PER_RAD * (sweep.right_m - sweep.left_m).abs() / 0.3;
        let moved_m = 0.5 * (sweep.left_m + sweep.right_m).abs() + turned_m;
        for (sensor, beam) in sweep.beams.iter().enumerate() {
            let Some(suspicion) = self.sensors.get_mut(sensor) else { return };
            if beam.no_measurement == Some(NoMeasurement::Lost) {
                continue;
            }
            let expected = expected_m(sensor).filter(|range_m| *range_m < self.max_range_m - 0.3);
            let residual_m = residual_m2.get(sensor).copied().unwrap_or(f64::NAN).sqrt();
            suspicion.weigh(beam.range_m, residual_m, expected, moved_m);
            let state = suspicion.verdict();
            if state != suspicion.state {
                let reason = suspicion.reason(sensor, state, beam.no_measurement, expected);
                suspicion.state = state;
                self.states[sensor] = state;
                events.push(Event::Fault(FaultEvent { at: sweep.at, sensor, state, reason }));
            }
        }
    }
}

impl Suspicion {
    fn weigh(&mut self, range_m: f64, residual_m: f64, expected_m: Option<f64>, moved_m: f64) {
        let add = |ratio: &mut f64, evidence: f64| *ratio = (*ratio + evidence).clamp(FLOOR, CEILING);
        if range_m.is_nan() {
            self.heard_in_row = 0;
            add(&mut self.missing, NO_ANSWER);
            return;
        }
        add(&mut self.missing, ANSWER);
        self.heard_in_row = if range_m.is_finite() { self.heard_in_row + 1 } else { 0 };
        if range_m.is_infinite() {
            if range_m > 0.0 && expected_m.is_some() {
                add(&mut self.saturated, SILENT_AT_WALL);
            }
            return;
        }
        add(&mut self.saturated, HEARD);
        // Falling silent and being heard again are jumps of V, too, but say nothing of the scatter.
        if residual_m.is_finite() && self.heard_in_row >= 3 {
            add(&mut self.noisy, if residual_m > JUMP_M { JUMP } else { NO_JUMP });
        }
        if expected_m.is_some_and(|expected_m| range_m > expected_m + BEYOND_M) {
            add(&mut self.noisy, BEYOND_WALL);
        }
        let is_same = (range_m - self.last_range_m).abs() < 1e-6;
        (self.repeats, self.moved_m) = if is_same { (self.repeats + 1, self.moved_m + moved_m) } else { (0, 0.0) };
        self.last_range_m = range_m;
    }

    fn verdict(&self) -> SensorState {
        let is_stuck = self.repeats >= STUCK_REPEATS && self.moved_m >= STUCK_MOVED_M;
        let suspects = [
            (FaultKind::Missing, self.missing),
            (FaultKind::Saturated, self.saturated),
            (FaultKind::Noisy, self.noisy),
            (FaultKind::Stuck, if is_stuck { CEILING } else { FLOOR }),
        ];
        if let SensorState::Faulty(kind) = self.state
            && suspects.iter().any(|(suspect, ratio)| *suspect == kind && *ratio > ACQUIT)
        {
            return self.state;
        }
        let worst = suspects.into_iter().max_by(|a, b| a.1.total_cmp(&b.1));
        worst.filter(|(_, ratio)| *ratio >= CONVICT).map_or(SensorState::Healthy, |(kind, _)| SensorState::Faulty(kind))
    }

    fn reason(
        &self,
        sensor: usize,
        state: SensorState,
        no_measurement: Option<NoMeasurement>,
        expected_m: Option<f64>,
    ) -> String {
        match state {
            SensorState::Healthy => format!("sensor {sensor} measures again"),
            SensorState::Faulty(FaultKind::Saturated) => format!(
                "sensor {sensor} hears nothing, again and again, where the map has a wall {:.1} m ahead of it",
                expected_m.unwrap_or(f64::NAN)
            ),
            SensorState::Faulty(FaultKind::Missing) => {
                let why = match no_measurement {
                    Some(NoMeasurement::EchoPinStuck) => "its echo pin is stuck",
                    Some(NoMeasurement::HighAtTrigger) => "its echo pin is high before the trigger",
                    Some(NoMeasurement::Disabled) => "it is switched off on the board",
                    Some(NoMeasurement::Blanked) => "the board blanks it",
                    _ => "it never answers",
                };
                format!("sensor {sensor} gives no measurement: {why}")
            }
            SensorState::Faulty(FaultKind::Noisy) => {
                format!("sensor {sensor} scatters: its readings jump from sweep to sweep as no surface does")
            }
            SensorState::Faulty(FaultKind::Stuck) => {
                format!("sensor {sensor} reads {:.3} m however the robot moves", self.last_range_m)
            }
        }
    }
}
