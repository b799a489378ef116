//! One sensor's trial: a sequential test per kind of fault.
//!
//! Each sweep adds to a log-likelihood ratio per kind: how much more probable the reading is from a sensor broken in that way
//! than from a healthy one (Wald's sequential probability ratio test, with both sides clamped so that a change is noticed).
//! A single odd reading is the pose filter's gate's business: it convicts nobody. A sensor that works again is trusted
//! again, but each relapse makes that twice as slow, and a minute of good conduct undoes one.

use super::neighbours::Seen;
use crate::event::{FaultKind, SensorState};
use crate::memory::{Impossible, SensorMemory};
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
    /// How far the point the sensor looks at has moved across its beam since then, metres.
    pub passed_m: f64,
}

/// The evidence gathered against one sensor.
#[derive(Clone, Copy, Debug)]
pub struct Suspicion {
    /// By [`FaultKind`], the surest first.
    ratios: [f64; KINDS.len()],
    last_m: f64,
    heard_in_row: u32,
    silent_in_row: u32,
    state: SensorState,
    relapses: f64,
}

/// The kinds, the one that is surest of its evidence first: where two are proven, it names the fault.
const KINDS: [FaultKind; 4] = [FaultKind::Missing, FaultKind::Stuck, FaultKind::Saturated, FaultKind::Noisy];

/// Above this a sensor is faulty; below the other it is healthy again.
const CONVICT: f64 = 6.0;
const ACQUIT: f64 = 0.0;
const FLOOR: f64 = -2.0;
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
/// Per metre of wall that passes in silence. Doors, gaps and walls hidden by what mirrors the sound away keep a healthy sensor
/// silent, too, however long the robot looks at them, but seldom for more than half a metre.
const SILENT_AT_WALL: f64 = 11.0;
/// Neighbours this far apart leave no room for a gap between them; the farther apart, the less they prove.
const CLOSE_RAD: f64 = 25.0 * std::f64::consts::PI / 180.0;
/// What one sweep may add at most.
const MOST_SILENT: f64 = 0.9;
/// A sensor that never hears cannot be heard.
const HEARD: f64 = -3.0;
/// A reading that PCA cannot explain: four of five from a noisy sensor, one of five from a healthy one in clutter.
const JUMP: f64 = 1.1;
const NO_JUMP: f64 = -1.6;
/// Root of the PCA residual from which a reading counts as a jump, metres.
const JUMP_M: f64 = 0.09;
/// Around a short silence, which is itself a jump to PCA, the readings before and after it are compared.
const SHORT_SILENCE_SWEEPS: u32 = 3;
const LEAP_M: f64 = 0.15;
const LEAP: f64 = 0.8;
const NO_LEAP: f64 = -1.0;
/// A jump that ends beyond the wall that the map or the neighbours know: healthy sensors look through doors, but do not jump there.
const JUMP_BEYOND: f64 = 1.6;
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
            silent_in_row: 0,
            state: SensorState::Healthy,
            relapses: 0.0,
        }
    }
}

impl Suspicion {
    /// The strongest log-likelihood ratio of all kinds.
    #[must_use]
    pub fn score(&self) -> f64 {
        self.ratios.iter().copied().fold(FLOOR, f64::max)
    }

    /// What is worth remembering of the trial: the verdict, and how often it was overturned.
    #[must_use]
    pub fn memory(&self) -> SensorMemory {
        SensorMemory { state: self.state, relapses: self.relapses }
    }

    /// The trial taken up again: a sensor just convicted, or one without any evidence against it.
    ///
    /// # Errors
    /// Where the relapses are none that a sensor can have.
    pub fn restore(&SensorMemory { state, relapses }: &SensorMemory) -> Result<Self, Impossible> {
        let least = if state == SensorState::Healthy { 0.0 } else { 1.0 };
        if !(least..=MOST_RELAPSES).contains(&relapses) {
            return Err(Impossible("a sensor was convicted more or less often than any can be"));
        }
        let mut suspicion = Self { state, relapses, ..Self::default() };
        if let SensorState::Faulty(kind) = state {
            suspicion.ratios[place(kind)] = CONVICT;
        }
        Ok(suspicion)
    }

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
        if range_m.is_infinite() {
            (self.heard_in_row, self.silent_in_row) = (0, self.silent_in_row + 1);
            if range_m > 0.0 {
                let by_map: f64 = if evidence.map_m.is_some() { 1.0 } else { 0.0 };
                let by_neighbours = evidence.neighbours.map_or(0.0, |seen| (CLOSE_RAD / seen.span_rad).min(1.0));
                let silent = SILENT_AT_WALL * by_map.max(by_neighbours) * evidence.passed_m;
                self.add(FaultKind::Saturated, silent.min(MOST_SILENT));
            }
            return;
        }
        self.add(FaultKind::Saturated, HEARD);
        self.heard_in_row += 1;
        let leap_m = (range_m - self.last_m).abs();
        let is_same = leap_m < SAME_M;
        self.last_m = range_m;
        let novelty = (evidence.moved_m / MOVED_M).min(1.0);
        self.add(FaultKind::Stuck, if is_same { novelty * REPEATED } else { CHANGED });
        if self.silent_in_row > 0 && self.silent_in_row <= SHORT_SILENCE_SWEEPS {
            self.add(FaultKind::Noisy, if leap_m > LEAP_M { LEAP } else { NO_LEAP });
        } else if !is_same {
            self.weigh_scatter(evidence);
        }
        self.silent_in_row = 0;
    }

    /// A reading that is new: does it scatter?
    fn weigh_scatter(&mut self, evidence: &Evidence) {
        // Falling silent and being heard again are jumps of V, too, but say nothing of the scatter.
        if !evidence.residual_m.is_finite() || self.heard_in_row < 3 {
            return;
        }
        let is_beyond = |wall_m: f64| evidence.range_m > wall_m + BEYOND_M;
        let is_known =
            evidence.map_m.is_some_and(is_beyond) || evidence.neighbours.is_some_and(|seen| is_beyond(seen.range_m));
        let scatter = match evidence.residual_m > JUMP_M {
            true if is_known => JUMP_BEYOND,
            true => JUMP,
            false => NO_JUMP,
        };
        self.add(FaultKind::Noisy, scatter);
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A healthy reading of a sensor that moves along walls.
    fn evidence(range_m: f64) -> Evidence {
        Evidence {
            range_m,
            no_measurement: None,
            residual_m: 0.01,
            map_m: None,
            neighbours: None,
            moved_m: 0.03,
            passed_m: 0.03,
        }
    }

    /// Weighs the same kind of sweep until the state changes; gives the number of sweeps and the state.
    fn until_changed(suspicion: &mut Suspicion, sweep: impl Fn(usize) -> Evidence) -> (usize, SensorState) {
        let before = suspicion.state;
        for count in 1..1000 {
            suspicion.weigh(&sweep(count));
            if suspicion.verdict() != before {
                return (count, suspicion.state);
            }
        }
        (1000, before)
    }

    fn healthy() -> Suspicion {
        let mut suspicion = Suspicion::default();
        let calm = |count: usize| evidence(1.0 + 0.01 * count as f64);
        assert_eq!(until_changed(&mut suspicion, calm), (1000, SensorState::Healthy));
        suspicion
    }

    #[test]
    fn a_sensor_that_never_answers_is_missing_within_half_a_second() {
        let (sweeps, state) = until_changed(&mut healthy(), |_| evidence(f64::NAN));
        assert_eq!(state, SensorState::Faulty(FaultKind::Missing));
        assert!((2..=4).contains(&sweeps), "{sweeps}");
    }

    #[test]
    fn a_restored_sensor_keeps_its_state_until_its_readings_speak_against_it() {
        for kind in KINDS {
            let memory = SensorMemory { state: SensorState::Faulty(kind), relapses: 1.5 };
            let mut restored = Suspicion::restore(&memory).unwrap();
            assert_eq!((restored.memory(), restored.verdict()), (memory, memory.state));
            let calm = |count: usize| evidence(1.0 + 0.01 * count as f64);
            assert_eq!(until_changed(&mut restored, calm).1, SensorState::Healthy, "{kind:?}");
        }
        for relapses in [f64::NAN, -1.0, 0.5, 4.0] {
            let memory = SensorMemory { state: SensorState::Faulty(FaultKind::Noisy), relapses };
            assert!(Suspicion::restore(&memory).is_err(), "{relapses}");
        }
    }

    #[test]
    fn a_blanked_reading_is_forgiven_longer_than_a_missing_one() {
        let blanked = |_| Evidence { no_measurement: Some(NoMeasurement::Blanked), ..evidence(f64::NAN) };
        assert!(until_changed(&mut healthy(), blanked).0 > 8);
    }

    #[test]
    fn silence_is_a_fault_only_where_something_must_be_heard() {
        let silent = evidence(f64::INFINITY);
        assert_eq!(until_changed(&mut healthy(), |_| silent).1, SensorState::Healthy, "an open room");
        let at_wall = Evidence { map_m: Some(1.2), ..silent };
        let (sweeps, state) = until_changed(&mut healthy(), |_| at_wall);
        assert_eq!(state, SensorState::Faulty(FaultKind::Saturated));
        assert!((10..=50).contains(&sweeps), "{sweeps}");
        let standing = Evidence { passed_m: 0.0, ..at_wall };
        assert_eq!(until_changed(&mut healthy(), |_| standing).1, SensorState::Healthy, "the same door for ever");
    }

    #[test]
    fn the_reason_counts_the_neighbours() {
        let mut suspicion = healthy();
        let seen = Seen { range_m: 1.2, witnesses: 3, span_rad: 0.4 };
        let silent = Evidence { neighbours: Some(seen), ..evidence(f64::INFINITY) };
        until_changed(&mut suspicion, |_| silent);
        assert_eq!(
            suspicion.reason(7, &silent),
            "sensor 7 hears nothing, again and again, where three neighbours see a wall at 1.2 m"
        );
    }

    #[test]
    fn scatter_is_noise_and_a_single_outlier_is_not() {
        let scatter = |count: usize| Evidence { residual_m: 0.3, ..evidence(1.0 + 0.1 * count as f64) };
        let (sweeps, state) = until_changed(&mut healthy(), scatter);
        assert_eq!(state, SensorState::Faulty(FaultKind::Noisy));
        assert!((6..=15).contains(&sweeps), "{sweeps}");
        // An outlier spoils the three blocks that hold it.
        let outliers = |count: usize| match count % 10 {
            0..3 => scatter(count),
            _ => evidence(1.0 + 0.01 * count as f64),
        };
        assert_eq!(until_changed(&mut healthy(), outliers).1, SensorState::Healthy);
    }

    #[test]
    fn a_value_that_never_changes_is_stuck_only_while_the_robot_moves() {
        let (sweeps, state) = until_changed(&mut healthy(), |_| evidence(0.8));
        assert_eq!(state, SensorState::Faulty(FaultKind::Stuck));
        assert!((20..=40).contains(&sweeps), "{sweeps}");
        let standing = |_| Evidence { moved_m: 0.0, ..evidence(0.8) };
        assert_eq!(until_changed(&mut healthy(), standing).1, SensorState::Healthy);
    }

    #[test]
    fn who_relapses_is_forgiven_more_slowly() {
        let mut suspicion = healthy();
        let mut served = [0; 3];
        for sweeps in &mut served {
            for _ in 0..30 {
                suspicion.weigh(&evidence(f64::NAN));
                suspicion.verdict();
            }
            let calm = |count: usize| evidence(1.0 + 0.01 * count as f64);
            let (count, state) = until_changed(&mut suspicion, calm);
            assert_eq!(state, SensorState::Healthy);
            *sweeps = count;
        }
        assert!(served[1] > served[0] && served[2] > served[1], "{served:?}");
    }
}
