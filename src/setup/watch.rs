//! Watches the robot move: what contradicts the configuration, and when enough agrees with it.

use super::ambiguity;
use super::one_wheel::OneWheel;
use super::robot::{self, Change, Wiring};
use super::{ENOUGH_M, ENOUGH_RAD, Measured, Phase, Progress, Setup};
use crate::doctor::{Mistake, simple_factor};
use slamd_core::{EncoderState, ModelState, Timestamp, config::RobotConfig};

/// A drill without a drive after it is enough after this time, seconds.
const AFTER_DRILL_S: f64 = 10.0;
/// Corrections before setup gives up.
const MAX_ROUNDS: usize = 6;
/// Path after which echoes that do not agree with the map never will, metres.
pub(super) const MAX_PATH_M: f64 = 25.0;
/// Further findings of one drive follow within this time, seconds.
const GATHER_S: f64 = 0.5;
/// A person who is asked to turn a wheel has this long, seconds.
const ASK_S: f64 = 60.0;
/// Counted turns within these bounds are the one full turn that the drill asks for, radians.
const FULL_TURN_RAD: [f64; 2] = [4.7, 7.9];

impl Setup {
    pub(super) fn watch(&mut self, at: Timestamp) {
        let changes = self.changes();
        if changes.is_empty() {
            return self.judge(at);
        }
        if at.seconds_since(*self.found_at.get_or_insert(at)) < GATHER_S {
            return;
        }
        self.correct(&changes, at);
    }

    /// What the drill, the walls and the encoders contradict.
    fn changes(&self) -> Vec<Change> {
        // The unit first: in another one no geometry is right.
        let range_factor = self.examination.pipeline().range_factor();
        if libm::log(range_factor).abs() > 1.0 {
            return vec![Change::Ranges(1.0 / range_factor)];
        }
        let state = self.examination.state();
        let models = state.models().iter().filter(|event| event.state != ModelState::Resolved);
        let mut changes: Vec<Change> = models.filter_map(|event| Change::of_model(&event.finding)).collect();
        let reversed = state.encoders().map(|encoder| encoder == EncoderState::Reversed);
        if reversed != [false; 2] {
            changes.push(Change::Reverse(reversed));
        }
        let drill = self.examination.drill();
        if changes.is_empty() && !self.is_drilled && drill.is_by_hand() && drill.is_done() {
            changes = self.of_drill();
        }
        changes
    }

    /// What is known of a robot whose echoes do not agree with its map, and what to do.
    pub(super) fn verdict(&self) -> String {
        let found =
            if self.found.is_empty() { String::new() } else { format!("found so far: {}; ", self.found.join("; ")) };
        let models = self.examination.state().models().iter();
        let open = models.filter(|event| event.state != ModelState::Resolved).map(|event| event.finding.clause.clone());
        let open = open.chain(self.complaints()).next();
        let why = open.unwrap_or_else(|| "no single mistake explains it".into());
        format!(
            "{found}{why}: run `slamd doctor` while it drives, and name what you have measured with --wheel-radius and --wheel-base"
        )
    }

    fn of_drill(&self) -> Vec<Change> {
        let pipeline = self.examination.pipeline();
        let Some(ring) = pipeline.ring() else { return Vec::new() };
        let result = self.examination.drill().result(ring);
        let of_mistake = |mistake: Mistake| match mistake {
            Mistake::WheelScale(factor) => Change::Ticks(factor),
            Mistake::RangeScale(factor) => Change::Size(factor),
            Mistake::RingTurned(turned_rad) => Change::Ring(turned_rad),
            Mistake::Swapped => Change::Swap,
            Mistake::Mirrored => Change::Mirror,
        };
        let mut changes: Vec<Change> = result.mistakes().into_iter().map(of_mistake).collect();
        // Without walls around it the person's word counts: the turn was to the left.
        if result.wheels_turn_left() == Some(false) && result.walls_turn_left.is_none() {
            changes.push(Change::Swap);
        }
        if let Some(reversed) = result.reversed().filter(|reversed| *reversed != [false; 2]) {
            changes.push(Change::Reverse(reversed));
        }
        let has_scale = changes.iter().any(|change| matches!(change, Change::Ticks(_) | Change::Size(_)));
        let turned_rad = self.examination.drill().turned_rad();
        if !has_scale
            && self.measured.wheel_base_m.is_none()
            && (FULL_TURN_RAD[0]..=FULL_TURN_RAD[1]).contains(&turned_rad)
        {
            let factor = turned_rad / std::f64::consts::TAU;
            let base_m = factor * self.config.robot.wheel_base_m;
            changes.extend(((factor - 1.0).abs() > 0.03).then_some(Change::Base(base_m)));
        }
        changes
    }

    fn correct(&mut self, changes: &[Change], at: Timestamp) {
        let is_drill = self.examination.drill().is_by_hand() && self.examination.drill().is_done();
        self.is_drilled |= is_drill;
        self.rounds += 1;
        // The person pushed it by 30 cm: the size is right.
        let of_drill = |change: &Change| match *change {
            Change::Size(factor) if is_drill => Change::Ranges(simple_factor(factor)),
            other => other,
        };
        self.apply(changes.iter().map(of_drill));
        if self.rounds > MAX_ROUNDS {
            let found = self.found.join("; ");
            return self.fail(format!(
                "each correction contradicts the one before ({found}): look at the findings of `slamd doctor`"
            ));
        }
        self.begin_watch(at);
    }

    /// Makes the changes, and notes them for people.
    fn apply(&mut self, changes: impl Iterator<Item = Change>) {
        let mut wiring = self.wiring.unwrap_or_default();
        for change in changes {
            robot::change(&mut self.config, &mut wiring, change);
            self.found.push(change.words());
        }
        self.wiring = Some(wiring);
    }

    /// Whether what was seen is enough.
    fn judge(&mut self, at: Timestamp) {
        let drill = self.examination.drill();
        let (path_m, turned_rad) = drill.moved();
        let state = self.examination.state();
        let is_enough = path_m > ENOUGH_M && turned_rad > ENOUGH_RAD;
        let agrees = is_enough && !state.is_lost() && state.estimate().is_some();
        if path_m > 2.0 * ENOUGH_M && state.estimate().is_none() {
            let complaint = self.complaints().into_iter().next();
            let why = complaint.unwrap_or_else(|| "drive it nearer to walls".into());
            return self.fail(format!("the robot drives, but its readings show no walls; {why}"));
        }
        if is_enough && !agrees && path_m > MAX_PATH_M {
            let verdict = self.verdict();
            return self.fail(format!(
                "after {path_m:.0} m its echoes still do not agree with the map that they draw; {verdict}"
            ));
        }
        let has_drilled = drill.is_by_hand() && drill.is_done();
        if has_drilled && !self.is_drilled {
            self.is_drilled = true;
        }
        // A drill in which no reading lies beyond half a metre tells no unit.
        let is_open = self.examination.pipeline().is_range_unit_open();
        let is_over = !is_open && self.is_drilled && self.own(at).seconds() > AFTER_DRILL_S;
        let rests = is_over && (drill.still_s() > AFTER_DRILL_S || path_m < 0.01);
        if agrees || rests {
            self.finish(agrees, at);
        }
    }

    /// Travel and turning were corrected one after the other: the size of the robot, the unit of the ranges, or ticks per turn? A measured
    /// size is right, and so is one of which the ranges are just the half: then they are one-way times. True if the unit of the ranges was
    /// changed.
    fn settle_size(&mut self) -> bool {
        let RobotConfig { wheel_radius_m: radius_m, wheel_base_m: base_m, .. } = self.measured.robot();
        let factor = self.config.robot.wheel_radius_m / radius_m;
        if (factor - 1.0).abs() < 0.1 {
            return false;
        }
        let is_size = libm::log(self.config.robot.wheel_base_m / base_m / factor).abs() < 0.15;
        let said = self.examination.pipeline().board().ticks_per_turn();
        if !is_size || said != self.config.robot.ticks_per_turn {
            self.config.robot.wheel_radius_m = radius_m;
            robot::change(&mut self.config, &mut Wiring::default(), Change::Ticks(1.0 / factor));
            return false;
        }
        let is_unit = self.measured != Measured::default() || (0.4..0.6).contains(&factor);
        if is_unit {
            (self.config.robot.wheel_radius_m, self.config.robot.wheel_base_m) = (radius_m, base_m);
            robot::change(&mut self.config, &mut Wiring::default(), Change::Ranges(simple_factor(factor)));
        }
        is_unit
    }

    /// The walls tell a scale to a few per cent; what mistakes make is a simple factor.
    fn settle_ticks(&mut self) {
        let said = self.examination.pipeline().board().ticks_per_turn();
        if let (Some(said), Some(ticks)) = (said.map(f64::from), self.config.robot.ticks_per_turn.map(f64::from)) {
            let factor = simple_factor(ticks / said);
            robot::change(&mut self.config, &mut Wiring::default(), Change::Ticks(factor * said / ticks));
        }
    }

    fn finish(&mut self, is_confirmed: bool, at: Timestamp) {
        let before = self.config.robot.clone();
        let is_other_unit = self.settle_size();
        self.settle_ticks();
        let pipeline = self.examination.pipeline();
        let calibration = pipeline.calibration().filter(|found| found.wheel_base_sigma_m < 0.02 * found.wheel_base_m);
        if let (Some(found), true, None) = (calibration, is_confirmed && !is_other_unit, self.measured.wheel_base_m) {
            self.config.robot.wheel_base_m = (found.wheel_base_m * 1e3).round() / 1e3;
        }
        let is_other = self.config.robot.ticks_per_turn != before.ticks_per_turn
            || libm::log(self.config.robot.wheel_base_m / before.wheel_base_m).abs() > 0.02;
        if is_confirmed && is_other && self.rounds <= MAX_ROUNDS {
            self.rounds += 1;
            return self.begin_watch(at);
        }
        if self.is_ambiguous() && self.has_person && !self.is_asked {
            self.is_asked = true;
            self.phase = Phase::OneWheel(at, OneWheel::default());
            return;
        }
        self.write(is_confirmed);
    }

    /// Whether walls alone have told the robot's sides, which they cannot.
    fn is_ambiguous(&self) -> bool {
        let wiring = self.wiring.unwrap_or_default();
        !self.is_drilled && !self.is_told && ambiguity::is_of_sides(&self.config, self.wiring_before, wiring)
    }

    /// Waits for the wheel that the person turns. If nobody does, the file says that there are two possibilities.
    pub(super) fn see_wheel(&mut self, since: Timestamp, at: Timestamp) {
        let Phase::OneWheel(_, wheels) = &mut self.phase else { return };
        if let Some(sweep) = self.examination.pipeline().sweep() {
            wheels.sweep(sweep);
        }
        match wheels.turned() {
            Some((wheel, is_forward)) => {
                self.is_told = true;
                let changes = ambiguity::of_left_wheel_forward(wheel, is_forward);
                if changes.is_empty() {
                    return self.write(true);
                }
                self.apply(changes.iter().copied());
                self.begin_watch(at);
            }
            None if at.seconds_since(since) > ASK_S || at.seconds() > self.timeout_s => self.write(true),
            None => {}
        }
    }

    /// Ends with the file.
    fn write(&mut self, is_confirmed: bool) {
        let pipeline = self.examination.pipeline();
        let said = pipeline.board().ticks_per_turn();
        let assumed = self.measured.robot();
        let wirings = (self.wiring_before, self.wiring.unwrap_or_default());
        self.found = robot::differences(&self.config, &assumed, said, wirings);
        if self.found.is_empty() {
            self.found.push("the robot is as the board says".into());
        }
        if self.is_ambiguous() {
            let keys = ambiguity::mirror_image(&self.config, wirings.0, wirings.1);
            self.found.push(format!(
                "walls cannot tell this from sensors that are numbered the other way round; if the map is a mirror image, set {keys}"
            ));
        }
        let is_measured = self.is_drilled || self.measured != Measured::default();
        if let Some(keys) = ambiguity::one_way(&self.config, said).filter(|_| !is_measured) {
            self.found.push(format!(
                "walls cannot tell this from ranges that are half the true ones; if the map is half as large as the home, set {keys}"
            ));
        }
        if !is_confirmed {
            self.found.push("only a drill by hand was seen; no drive has confirmed it".into());
        }
        let text = robot::to_toml(&self.config, pipeline.board(), &self.found);
        self.phase = Phase::Over(Progress::Done(text));
    }
}
