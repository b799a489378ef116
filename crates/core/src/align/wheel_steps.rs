//! Encoder counts → ticks since the session began, without jumps that no wheel can make.
//!
//! Counts wrap (at 32 bits, on some boards at 16), start again when a counter loses its supply, and one value may be wrong. A step that
//! would need several times the robot's highest speed is not rolled. Until the next counts show what it was, the wheel is taken to
//! roll on as before. Then one of four things is known:
//!
//! - the counts go on from before the step: one value was wrong, and nothing is lost;
//! - they go on from after it: the counter started again, or jumped. The travel of that one interval is unknown;
//! - the next steps are as long: the robot moves like that, so its scale is wrong. The steps are used;
//! - none of these: this step is refused, too.

use super::params::Params;
use super::trouble::{What, WheelTrouble};
use crate::event::Wheel;
use crate::time::DeviceTime;
use std::collections::VecDeque;

/// Counts of both wheels at one time, and their ticks since the session began.
#[derive(Clone, Copy, Debug)]
struct Reading {
    at: DeviceTime,
    counts: [i32; 2],
    ticks: [i64; 2],
}

/// A reading that a wheel cannot have rolled to.
#[derive(Clone, Copy, Debug)]
struct Held {
    reading: Reading,
    /// The first wheel that cannot, its step in metres, and the time since the reading before.
    wheel: Wheel,
    rolled_m: f64,
    within_s: f64,
    /// Metres per second of both wheels over that step.
    speed_m_s: [f64; 2],
    is_impossible: [bool; 2],
    /// Steps before it that were as long.
    alike: u32,
}

/// One wheel's step from an earlier reading.
#[derive(Clone, Copy, Debug)]
struct Step {
    ticks: i64,
    rolled_m: f64,
    is_plausible: bool,
    is_unwrapped: bool,
}

/// How far a wheel can roll, either way, and how far it does at its last rate: a step near that is as plausible.
#[derive(Clone, Copy, Debug)]
struct Reach {
    metres: f64,
    usual_m: f64,
}

/// Judges the steps of both encoders.
#[derive(Clone, Debug)]
pub struct WheelSteps {
    last: Option<Reading>,
    held: Option<Held>,
    ticks: [i64; 2],
    /// Ticks per second, and the reading from which they are measured next.
    rate: [f64; 2],
    rate_from: Option<Reading>,
    /// Start of the interval over which the speed is compared with the highest, and how many in a row were above it.
    pace_from: Option<Reading>,
    too_fast: u32,
    has_16_bits: [bool; 2],
    is_reversed: [bool; 2],
    max_speed_m_s: f64,
    /// Steps above this speed are impossible.
    bound_m_s: f64,
    said: [u32; What::COUNT],
    troubles: VecDeque<WheelTrouble>,
    unwrapped: u64,
    refused: u64,
    params: Params,
}

impl WheelSteps {
    /// Encoders without counts yet, of a robot whose highest speed is `max_speed_m_s`; infinite: no step is refused.
    #[must_use]
    pub fn new(max_speed_m_s: f64, params: Params) -> Self {
        Self {
            last: None,
            held: None,
            ticks: [0; 2],
            rate: [0.0; 2],
            rate_from: None,
            pace_from: None,
            too_fast: 0,
            has_16_bits: [false; 2],
            is_reversed: [false; 2],
            max_speed_m_s,
            bound_m_s: params.step_speed_factor * max_speed_m_s,
            said: [0; What::COUNT],
            troubles: VecDeque::new(),
            unwrapped: 0,
            refused: 0,
            params,
        }
    }

    /// Adds absolute counts latched at `at`, left and right, of wheels that roll `metres_per_tick`. Gives their ticks since the session
    /// began.
    pub fn add(&mut self, at: DeviceTime, counts: [i32; 2], metres_per_tick: [f64; 2]) -> [i64; 2] {
        let Some(last) = self.last else {
            let first = Reading { at, counts, ticks: self.ticks };
            (self.last, self.rate_from, self.pace_from) = (Some(first), Some(first), Some(first));
            return first.ticks;
        };
        let steps = self.steps(last, at, counts, metres_per_tick);
        let Some(held) = self.held else {
            if steps.iter().all(|step| step.is_plausible) {
                return self.accept(last, at, counts, steps, metres_per_tick);
            }
            return self.hold(last, at, counts, steps, metres_per_tick);
        };
        if at > held.reading.at {
            return self.resolve(last, held, at, counts, metres_per_tick);
        }
        // Counts from before the held ones, or as old, decide nothing.
        let since_held = self.steps(held.reading, at, counts, metres_per_tick);
        let is_from = |steps: &[Step; 2]| steps.iter().all(|step| step.is_plausible);
        if is_from(&steps) {
            sum(last.ticks, steps)
        } else if is_from(&since_held) {
            sum(held.reading.ticks, since_held)
        } else {
            held.reading.ticks
        }
    }

    /// Flips the sign of one encoder's counts from now on; 0 is the left one.
    pub fn reverse(&mut self, wheel: usize) {
        if let Some(is_reversed) = self.is_reversed.get_mut(wheel) {
            *is_reversed = !*is_reversed;
        }
    }

    /// The board restarted with unknown counts: the ticks continue.
    pub fn restart(&mut self) {
        self.ticks = self.held.map_or(self.ticks, |held| held.reading.ticks);
        (self.last, self.held, self.rate_from, self.pace_from) = (None, None, None, None);
        self.too_fast = 0;
    }

    /// What was wrong, each kind a few times at most.
    pub fn take_trouble(&mut self) -> Option<WheelTrouble> {
        self.troubles.pop_front()
    }

    /// Steps across a wrap at 16 bits, and steps that were not rolled.
    #[must_use]
    pub fn counts(&self) -> (u64, u64) {
        (self.unwrapped, self.refused)
    }

    fn steps(&self, from: Reading, at: DeviceTime, counts: [i32; 2], metres_per_tick: [f64; 2]) -> [Step; 2] {
        let since_s = at.seconds_since(from.at);
        let reach_m = self.bound_m_s * since_s.abs() + self.params.step_slack_m;
        let ([left, right], [left_is, right_is]) = (from.counts, self.has_16_bits);
        let ([left_now, right_now], [left_sign, right_sign]) = (counts, self.is_reversed);
        let ([left_m, right_m], [left_rate, right_rate]) = (metres_per_tick, self.rate);
        let reach = |metres: f64, rate: f64| Reach { metres: reach_m, usual_m: rate * since_s * metres };
        [
            Step::new([left, left_now], left_is, left_sign, left_m, reach(left_m, left_rate)),
            Step::new([right, right_now], right_is, right_sign, right_m, reach(right_m, right_rate)),
        ]
    }

    fn accept(
        &mut self,
        from: Reading,
        at: DeviceTime,
        counts: [i32; 2],
        steps: [Step; 2],
        metres_per_tick: [f64; 2],
    ) -> [i64; 2] {
        let now = Reading { at, counts, ticks: sum(from.ticks, steps) };
        for ((wheel, step), has_16_bits) in Wheel::BOTH.into_iter().zip(steps).zip(&mut self.has_16_bits) {
            if step.is_unwrapped {
                *has_16_bits = true;
                self.unwrapped += 1;
                let within_s = at.seconds_since(from.at);
                let trouble =
                    WheelTrouble { at, wheel, what: What::SixteenBits, rolled_m: step.rolled_m, within_s, bound: 0.0 };
                say(&mut self.said, &mut self.troubles, trouble);
            }
        }
        self.last = Some(now);
        self.held = None;
        self.ticks = now.ticks;
        self.measure_rate(now);
        self.measure_pace(now, metres_per_tick);
        now.ticks
    }

    /// Takes the wheels to roll on as before.
    fn hold(
        &mut self,
        last: Reading,
        at: DeviceTime,
        counts: [i32; 2],
        steps: [Step; 2],
        metres_per_tick: [f64; 2],
    ) -> [i64; 2] {
        let within_s = at.seconds_since(last.at);
        let near_m = self.max_speed_m_s * (within_s.abs() + self.params.restart_s);
        let is_near_zero = |(count, metres): (i32, f64)| f64::from(count).abs() * metres <= near_m;
        let mut near_zero = counts.into_iter().zip(metres_per_tick).map(is_near_zero);
        // Counters start again together: then the step of the one that had not counted far only looks possible.
        let start_again = near_zero.all(|is_near| is_near);
        let roll_s = if (0.0..=self.params.bridge_s).contains(&within_s) { within_s } else { 0.0 };
        let mut ticks = last.ticks;
        for ((ticks, step), rate) in ticks.iter_mut().zip(steps).zip(self.rate) {
            let rolled = if start_again || !step.is_plausible { whole(rate * roll_s) } else { step.ticks };
            *ticks = ticks.saturating_add(rolled);
        }
        let reading = Reading { at, counts, ticks };
        let [left, right] = steps;
        let (wheel, rolled_m) =
            if left.is_plausible { (Wheel::Right, right.rolled_m) } else { (Wheel::Left, left.rolled_m) };
        let speed_m_s = steps.map(|step| if within_s > 0.0 { step.rolled_m / within_s } else { f64::NAN });
        let is_impossible = steps.map(|step| !step.is_plausible);
        self.held = Some(Held { reading, wheel, rolled_m, within_s, speed_m_s, is_impossible, alike: 0 });
        self.refused += 1;
        ticks
    }

    /// Decides what the held step was.
    fn resolve(
        &mut self,
        last: Reading,
        held: Held,
        at: DeviceTime,
        counts: [i32; 2],
        metres_per_tick: [f64; 2],
    ) -> [i64; 2] {
        let from_before = self.steps(last, at, counts, metres_per_tick);
        let from_held = self.steps(held.reading, at, counts, metres_per_tick);
        let is_possible = |steps: &[Step; 2]| steps.iter().all(|step| step.is_plausible);
        if is_possible(&from_before) {
            self.say(held, What::WrongValue, 0.0);
            return self.accept(last, at, counts, from_before, metres_per_tick);
        }
        let since_s = at.seconds_since(held.reading.at);
        let speed_m_s = from_held.map(|step| step.rolled_m / since_s);
        let fits = |((before, now), is_impossible): ((f64, f64), bool)| {
            !is_impossible || (before - now).abs() < self.params.same_speed * before.abs().max(now.abs())
        };
        let bridged = held.reading;
        if held.speed_m_s.into_iter().zip(speed_m_s).zip(held.is_impossible).all(fits) {
            if held.alike + 1 < self.params.same_steps {
                let ticks = self.hold(bridged, at, counts, from_held, metres_per_tick);
                self.held = self.held.map(|new| Held { alike: held.alike + 1, ..new });
                return ticks;
            }
            let fastest_m_s =
                speed_m_s.iter().chain(&held.speed_m_s).fold(0.0, |most: f64, speed| most.max(speed.abs()));
            self.bound_m_s = self.bound_m_s.max(self.params.step_speed_factor * fastest_m_s);
            self.say(held, What::TooFast { speed_m_s: fastest_m_s }, self.max_speed_m_s);
            return self.accept(last, at, counts, from_before, metres_per_tick);
        }
        if is_possible(&from_held) {
            let near_m = self.max_speed_m_s * (held.within_s.abs() + self.params.restart_s);
            let counted = held.reading.counts.into_iter().zip(last.counts).zip(metres_per_tick).zip(held.is_impossible);
            let mut jumped = counted.filter(|(_, is_impossible)| *is_impossible);
            let start_again = jumped.all(|(((count, before), metres), _)| {
                count.unsigned_abs() < before.unsigned_abs() && f64::from(count).abs() * metres <= near_m
            });
            self.say(held, if start_again { What::StartAgain } else { What::Jumped }, 0.0);
            self.rate_from = Some(held.reading);
            self.pace_from = Some(held.reading);
            return self.accept(held.reading, at, counts, from_held, metres_per_tick);
        }
        self.say(held, What::Jumped, 0.0);
        self.hold(bridged, at, counts, from_held, metres_per_tick)
    }

    fn measure_rate(&mut self, now: Reading) {
        let Some(from) = self.rate_from else { return };
        let since_s = now.at.seconds_since(from.at);
        if since_s >= self.params.rate_s {
            let rolled = now.ticks.into_iter().zip(from.ticks).map(|(now, before)| now.saturating_sub(before));
            for (rate, ticks) in self.rate.iter_mut().zip(rolled) {
                *rate = ticks as f64 / since_s;
            }
            self.rate_from = Some(now);
        }
    }

    /// Compares the mean speed of the wheels, whatever their directions, with the robot's highest one.
    fn measure_pace(&mut self, now: Reading, metres_per_tick: [f64; 2]) {
        let Some(from) = self.pace_from else { return };
        let since_s = now.at.seconds_since(from.at);
        if since_s < self.params.pace_s {
            return;
        }
        let rolled = now.ticks.into_iter().zip(from.ticks).zip(metres_per_tick);
        let rolled_m: f64 =
            rolled.map(|((now, before), metres)| (now.saturating_sub(before) as f64 * metres).abs()).sum();
        let speed_m_s = 0.5 * rolled_m / since_s;
        self.too_fast = if speed_m_s > self.params.pace_factor * self.max_speed_m_s { self.too_fast + 1 } else { 0 };
        self.pace_from = Some(now);
        if self.too_fast >= self.params.pace_count {
            let trouble = WheelTrouble {
                at: now.at,
                wheel: Wheel::Left,
                what: What::TooFast { speed_m_s },
                rolled_m: 0.5 * rolled_m,
                within_s: since_s,
                bound: self.max_speed_m_s,
            };
            say(&mut self.said, &mut self.troubles, trouble);
        }
    }

    fn say(&mut self, held: Held, what: What, bound: f64) {
        let Held { reading: Reading { at, .. }, wheel, rolled_m, within_s, .. } = held;
        say(&mut self.said, &mut self.troubles, WheelTrouble { at, wheel, what, rolled_m, within_s, bound });
    }
}

/// Queues what was wrong, unless that kind was said often enough.
fn say(said: &mut [u32; What::COUNT], troubles: &mut VecDeque<WheelTrouble>, trouble: WheelTrouble) {
    if let Some(said) = said.get_mut(trouble.what.index())
        && *said < trouble.what.max_said()
    {
        *said += 1;
        troubles.push_back(trouble);
    }
}

fn sum(ticks: [i64; 2], steps: [Step; 2]) -> [i64; 2] {
    let ([left, right], [left_step, right_step]) = (ticks, steps);
    [left.saturating_add(left_step.ticks), right.saturating_add(right_step.ticks)]
}

#[expect(clippy::cast_possible_truncation, reason = "a float's cast stops at the limits")]
fn whole(ticks: f64) -> i64 {
    ticks.round() as i64
}

impl Step {
    fn new([from, to]: [i32; 2], has_16_bits: bool, is_reversed: bool, metres_per_tick: f64, reach: Reach) -> Self {
        let sign = |ticks: i64| if is_reversed { -ticks } else { ticks };
        let rolled_m = |ticks: i64| ticks as f64 * metres_per_tick;
        let whole = i64::from(to.wrapping_sub(from));
        let fits = |range: std::ops::RangeInclusive<i32>| range.contains(&from) && range.contains(&to);
        let may_wrap = fits(0..=0xFFFF) || fits(-0x8000..=0x7FFF);
        #[expect(clippy::cast_possible_truncation, reason = "the low 16 bits are meant")]
        let short = i64::from(whole as i16);
        let is_possible = |ticks: i64| {
            let rolled_m = rolled_m(sign(ticks));
            rolled_m.abs().min((rolled_m - reach.usual_m).abs()) <= reach.metres
        };
        if short != whole && may_wrap && (has_16_bits || !is_possible(whole)) && is_possible(short) {
            let ticks = sign(short);
            return Self { ticks, rolled_m: rolled_m(ticks), is_plausible: true, is_unwrapped: true };
        }
        let ticks = sign(whole);
        Self { ticks, rolled_m: rolled_m(ticks), is_plausible: is_possible(whole), is_unwrapped: false }
    }
}

#[cfg(test)]
mod tests;
