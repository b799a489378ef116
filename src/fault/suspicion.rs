//! One sensor's trial: a sequential test per kind of fault.
//!
//! Each sweep adds to a log-likelihood ratio per kind: how much more probable the reading is from a sensor broken in that way
//! than from a healthy one (Wald's sequential probability ratio test, with both sides clamped so that a change is noticed).
//! A single odd reading is the pose filter's gate's business: it convicts nobody. A sensor that works again is trusted
//! again, but each relapse makes that twice as slow, and a minute of good conduct undoes one.

use super::neighbours::Seen;
use crate::event::{FaultKind, SensorState};
use crate::sweep::NoMeasurement;

/// What one sweep says of one sensor.
#[derive(Clone, Copy, Debug)]
pub struct Evidence {
    /// The reading, as REP-117.
    pub range_m: f64,
    /// Why there is none.
    pub no_measurement: Option<NoMeasurement>,
    /// Root of what PCA leaves unexplained, metres; NaN where unknown.
    pub residual_m: f64,
    /// Where the map has a wall that a healthy sensor must hear, metres.
    pub map_m: Option<f64>,
    /// The surface on which the neighbours on both sides agree.
    pub neighbours: Option<Seen>,
    /// How far the robot has moved since the last sweep, metres.
    pub moved_m: f64,
}

/// The evidence gathered against one sensor.
#[derive(Clone, Copy, Debug)]
pub struct Suspicion {
    /// By [`FaultKind`], the surest first.
    ratios: [f64; KINDS.len()],
    last_m: f64,
    heard_in_row: u32,
    state: SensorState,
    relapses: f64,
}

/// The kinds, the one that is surest of its evidence first: where two are proven, it names the fault.
const KINDS: [FaultKind; 4] = [FaultKind::Missing, FaultKind::Stuck, FaultKind::Saturated, FaultKind::Noisy];

/// Above this a sensor is faulty; below the other it is healthy again.
const CONVICT: f64 = 6.0;
const ACQUIT: f64 = 0.0;
const FLOOR: f64 = -3.0;
const CEILING: f64 = 12.0;
/// A sensor often convicted has its ceiling raised this many times at most.
const MOST_RELAPSES: f64 = 3.0;
/// Healthy sweeps that undo one relapse.
const FORGIVEN_SWEEPS: f64 = 600.0;

/// Healthy sensors answer, if only that they hear nothing.
const NO_ANSWER: f64 = 3.0;
/// A board that blanks a reading because of crosstalk does so now and then to any sensor.
const BLANKED: f64 = 0.75;
const ANSWER: f64 = -2.0;
/// A wall squarely in the cone is silent in one healthy reading of twelve, but misses come in rows.
const SILENT_AT_WALL: f64 = 0.6;
/// Between two neighbours that hear the same surface it is one in thirty, in rows of up to fifteen.
const SILENT_AMONG_NEIGHBOURS: f64 = 0.4;
/// A sensor that never hears cannot be heard.
const HEARD: f64 = -3.0;
/// A reading that PCA cannot explain: four of five from a noisy sensor, one of five from a healthy one in clutter.
const JUMP: f64 = 0.9;
const NO_JUMP: f64 = -1.1;
/// Root of the PCA residual from which a reading counts as a jump, metres.
const JUMP_M: f64 = 0.06;
/// Heard beyond a wall that is squarely in the cone: impossible for the nearest surface.
const BEYOND_WALL: f64 = 1.2;
const BEYOND_NEIGHBOURS: f64 = 0.5;
const BEYOND_M: f64 = 0.2;
/// The same value, less than the echo's clock can tell, once more while the robot moves.
const REPEATED: f64 = 0.35;
const CHANGED: f64 = -6.0;
const SAME_M: f64 = 4e-4;
/// What a robot hears that has moved less is not new, metres.
const MOVED_M: f64 = 0.012;

impl Default for Suspicion {
    fn default() -> Self {
        Self {
            ratios: [0.0; KINDS.len()],
            last_m: f64::NAN,
            heard_in_row: 0,
            state: SensorState::Healthy,
            relapses: 0.0,
        }
    }
}

impl Suspicion {
    /// Adds one sweep's evidence.
    pub fn weigh(&mut self, evidence: &Evidence) {
        let range_m = evidence.range_m;
        if range_m.is_nan() {
            self.heard_in_row = 0;
            let is_blanked = evidence.no_measurement == Some(NoMeasurement::Blanked);
            self.add(FaultKind::Missing, if is_blanked { BLANKED } else { NO_ANSWER });
            return;
        }
        self.add(FaultKind::Missing, ANSWER);
        let novelty = (evidence.moved_m / MOVED_M).min(1.0);
        if range_m.is_infinite() {
            self.heard_in_row = 0;
            if range_m > 0.0 {
                let by_map = if evidence.map_m.is_some() { SILENT_AT_WALL } else { 0.0 };
                let by_neighbours = if evidence.neighbours.is_some() { SILENT_AMONG_NEIGHBOURS } else { 0.0 };
                self.add(FaultKind::Saturated, novelty * (by_map + by_neighbours));
            }
            return;
        }
        self.add(FaultKind::Saturated, HEARD);
        self.heard_in_row += 1;
        let is_same = (range_m - self.last_m).abs() < SAME_M;
        self.last_m = range_m;
        self.add(FaultKind::Stuck, if is_same { novelty * REPEATED } else { CHANGED });
        if !is_same {
            self.weigh_scatter(evidence);
        }
    }

    /// A reading that is new: does it scatter?
    fn weigh_scatter(&mut self, evidence: &Evidence) {
        // Falling silent and being heard again are jumps of V, too, but say nothing of the scatter.
        if evidence.residual_m.is_finite() && self.heard_in_row >= 3 {
            self.add(FaultKind::Noisy, if evidence.residual_m > JUMP_M { JUMP } else { NO_JUMP });
        }
        let is_beyond = |wall_m: f64| evidence.range_m > wall_m + BEYOND_M;
        if evidence.map_m.is_some_and(is_beyond) {
            self.add(FaultKind::Noisy, BEYOND_WALL);
        }
        if evidence.neighbours.is_some_and(|seen| is_beyond(seen.range_m)) {
            self.add(FaultKind::Noisy, BEYOND_NEIGHBOURS);
        }
    }

    fn add(&mut self, kind: FaultKind, evidence: f64) {
        let ceiling =
            if self.state == SensorState::Faulty(kind) { CEILING * libm::exp2(self.relapses - 1.0) } else { CEILING };
        let ratio = &mut self.ratios[place(kind)];
        *ratio = (*ratio + evidence).clamp(FLOOR, ceiling);
    }

    /// The sensor's state after what has been weighed.
    pub fn verdict(&mut self) -> SensorState {
        let proven = KINDS.into_iter().find(|&kind| self.ratios[place(kind)] >= CONVICT);
        self.state = match (self.state, proven) {
            (SensorState::Healthy, Some(kind)) => {
                self.relapses = (self.relapses + 1.0).min(MOST_RELAPSES);
                SensorState::Faulty(kind)
            }
            (SensorState::Healthy, None) => {
                self.relapses = (self.relapses - 1.0 / FORGIVEN_SWEEPS).max(0.0);
                SensorState::Healthy
            }
            (SensorState::Faulty(kind), Some(surer)) if place(surer) < place(kind) => SensorState::Faulty(surer),
            (SensorState::Faulty(kind), _) if self.ratios[place(kind)] > ACQUIT => SensorState::Faulty(kind),
            (SensorState::Faulty(_), proven) => proven.map_or(SensorState::Healthy, SensorState::Faulty),
        };
        self.state
    }

    /// Why the state is what it is, in words.
    #[must_use]
    pub fn reason(&self, sensor: usize, evidence: &Evidence) -> String {
        match self.state {
            SensorState::Healthy => format!("sensor {sensor} measures again"),
            SensorState::Faulty(FaultKind::Saturated) => match (evidence.map_m, evidence.neighbours) {
                (Some(wall_m), None) => {
                    format!("sensor {sensor} hears nothing, again and again, where the map has a wall at {wall_m:.1} m")
                }
                (_, Some(seen)) => format!(
                    "sensor {sensor} hears nothing, again and again, where {} neighbours see a wall at {:.1} m",
                    number(seen.witnesses),
                    seen.range_m
                ),
                (None, None) => format!("sensor {sensor} hears nothing, again and again, where there are walls"),
            },
            SensorState::Faulty(FaultKind::Missing) => {
                let why = match evidence.no_measurement {
                    Some(NoMeasurement::EchoPinStuck) => "its echo pin is stuck",
                    Some(NoMeasurement::HighAtTrigger) => "its echo pin is high before the trigger",
                    Some(NoMeasurement::Disabled) => "it is switched off on the board",
                    Some(NoMeasurement::Blanked) => "the board blanks it",
                    _ => "it never answers",
                };
                format!("sensor {sensor} gives no measurement: {why}")
            }
            SensorState::Faulty(FaultKind::Noisy) => {
                let against = match (evidence.map_m, evidence.neighbours) {
                    (_, Some(seen)) if evidence.range_m > seen.range_m + BEYOND_M => {
                        format!("{} neighbours see a wall at {:.1} m", number(seen.witnesses), seen.range_m)
                    }
                    (Some(wall_m), _) if evidence.range_m > wall_m + BEYOND_M => {
                        format!("the map has a wall at {wall_m:.1} m")
                    }
                    _ => "its readings jump from sweep to sweep as no surface does".into(),
                };
                format!("sensor {sensor} scatters: it reads {:.1} m, and {against}", evidence.range_m)
            }
            SensorState::Faulty(FaultKind::Stuck) => {
                format!("sensor {sensor} reads {:.3} m however the robot moves", self.last_m)
            }
        }
    }
}

fn place(kind: FaultKind) -> usize {
    match kind {
        FaultKind::Missing => 0,
        FaultKind::Stuck => 1,
        FaultKind::Saturated => 2,
        FaultKind::Noisy => 3,
    }
}

/// A small number in words.
fn number(count: usize) -> String {
    const WORDS: [&str; 7] = ["no", "one", "two", "three", "four", "five", "six"];
    WORDS.get(count).map_or_else(|| count.to_string(), ToString::to_string)
}
