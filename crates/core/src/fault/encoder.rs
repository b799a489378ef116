//! Encoder fault detection: an encoder that stands still while the walls go by, or counts backwards.
//!
//! Each time the wheels have rolled far enough, the ring's last readings are compared with those before (`profile.rs`) under several
//! motions: as the encoders say, with one of them reversed, and, where one does not count, with its wheel rolling all the same.
//! The advantage of another motion adds to the log-likelihood ratio of that fault, clamped below at zero: a cumulative
//! sum (Page, Continuous inspection schemes, 1954), whose last zero tells when the fault began. Wrong wheel sizes or slip never
//! look like a heading error of half a radian each time.

use super::params::Params;
use super::profile::{Comparer, Endpoints};
use crate::event::{EncoderEvent, EncoderState, Event, Wheel};
use crate::geometry::Ring;
use crate::sweep::Sweep;

/// Watches both encoders.
#[derive(Clone, Debug)]
pub(crate) struct EncoderWatch {
    params: Params,
    comparer: Comparer,
    base_m: f64,
    before: Endpoints,
    /// The sweep of `before`; none where a new one is needed.
    since_sweep: Option<u64>,
    /// Encoder travel since then, left and right, metres.
    rolled_m: [f64; 2],
    tests: [EncoderTest; 2],
    is_reversed: [bool; 2],
}

/// The evidence against one encoder.
#[derive(Clone, Copy, Debug, Default)]
struct EncoderTest {
    state: EncoderState,
    dead: Sum,
    reversed: Sum,
    /// Steps in a row in which a dead encoder counted.
    counted: u32,
}

/// A cumulative sum, and the last sweep that left nothing of it; none where none ever did.
#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    ratio: f64,
    zero_sweep: Option<u64>,
}

/// A change of an encoder's state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct EncoderChange {
    /// Its wheel.
    pub wheel: Wheel,
    /// Its state before.
    pub before: EncoderState,
    /// Its new state.
    pub state: EncoderState,
    /// The last sweep with right counts; none where there was none.
    pub since_sweep: Option<u64>,
}

impl EncoderWatch {
    /// A watch over encoders that begin healthy.
    #[must_use]
    pub(crate) fn with_params(ring: &Ring, base_m: f64, params: Params) -> Self {
        let comparer = Comparer::new(ring, &params);
        let before = comparer.room();
        Self {
            comparer,
            base_m,
            before,
            since_sweep: None,
            rolled_m: [0.0; 2],
            tests: [EncoderTest::default(); 2],
            is_reversed: [false; 2],
            params,
        }
    }

    /// Encoders whose sign must be flipped, left and right.
    #[must_use]
    pub(crate) fn is_reversed(&self) -> [bool; 2] {
        self.is_reversed
    }

    /// True while an encoder is suspected: the pose is then too doubtful for map updates.
    #[must_use]
    pub(crate) fn is_suspected(&self) -> bool {
        self.scores().as_flattened().iter().any(|ratio| *ratio > self.params.encoder_suspect)
    }

    /// The evidence that the left, the right encoder is dead, reversed; declared from 12 on.
    #[must_use]
    pub(crate) fn scores(&self) -> [[f64; 2]; 2] {
        self.tests.map(|test| [test.dead.ratio, test.reversed.ratio])
    }

    /// Adds one sweep's evidence; returns a change of state.
    pub(crate) fn inspect(
        &mut self,
        sweep: &Sweep,
        is_trusted: impl Fn(usize) -> bool,
        events: &mut Vec<Event>,
    ) -> Option<EncoderChange> {
        let told_m = [sweep.left_m, sweep.right_m];
        let Some(since_sweep) = self.since_sweep else {
            self.look(sweep, is_trusted);
            return None;
        };
        self.rolled_m = [0, 1].map(|wheel| self.rolled_m[wheel] + told_m[wheel]);
        let [left_m, right_m] = self.rolled_m;
        if left_m.abs().max(right_m.abs()) >= self.params.encoder_step_m {
            self.weigh(sweep, &is_trusted);
            self.look(sweep, is_trusted);
        } else if sweep.index.saturating_sub(since_sweep) > self.params.encoder_max_sweeps {
            self.look(sweep, is_trusted);
        }
        let change = self.verdict()?;
        let reason = reason(&change);
        let EncoderChange { wheel, state, .. } = change;
        events.push(Event::Encoder(EncoderEvent { at: sweep.at, wheel, state, reason }));
        Some(change)
    }

    /// Takes this sweep to compare with.
    fn look(&mut self, sweep: &Sweep, is_trusted: impl Fn(usize) -> bool) {
        self.comparer.endpoints(sweep, is_trusted, &mut self.before);
        (self.since_sweep, self.rolled_m) = (Some(sweep.index), [0.0; 2]);
    }

    /// Compares this sweep with the one before.
    fn weigh(&mut self, sweep: &Sweep, is_trusted: impl Fn(usize) -> bool) {
        let rolled_m = self.rolled_m;
        let cost = |rolled_m| self.comparer.cost(&self.before, sweep, &is_trusted, rolled_m, self.base_m, &self.params);
        let Some(told) = cost(rolled_m) else { return };
        let counts = [0, 1].map(|wheel| rolled_m[wheel].abs() > self.params.dead_share * rolled_m[1 - wheel].abs());
        let is_dead = self.tests.map(|test| test.state == EncoderState::Dead);
        let mut dead = [None; 2];
        let mut reversed = [None; 2];
        for wheel in 0..2 {
            let other_m = rolled_m[1 - wheel];
            if !counts[wheel] && !is_dead[wheel] {
                let costs =
                    self.params.rolled_shares.iter().filter_map(|share| cost(with(rolled_m, wheel, share * other_m)));
                dead[wheel] = costs.min_by(f64::total_cmp);
            }
            if counts == [true; 2] && is_dead == [false; 2] && rolled_m[wheel].abs() > self.params.min_rolled_m {
                reversed[wheel] = cost(with(rolled_m, wheel, -rolled_m[wheel]));
            }
        }
        for (wheel, test) in self.tests.iter_mut().enumerate() {
            test.counted = if counts[wheel] { test.counted + 1 } else { 0 };
            if let Some(cost) = dead[wheel] {
                test.dead.add(told - cost, sweep.index, &self.params);
            } else if counts[wheel] {
                test.dead = Sum { ratio: 0.0, zero_sweep: Some(sweep.index) };
            }
            if let Some(cost) = reversed[wheel] {
                // The other encoder may be the reversed one.
                let rival = reversed[1 - wheel].map_or(told, |other| other.min(told));
                test.reversed.add(rival - cost, sweep.index, &self.params);
            }
        }
    }

    fn verdict(&mut self) -> Option<EncoderChange> {
        let dead_now =
            |test: &EncoderTest| test.state != EncoderState::Dead && test.dead.ratio >= self.params.encoder_declare;
        let backwards = |test: &EncoderTest| test.reversed.ratio >= self.params.encoder_declare;
        let healed =
            |test: &EncoderTest| test.state == EncoderState::Dead && test.counted >= self.params.encoder_counted_steps;
        let changed = |test: &EncoderTest| dead_now(test) || backwards(test) || healed(test);
        let index = self.tests.iter().position(changed)?;
        let test = &mut self.tests[index];
        let (before, dead, reversed) = (test.state, test.dead, test.reversed);
        let is_reversed = &mut self.is_reversed[index];
        let since_sweep;
        if dead_now(test) {
            (test.state, since_sweep) = (EncoderState::Dead, dead.zero_sweep);
        } else {
            since_sweep = reversed.zero_sweep;
            *is_reversed ^= backwards(test);
            test.state = if *is_reversed { EncoderState::Reversed } else { EncoderState::Healthy };
        }
        let state = test.state;
        for test in &mut self.tests {
            *test = EncoderTest { state: test.state, ..EncoderTest::default() };
        }
        // The next sweeps have other encoder signs than this one.
        self.since_sweep = None;
        Some(EncoderChange { wheel: Wheel::BOTH[index], before, state, since_sweep })
    }
}

impl Sum {
    /// Adds what a step that ends with the sweep `now` says.
    fn add(&mut self, difference: f64, now: u64, params: &Params) {
        let added = (params.encoder_gain * difference).clamp(-params.encoder_max_added, params.encoder_max_added);
        self.ratio = (self.ratio + added).max(0.0);
        if self.ratio <= 0.0 && added < 0.0 {
            self.zero_sweep = Some(now);
        }
    }
}

/// What the wheels rolled where one of them rolled otherwise.
fn with(mut rolled_m: [f64; 2], wheel: usize, otherwise_m: f64) -> [f64; 2] {
    rolled_m[wheel] = otherwise_m;
    rolled_m
}

fn reason(change: &EncoderChange) -> String {
    let wheel = change.wheel.word();
    match (change.before, change.state) {
        (_, EncoderState::Dead) => format!(
            "the {wheel} encoder stands still while the walls go by: the robot's place is unknown until it counts; check its supply and its two wires"
        ),
        (_, EncoderState::Reversed) => {
            format!("the {wheel} encoder counts backwards: swap its two wires; until then its counts are negated")
        }
        (EncoderState::Reversed, _) => format!("the {wheel} encoder counts forwards again"),
        (_, EncoderState::Healthy) => format!("the {wheel} encoder counts again"),
    }
}
