//! One sensor's trial: a sequential test per kind of fault.
//!
//! Each sweep adds to a log-likelihood ratio per kind: how much more probable the reading is from a sensor broken in that way
//! than from a healthy one (Wald's sequential probability ratio test, with both sides clamped so that a change is noticed).
//! A single odd reading is the pose filter's gate's business: it convicts nobody. A sensor that works again is trusted
//! again, but each relapse makes that twice as slow, and a minute of good conduct undoes one.

use super::evidence::Evidence;
use crate::event::{FaultKind, SensorState};
use crate::saved_state::{InvalidState, SensorHistory};
use crate::sweep::NoMeasurement;

/// The evidence gathered against one sensor.
#[derive(Clone, Copy, Debug)]
pub struct FaultTest {
    /// By [`FaultKind`], the surest first.
    ratios: [f64; KINDS.len()],
    last_m: f64,
    /// The reading before the last.
    before_m: f64,
    heard_in_row: u32,
    silent_in_row: u32,
    state: SensorState,
    recurrences: f64,
}

/// The kinds, the one that is surest of its evidence first: where two are proven, it names the fault.
const KINDS: [FaultKind; 4] = [FaultKind::Missing, FaultKind::Stuck, FaultKind::Saturated, FaultKind::Noisy];

/// Above this a sensor is faulty; below the other it is healthy again.
const DECLARE: f64 = 6.0;
const CLEAR: f64 = 0.0;
const FLOOR: f64 = -2.0;
const CEILING: f64 = 12.0;
/// A sensor often convicted has its ceiling raised this many times at most.
const MAX_RELAPSES: f64 = 3.0;
/// Healthy sweeps that undo one relapse.
const FORGIVEN_SWEEPS: f64 = 600.0;

/// Healthy sensors answer, if only that they hear nothing.
const NO_ANSWER: f64 = 3.0;
/// A board that blanks a reading because of crosstalk does so now and then to any sensor.
const BLANKED: f64 = 0.75;
const ANSWER: f64 = -2.0;
/// Silence where the map is sure that something is heard. Its sweeps are not independent, for the map may be wrong: the logarithm of the
/// share of silent sweeps alone would be five times as much.
const SILENT_BY_MAP: f64 = 1.3;
/// Silence between neighbours, per metre of wall that passes. Doors, gaps and walls hidden by what mirrors the sound away keep a
/// healthy sensor silent, too, however long the robot looks at them, but seldom for more than half a metre.
const SILENT_AT_WALL: f64 = 11.0;
/// Neighbours this far apart leave no room for a gap between them; the farther apart, the less they prove.
const CLOSE_RAD: f64 = 25.0 * std::f64::consts::PI / 180.0;
/// What one such sweep may add at most.
const MAX_SILENT: f64 = 0.9;
/// A sensor that never hears cannot be heard.
const HEARD: f64 = -3.0;
/// A reading that leaps from the last one and that PCA over three sweeps cannot explain: most of a noisy sensor's, one of thirty of a
/// healthy one's, but in clutter a few in a row.
const JUMP: f64 = 1.5;
const NO_JUMP: f64 = -1.3;
/// One without the other: an outlier spoils the three blocks that hold it, and a step from one surface to the next leaps once.
const HALF_JUMP: f64 = -0.2;
/// Root of the PCA residual from which on the common motion does not explain a reading, metres.
const UNEXPLAINED_M: f64 = 0.05;
const LEAP_M: f64 = 0.15;
/// A sensor that hears now one surface, now another comes back to where it was, to this: that is no leap.
const BACK_M: f64 = 0.05;
/// A short silence is itself unexplained: then the leap over it decides.
const SHORT_SILENCE_SWEEPS: u32 = 3;
/// The same value, less than the echo's clock can tell, once more while the robot moves.
const REPEATED: f64 = 0.35;
const CHANGED: f64 = -6.0;
const SAME_M: f64 = 4e-4;

impl Default for FaultTest {
    fn default() -> Self {
        Self {
            ratios: [0.0; KINDS.len()],
            last_m: f64::NAN,
            before_m: f64::NAN,
            heard_in_row: 0,
            silent_in_row: 0,
            state: SensorState::Healthy,
            recurrences: 0.0,
        }
    }
}

impl FaultTest {
    /// The strongest log-likelihood ratio of all kinds.
    #[must_use]
    pub fn score(&self) -> f64 {
        self.ratios.iter().copied().fold(FLOOR, f64::max)
    }

    /// What is worth remembering of the trial: the verdict, and how often it was overturned.
    #[must_use]
    pub fn saved_state(&self) -> SensorHistory {
        SensorHistory { state: self.state, recurrences: self.recurrences }
    }

    /// The trial taken up again: a sensor just convicted, or one without any evidence against it.
    ///
    /// # Errors
    /// Where the recurrences are none that a sensor can have.
    pub fn restore(&SensorHistory { state, recurrences }: &SensorHistory) -> Result<Self, InvalidState> {
        let least = if state == SensorState::Healthy { 0.0 } else { 1.0 };
        if !(least..=MAX_RELAPSES).contains(&recurrences) {
            return Err(InvalidState("a sensor was convicted more or less often than any can be"));
        }
        let mut fault_test = Self { state, recurrences, ..Self::default() };
        if let SensorState::Faulty(kind) = state {
            fault_test.ratios[place(kind)] = DECLARE;
        }
        Ok(fault_test)
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
                self.add(FaultKind::Saturated, silence(evidence));
            }
            return;
        }
        self.add(FaultKind::Saturated, HEARD);
        self.heard_in_row += 1;
        let leap_m = (range_m - self.last_m).abs();
        let is_same = leap_m < SAME_M;
        let is_back = (range_m - self.before_m).abs() < BACK_M;
        (self.before_m, self.last_m) = (self.last_m, range_m);
        self.add(FaultKind::Stuck, if is_same { evidence.novelty() * REPEATED } else { CHANGED });
        let is_leap = leap_m > LEAP_M && !is_back;
        if self.silent_in_row > 0 && self.silent_in_row <= SHORT_SILENCE_SWEEPS {
            self.add(FaultKind::Noisy, if is_leap { JUMP } else { NO_JUMP });
        } else if !is_same && evidence.residual_m.is_finite() && self.heard_in_row >= 3 {
            // Falling silent and being heard again are jumps of V, too, but say nothing of the scatter.
            self.add(
                FaultKind::Noisy,
                match (is_leap, evidence.residual_m > UNEXPLAINED_M) {
                    (true, true) => JUMP,
                    (false, false) => NO_JUMP,
                    _ => HALF_JUMP,
                },
            );
        }
        self.silent_in_row = 0;
    }

    fn add(&mut self, kind: FaultKind, evidence: f64) {
        let ceiling = if self.state == SensorState::Faulty(kind) {
            CEILING * libm::exp2(self.recurrences - 1.0)
        } else {
            CEILING
        };
        let ratio = &mut self.ratios[place(kind)];
        *ratio = (*ratio + evidence).clamp(FLOOR, ceiling);
    }

    /// The sensor's state after what has been weighed.
    pub fn verdict(&mut self) -> SensorState {
        let proven = KINDS.into_iter().find(|&kind| self.ratios[place(kind)] >= DECLARE);
        self.state = match (self.state, proven) {
            (SensorState::Healthy, Some(kind)) => {
                self.recurrences = (self.recurrences + 1.0).min(MAX_RELAPSES);
                SensorState::Faulty(kind)
            }
            (SensorState::Healthy, None) => {
                self.recurrences = (self.recurrences - 1.0 / FORGIVEN_SWEEPS).max(0.0);
                SensorState::Healthy
            }
            (SensorState::Faulty(kind), Some(surer)) if place(surer) < place(kind) => SensorState::Faulty(surer),
            (SensorState::Faulty(kind), _) if self.ratios[place(kind)] > CLEAR => SensorState::Faulty(kind),
            (SensorState::Faulty(_), proven) => proven.map_or(SensorState::Healthy, SensorState::Faulty),
        };
        self.state
    }

    /// Why the state is what it is, in words.
    #[must_use]
    pub fn reason(&self, sensor: usize, evidence: &Evidence) -> String {
        evidence.reason(sensor, self.state, self.last_m)
    }
}

/// How much a sweep without an echo speaks against the sensor.
fn silence(evidence: &Evidence) -> f64 {
    let by_map =
        evidence.expected.map_or(0.0, |expected| SILENT_BY_MAP * expected.detection_probability * evidence.novelty());
    let by_neighbours = evidence.neighbours.map_or(0.0, |seen| {
        (SILENT_AT_WALL * (CLOSE_RAD / seen.span_rad).min(1.0) * evidence.passed_m).min(MAX_SILENT)
    });
    by_map.max(by_neighbours)
}

fn place(kind: FaultKind) -> usize {
    match kind {
        FaultKind::Missing => 0,
        FaultKind::Stuck => 1,
        FaultKind::Saturated => 2,
        FaultKind::Noisy => 3,
    }
}

#[cfg(test)]
mod tests {
    use super::super::evidence::Expected;
    use super::super::neighbours::Seen;
    use super::*;

    /// A healthy reading of a sensor that moves along walls.
    fn evidence(range_m: f64) -> Evidence {
        Evidence {
            range_m,
            no_measurement: None,
            residual_m: 0.01,
            expected: None,
            neighbours: None,
            moved_m: 0.03,
            passed_m: 0.03,
        }
    }

    /// Weighs the same kind of sweep until the state changes; gives the number of sweeps and the state.
    fn until_changed(fault_test: &mut FaultTest, sweep: impl Fn(usize) -> Evidence) -> (usize, SensorState) {
        let before = fault_test.state;
        for count in 1..1000 {
            fault_test.weigh(&sweep(count));
            if fault_test.verdict() != before {
                return (count, fault_test.state);
            }
        }
        (1000, before)
    }

    fn healthy() -> FaultTest {
        let mut fault_test = FaultTest::default();
        let calm = |count: usize| evidence(1.0 + 0.01 * count as f64);
        assert_eq!(until_changed(&mut fault_test, calm), (1000, SensorState::Healthy));
        fault_test
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
            let memory = SensorHistory { state: SensorState::Faulty(kind), recurrences: 1.5 };
            let mut restored = FaultTest::restore(&memory).unwrap();
            assert_eq!((restored.saved_state(), restored.verdict()), (memory, memory.state));
            let calm = |count: usize| evidence(1.0 + 0.01 * count as f64);
            assert_eq!(until_changed(&mut restored, calm).1, SensorState::Healthy, "{kind:?}");
        }
        for recurrences in [f64::NAN, -1.0, 0.5, 4.0] {
            let memory = SensorHistory { state: SensorState::Faulty(FaultKind::Noisy), recurrences };
            assert!(FaultTest::restore(&memory).is_err(), "{recurrences}");
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
        let at_wall = |detection_probability| Evidence {
            expected: Some(Expected { range_m: 1.2, detection_probability }),
            ..silent
        };
        let (sweeps, state) = until_changed(&mut healthy(), |_| at_wall(1.0));
        assert_eq!(state, SensorState::Faulty(FaultKind::Saturated));
        assert!((5..=8).contains(&sweeps), "{sweeps}");
        assert!(until_changed(&mut healthy(), |_| at_wall(0.2)).0 > 4 * sweeps, "a map that is not sure");
        let standing = Evidence { moved_m: 0.0, passed_m: 0.0, ..at_wall(1.0) };
        assert_eq!(until_changed(&mut healthy(), |_| standing).1, SensorState::Healthy, "the same door for ever");
    }

    #[test]
    fn the_reason_counts_the_neighbours() {
        let mut fault_test = healthy();
        let seen = Seen { range_m: 1.2, witnesses: 3, span_rad: 0.4 };
        let silent = Evidence { neighbours: Some(seen), ..evidence(f64::INFINITY) };
        until_changed(&mut fault_test, |_| silent);
        assert_eq!(
            fault_test.reason(7, &silent),
            "sensor 7 hears nothing, again and again, where three neighbours see a wall at 1.2 m"
        );
    }

    #[test]
    fn scatter_is_noise_and_a_single_outlier_is_not() {
        let scatter = |count: usize| Evidence { residual_m: 0.3, ..evidence(1.0 + 0.1 * (7 * count % 11) as f64) };
        let (sweeps, state) = until_changed(&mut healthy(), scatter);
        assert_eq!(state, SensorState::Faulty(FaultKind::Noisy));
        assert!((5..=10).contains(&sweeps), "{sweeps}");
        // An outlier spoils the three blocks that hold it.
        let outliers = |count: usize| match count % 10 {
            0..3 => scatter(count),
            _ => evidence(1.0 + 0.01 * count as f64),
        };
        assert_eq!(until_changed(&mut healthy(), outliers).1, SensorState::Healthy);
    }

    #[test]
    fn a_sensor_that_hears_now_one_surface_now_another_is_not_noisy() {
        let clutter = |count: usize| Evidence { residual_m: 0.3, ..evidence(0.9 + 0.7 * (count % 2) as f64) };
        assert_eq!(until_changed(&mut healthy(), clutter).1, SensorState::Healthy);
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
        let mut fault_test = healthy();
        let mut served = [0; 3];
        for sweeps in &mut served {
            for _ in 0..30 {
                fault_test.weigh(&evidence(f64::NAN));
                fault_test.verdict();
            }
            let calm = |count: usize| evidence(1.0 + 0.01 * count as f64);
            let (count, state) = until_changed(&mut fault_test, calm);
            assert_eq!(state, SensorState::Healthy);
            *sweeps = count;
        }
        assert!(served[1] > served[0] && served[2] > served[1], "{served:?}");
    }
}
