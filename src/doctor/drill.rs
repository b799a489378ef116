//! The drill: the robot is pushed straight ahead by 30 cm, then turned left on the spot. What the wheels count is compared with what was
//! asked for and with what the walls show.
//!
//! The first leg is the first motion, the second the next one with another pattern of signs. Only a drill by hand is judged: a robot that
//! drives by itself is checked by the pipeline.

mod ring_turn;
mod walls;

use ring_turn::ring_turn;
use slamd_core::{Ring, Sweep, wrap_angle};
use std::f64::consts::FRAC_PI_4;
use walls::{direction, is_supported, scale, slope, turns_left};

/// The push that the drill asks for, metres.
pub(super) const PUSH_M: f64 = 0.3;
/// Counted pushes within these bounds agree with [`PUSH_M`]: a person has no better ruler.
const PUSHED_M: [f64; 2] = [0.2, 0.45];
/// Least travel of a leg, mean of both wheels, metres.
const MIN_LEG_M: f64 = 0.05;
/// Least counted turn that the walls can tell the direction of, radians.
const MIN_TURN_RAD: f64 = 0.6;
/// A longer path is a drive, metres.
const MAX_PATH_M: f64 = 3.0;
/// A person who pushes lets the robot stand before, seconds, and pushes it straight: least ratio of both wheels' travel.
const MIN_REST_S: f64 = 0.8;
const MIN_EVEN: f64 = 0.75;
/// Sweeps kept of each leg.
const MAX_SWEEPS: usize = 300;
/// Travel of a wheel within a sweep that is none, metres.
const STILL_M: f64 = 0.0015;
/// A scale within these bounds agrees.
const SAME: [f64; 2] = [0.75, 1.33];
/// A direction of travel that is farther from sensor bearing zero means that the ring is turned.
const TURNED_RAD: f64 = 0.7;
/// A ring that is turned by less, by where sensors face walls, is mounted as well as people can, radians.
const MIN_TURN_OF_RING_RAD: f64 = 0.14;
/// A turned ring this near to a multiple of 45 degrees is turned by that, radians.
const NEAR_RAD: f64 = 0.25;

/// One leg of the drill.
#[derive(Clone, Debug, Default)]
struct Leg {
    /// Signs of left and right wheel.
    signs: [bool; 2],
    /// Signed travel of both wheels, metres.
    rolled_m: [f64; 2],
    /// Mean travel so far, metres, and the ranges by sensor.
    sweeps: Vec<(f64, Vec<f64>)>,
}

impl Leg {
    fn length_m(&self) -> f64 {
        0.5 * self.rolled_m.iter().map(|m| m.abs()).sum::<f64>()
    }

    /// True if both wheels rolled alike: straight ahead, or on the spot.
    fn is_even(&self) -> bool {
        let [left, right] = self.rolled_m.map(f64::abs);
        left.min(right) > MIN_EVEN * left.max(right)
    }
}

/// What the wheels and the walls say of the drill.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DrillResult {
    /// Signed travel of the left and the right wheel during the push, metres as counted.
    pub pushed_m: Option<[f64; 2]>,
    /// The same during the turn.
    pub turned_m: Option<[f64; 2]>,
    /// Direction of the push by the approaching and receding walls, radians counter-clockwise from sensor bearing zero.
    pub towards_rad: Option<f64>,
    /// How much the walls ahead and behind moved per counted metre.
    pub walls_per_counted: Option<f64>,
    /// True if the walls show a left turn, by the bearings of the ring.
    pub walls_turn_left: Option<bool>,
    /// How far the ring is turned counter-clockwise by where its sensors face walls, radians, modulo a quarter turn.
    pub ring_turn_rad: Option<f64>,
}

/// What a drill shows to be wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mistake {
    /// The wheels count this many times the travel.
    WheelScale(f64),
    /// The ranges are this many times the true ones.
    RangeScale(f64),
    /// The ring is turned counter-clockwise, radians.
    RingTurned(f64),
    /// The wheels are swapped.
    Swapped,
    /// The sensors are numbered the other way round.
    Mirrored,
}

/// Follows the drill.
#[derive(Clone, Debug, Default)]
pub struct Drill {
    base_m: f64,
    /// The push, then the turn.
    legs: Vec<Leg>,
    path_m: f64,
    spun_rad: f64,
    still_s: f64,
    /// How long it stood before the push.
    rested_s: f64,
    before: Vec<f64>,
}

impl Drill {
    /// A drill of a robot with this distance between its wheels, metres.
    #[must_use]
    pub fn new(base_m: f64) -> Self {
        Self { base_m, ..Self::default() }
    }

    /// Takes the next sweep.
    pub fn sweep(&mut self, sweep: &Sweep) {
        let rolled = [sweep.left_m, sweep.right_m];
        let step_m = 0.5 * rolled.iter().map(|m| m.abs()).sum::<f64>();
        self.path_m += step_m;
        self.spun_rad += (sweep.right_m - sweep.left_m).abs() / self.base_m;
        let ranges: Vec<f64> = sweep.beams.iter().map(|beam| beam.range_m).collect();
        if step_m < STILL_M {
            self.still_s += sweep.elapsed_s;
            self.before = ranges;
            return;
        }
        if self.legs.is_empty() {
            self.rested_s = self.rested_s.max(self.still_s);
        }
        self.still_s = 0.0;
        let signs = rolled.map(|m| m >= 0.0);
        // An arc of one wheel says nothing about the other.
        let is_clear = rolled.iter().all(|m| m.abs() > 0.3 * step_m);
        if is_clear && self.legs.last().is_none_or(|leg| leg.signs != signs) {
            if self.legs.last().is_some_and(|leg| leg.length_m() < MIN_LEG_M) {
                self.legs.pop();
            }
            if self.legs.last().is_none_or(|leg| leg.signs != signs) && self.legs.len() < 2 {
                let first = (0.0, std::mem::take(&mut self.before));
                self.legs.push(Leg { signs, sweeps: vec![first], ..Leg::default() });
            }
        }
        if let Some(leg) = self.legs.last_mut().filter(|leg| leg.signs == signs || !is_clear) {
            for (sum, step) in leg.rolled_m.iter_mut().zip(rolled) {
                *sum += step;
            }
            if leg.sweeps.len() < MAX_SWEEPS {
                leg.sweeps.push((leg.length_m(), ranges.clone()));
            }
        }
        self.before = ranges;
    }

    /// True while the motion so far may be a drill by hand.
    #[must_use]
    pub fn is_by_hand(&self) -> bool {
        self.path_m < MAX_PATH_M
    }

    /// Counted path, mean of both wheels, metres, and counted turning, radians, both whichever way.
    #[must_use]
    pub const fn moved(&self) -> (f64, f64) {
        (self.path_m, self.spun_rad)
    }

    /// Seconds since the robot last moved.
    #[must_use]
    pub const fn still_s(&self) -> f64 {
        self.still_s
    }

    /// True once both legs are done and the robot has stood for a while.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.legs.len() == 2 && self.turned_rad() > MIN_TURN_RAD && self.still_s > 2.0
    }

    /// Counted turn of the second leg, radians, whichever way.
    #[must_use]
    pub fn turned_rad(&self) -> f64 {
        self.legs.get(1).map_or(0.0, |leg| 2.0 * leg.length_m() / self.base_m)
    }

    /// What to do next, with what was counted so far.
    #[must_use]
    pub fn instruction(&self) -> String {
        if !self.is_by_hand() {
            return "it drives by itself".into();
        }
        match self.legs.as_slice() {
            [] => "now push it straight forward 30 cm: counted 0 cm".into(),
            [push] if self.still_s < 1.0 || push.length_m() < MIN_LEG_M => {
                let centimetres = 100.0 * push.rolled_m.iter().sum::<f64>() / 2.0;
                format!("now push it straight forward 30 cm: counted {centimetres:.0} cm")
            }
            [_] => "now turn it left on the spot, one full turn: counted 0 degrees".into(),
            _ => {
                let turned_deg = self.turned_rad().to_degrees();
                if self.is_done() {
                    format!("done: counted {turned_deg:.0} degrees; let it stand")
                } else {
                    format!("now turn it left on the spot, one full turn: counted {turned_deg:.0} degrees")
                }
            }
        }
    }

    /// What the drill shows so far; nothing of a drive.
    #[must_use]
    pub fn result(&self, ring: &Ring) -> DrillResult {
        if !self.is_by_hand() {
            return DrillResult::default();
        }
        let legs: Vec<&Leg> = self.legs.iter().filter(|leg| leg.length_m() >= MIN_LEG_M).collect();
        let (push, turn) = (legs.first(), legs.get(1));
        let bearings: Vec<f64> = ring.mountings.iter().map(|mounting| mounting.robot_from_sensor.theta_rad).collect();
        let is_asked = |leg: &&&Leg| self.rested_s > MIN_REST_S && leg.is_even();
        let slopes: Vec<(f64, f64)> = push.filter(is_asked).map_or_else(Vec::new, |push| {
            let slope = |sensor: usize| slope(push.sweeps.iter().filter_map(|(s, r)| Some((*s, *r.get(sensor)?))));
            bearings.iter().enumerate().filter_map(|(sensor, bearing)| Some((*bearing, slope(sensor)?))).collect()
        });
        let towards_rad = direction(&slopes).filter(|towards| is_supported(&slopes, *towards));
        DrillResult {
            pushed_m: push.map(|leg| leg.rolled_m),
            turned_m: turn.map(|leg| leg.rolled_m),
            towards_rad,
            walls_per_counted: towards_rad.and_then(|towards| scale(&slopes, towards)),
            walls_turn_left: turn.filter(is_asked).and_then(|turn| turns_left(turn, &bearings, self.base_m)),
            ring_turn_rad: turn.filter(is_asked).and_then(|turn| ring_turn(&slopes, turn, ring, self.base_m)),
        }
    }
}

impl DrillResult {
    /// The mistakes that would explain it, if the robot was pushed forward and turned left as asked.
    #[must_use]
    pub fn mistakes(&self) -> Vec<Mistake> {
        let mut mistakes = Vec::new();
        if let (Some(pushed_m), Some(walls)) = (self.pushed_m, self.walls_per_counted)
            && !(SAME[0]..=SAME[1]).contains(&walls)
        {
            let counted_m = 0.5 * pushed_m.iter().map(|m| m.abs()).sum::<f64>();
            let is_asked = |m: f64| (PUSHED_M[0]..=PUSHED_M[1]).contains(&m);
            // The person's 30 cm tell whether the wheels or the ranges are wrong.
            if is_asked(counted_m) && !is_asked(counted_m * walls) {
                mistakes.push(Mistake::RangeScale(walls));
            } else {
                mistakes.push(Mistake::WheelScale(simple_factor(1.0 / walls)));
            }
        }
        if let Some(towards) = self.towards_rad.filter(|towards| towards.abs() > TURNED_RAD) {
            // Rings are mounted at the corners of a robot; the directions of a few sensors tell no more.
            let eighth = (-towards / FRAC_PI_4).round() * FRAC_PI_4;
            let turned = if (towards + eighth).abs() < NEAR_RAD { eighth } else { -towards };
            mistakes.push(Mistake::RingTurned(wrap_angle(turned)));
        } else if let Some(turned) = self.ring_turn_rad.filter(|turned| turned.abs() > MIN_TURN_OF_RING_RAD)
            && mistakes.is_empty()
        {
            mistakes.push(Mistake::RingTurned(turned));
        }
        if let (Some(wheels_left), Some(walls_left)) = (self.wheels_turn_left(), self.walls_turn_left) {
            match (wheels_left, walls_left) {
                (false, true) => mistakes.push(Mistake::Swapped),
                (true, false) => mistakes.push(Mistake::Mirrored),
                _ => {}
            }
        }
        mistakes
    }

    /// Which wheels count backwards, if the robot was pushed forward.
    #[must_use]
    pub fn reversed(&self) -> Option<[bool; 2]> {
        self.pushed_m.map(|rolled| rolled.map(|m| m < 0.0))
    }

    /// True if the wheels count a left turn, signs corrected by the push; none if they count no turn.
    #[must_use]
    pub fn wheels_turn_left(&self) -> Option<bool> {
        let (reversed, turned) = (self.reversed()?, self.turned_m?);
        let [left, right] = [0, 1].map(|wheel: usize| {
            let rolled = turned.get(wheel).copied().unwrap_or_default();
            if reversed.get(wheel) == Some(&true) { -rolled } else { rolled }
        });
        (left * right < 0.0).then_some(right > left)
    }
}

/// The simple factor that a measured one is within a person's 30 cm: edges for pulses are 4 or 2, a gear is a whole number.
#[must_use]
pub fn simple_factor(factor: f64) -> f64 {
    let simple = [0.25, 1.0 / 3.0, 0.5, 1.0, 2.0, 3.0, 4.0];
    let is_near = |simple: &f64| libm::log(factor / simple).abs() < 0.1;
    simple.into_iter().find(is_near).unwrap_or_else(|| (factor * 1e3).round() / 1e3)
}

#[cfg(test)]
mod tests;
