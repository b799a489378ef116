//! One sensor's fault test: a sequential probability ratio test per kind of fault.
//!
//! Each sweep adds to a log-likelihood ratio per kind: how much more probable the reading is from a sensor broken in that way
//! than from a healthy one (Wald's sequential probability ratio test, with both sides clamped so that a change is noticed).
//! Single outliers are left to the gate of the pose filter. A sensor that works again is trusted again, but each
//! recurrence doubles the time until then. One fault-free minute cancels one recurrence.

use super::evidence::Evidence;
use super::params::Params;
use crate::event::{FaultKind, SensorState};
use crate::saved_state::{InvalidState, SensorHistory};
use crate::sweep::NoMeasurement;

/// The evidence gathered against one sensor.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FaultTest {
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
    pub(crate) fn score(&self) -> f64 {
        self.ratios.iter().copied().fold(f64::NEG_INFINITY, f64::max)
    }

    /// What to save of the test: the state, and how often the fault recurred.
    #[must_use]
    pub(crate) fn saved_state(&self) -> SensorHistory {
        SensorHistory { state: self.state, recurrences: self.recurrences }
    }

    /// A restored test: a sensor just declared faulty, or one without evidence against it. More recurrences than these constants count,
    /// but not more than the defaults, become their most.
    ///
    /// # Errors
    /// The number of recurrences is impossible.
    pub(crate) fn restore(
        &SensorHistory { state, recurrences }: &SensorHistory,
        params: &Params,
    ) -> Result<Self, InvalidState> {
        let least = if state == SensorState::Healthy { 0.0 } else { 1.0 };
        let most = params.max_recurrences.max(Params::default().max_recurrences);
        if !(least..=most).contains(&recurrences) {
            return Err(InvalidState("a sensor has an impossible number of fault recurrences"));
        }
        let recurrences = recurrences.min(params.max_recurrences);
        let mut fault_test = Self { state, recurrences, ..Self::default() };
        if let SensorState::Faulty(kind) = state {
            fault_test.ratios[index_of(kind)] = params.declare;
        }
        Ok(fault_test)
    }

    /// Adds one sweep's evidence.
    pub(crate) fn weigh(&mut self, evidence: &Evidence, params: &Params) {
        let range_m = evidence.range_m;
        if range_m.is_nan() {
            self.heard_in_row = 0;
            let is_blanked = evidence.no_measurement == Some(NoMeasurement::Blanked);
            self.add(FaultKind::Missing, if is_blanked { params.blanked } else { params.no_answer }, params);
            return;
        }
        self.add(FaultKind::Missing, params.answer, params);
        if range_m.is_infinite() {
            (self.heard_in_row, self.silent_in_row) = (0, self.silent_in_row + 1);
            if range_m > 0.0 {
                self.add(FaultKind::Saturated, silence(evidence, params), params);
            }
            return;
        }
        self.add(FaultKind::Saturated, params.heard, params);
        self.heard_in_row += 1;
        let leap_m = (range_m - self.last_m).abs();
        let is_same = leap_m < params.same_m;
        let is_back = (range_m - self.before_m).abs() < params.back_m;
        (self.before_m, self.last_m) = (self.last_m, range_m);
        self.add(
            FaultKind::Stuck,
            if is_same { evidence.novelty(params) * params.repeated } else { params.changed },
            params,
        );
        let is_leap = leap_m > evidence.leap_m && !is_back;
        // A slow ring on a robot that drives farther than that between two sweeps: any surface leaps.
        let tells_noise = evidence.moved_m <= params.leap_m;
        if tells_noise && self.silent_in_row > 0 && self.silent_in_row <= params.short_silence_sweeps {
            self.add(FaultKind::Noisy, if is_leap { params.jump } else { params.no_jump }, params);
        } else if tells_noise && !is_same && evidence.residual_m.is_finite() && self.heard_in_row >= 3 {
            // Falling silent and being heard again are jumps of V, too, but say nothing of the scatter.
            self.add(
                FaultKind::Noisy,
                match (is_leap, evidence.residual_m > evidence.unexplained_m) {
                    (true, true) => params.jump,
                    (false, false) => params.no_jump,
                    _ => params.half_jump,
                },
                params,
            );
        }
        self.silent_in_row = 0;
    }

    fn add(&mut self, kind: FaultKind, evidence: f64, params: &Params) {
        let ceiling = if self.state == SensorState::Faulty(kind) {
            params.ceiling * libm::exp2(self.recurrences - 1.0)
        } else {
            params.ceiling
        };
        let ratio = &mut self.ratios[index_of(kind)];
        *ratio = (*ratio + evidence).clamp(params.floor, ceiling);
    }

    /// True if the sensor looks faulty, or is about to, in a way that a wrong pose, map or noise may feign.
    pub(crate) fn is_apparently_faulty(&self, params: &Params) -> bool {
        let mut feigned = KINDS.into_iter().filter(|&kind| is_relative(kind));
        feigned.any(|kind| {
            self.state == SensorState::Faulty(kind) || self.ratios[index_of(kind)] > params.about_to_declare
        })
    }

    /// The sensor's state after what has been weighed. A fault that a wrong pose, map or noise may feign is declared only if
    /// `may_declare_relative`.
    pub(crate) fn verdict(&mut self, params: &Params, may_declare_relative: bool) -> SensorState {
        let may_declare =
            |kind: FaultKind| may_declare_relative || self.state == SensorState::Faulty(kind) || !is_relative(kind);
        let proven = KINDS.into_iter().find(|&kind| self.ratios[index_of(kind)] >= params.declare && may_declare(kind));
        self.state = match (self.state, proven) {
            (SensorState::Healthy, Some(kind)) => {
                self.recurrences = (self.recurrences + 1.0).min(params.max_recurrences);
                SensorState::Faulty(kind)
            }
            (SensorState::Healthy, None) => {
                self.recurrences = (self.recurrences - 1.0 / params.forgiven_sweeps).max(0.0);
                SensorState::Healthy
            }
            (SensorState::Faulty(kind), Some(surer)) if index_of(surer) < index_of(kind) => SensorState::Faulty(surer),
            (SensorState::Faulty(kind), _) if self.ratios[index_of(kind)] > params.clear => SensorState::Faulty(kind),
            (SensorState::Faulty(_), proven) => proven.map_or(SensorState::Healthy, SensorState::Faulty),
        };
        self.state
    }

    /// Why the state is what it is, in words.
    #[must_use]
    pub(crate) fn reason(&self, sensor: usize, evidence: &Evidence) -> String {
        evidence.reason(sensor, self.state, self.last_m)
    }
}

/// Evidence that a silent sweep adds, as a log-likelihood ratio.
fn silence(evidence: &Evidence, params: &Params) -> f64 {
    let by_map = evidence
        .expected
        .map_or(0.0, |expected| params.silent_by_map * expected.detection_probability * evidence.novelty(params));
    let by_neighbours = evidence.neighbours.map_or(0.0, |seen| {
        (params.silent_at_wall * (params.close_rad / seen.span_rad).min(1.0) * evidence.passed_m).min(params.max_silent)
    });
    by_map.max(by_neighbours)
}

/// True if the evidence for a fault of this kind rests on the noise that is assumed, or on pose and map.
const fn is_relative(kind: FaultKind) -> bool {
    matches!(kind, FaultKind::Noisy | FaultKind::Saturated)
}

fn index_of(kind: FaultKind) -> usize {
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
            leap_m: 0.15,
            unexplained_m: 0.05,
            passed_m: 0.03,
        }
    }

    /// Weighs the same kind of sweep until the state changes; gives the number of sweeps and the state.
    fn until_changed(fault_test: &mut FaultTest, sweep: impl Fn(usize) -> Evidence) -> (usize, SensorState) {
        let before = fault_test.state;
        for count in 1..1000 {
            fault_test.weigh(&sweep(count), &Params::default());
            if fault_test.verdict(&Params::default(), true) != before {
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
            let mut restored = FaultTest::restore(&memory, &Params::default()).unwrap();
            assert_eq!((restored.saved_state(), restored.verdict(&Params::default(), true)), (memory, memory.state));
            let calm = |count: usize| evidence(1.0 + 0.01 * count as f64);
            assert_eq!(until_changed(&mut restored, calm).1, SensorState::Healthy, "{kind:?}");
        }
        for recurrences in [f64::NAN, -1.0, 0.5, 4.0] {
            let memory = SensorHistory { state: SensorState::Faulty(FaultKind::Noisy), recurrences };
            assert!(FaultTest::restore(&memory, &Params::default()).is_err(), "{recurrences}");
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
            "sensor 7 repeatedly reports no echo where three neighbours see a wall at 1.2 m"
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
    fn a_robot_that_drives_far_between_two_sweeps_makes_no_noise() {
        let scatter = |moved_m: f64| {
            move |count: usize| Evidence { residual_m: 0.3, moved_m, ..evidence(1.0 + 0.1 * (7 * count % 11) as f64) }
        };
        let mut slow = healthy();
        for count in 0..200 {
            slow.weigh(&scatter(0.3)(count), &Params::default());
            assert_eq!(slow.verdict(&Params::default(), true), SensorState::Healthy, "sweep {count}");
        }
        let (sweeps, _) = until_changed(&mut healthy(), scatter(0.1));
        assert!(sweeps < 20, "{sweeps}");
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
    fn each_recurrence_makes_recovery_slower() {
        let mut fault_test = healthy();
        let mut served = [0; 3];
        for sweeps in &mut served {
            for _ in 0..30 {
                fault_test.weigh(&evidence(f64::NAN), &Params::default());
                fault_test.verdict(&Params::default(), true);
            }
            let calm = |count: usize| evidence(1.0 + 0.01 * count as f64);
            let (count, state) = until_changed(&mut fault_test, calm);
            assert_eq!(state, SensorState::Healthy);
            *sweeps = count;
        }
        assert!(served[1] > served[0] && served[2] > served[1], "{served:?}");
    }
}
