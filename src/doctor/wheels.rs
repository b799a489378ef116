//! The wheels: whether both encoders count, in the right direction, equally, and on the right side.
//!
//! Encoders alone cannot distinguish a push straight ahead with one wheel reversed from a rotation on the spot. So the user pushes the robot
//! straight ahead and then turns it left, and each finding states its condition.

use super::finding::{Finding, Level};
use slamd_core::{
    Board, DeviceTime,
    config::RobotConfig,
    stages::{AlignParams, WheelSteps, Widener},
};
use slamd_protocol::Setting;
use std::f64::consts::TAU;

/// Time step for comparing counts, seconds of board time.
const STEP_S: f64 = 0.25;
/// Least path that counts as motion, mean of both wheels, metres.
const MIN_PATH_M: f64 = 0.1;
/// Largest path of a test by hand, metres; a longer path is a drive, which turns both ways.
const MAX_PUSHED_M: f64 = 2.0;
/// A wheel with less than this share of the other's path is dead.
const DEAD: f64 = 0.02;
/// Largest relative difference of the wheels on a straight path.
const MAX_UNEQUAL: f64 = 0.15;

/// Ticks by kind of step, as `[left, right]`.
#[derive(Default)]
struct Rolled {
    forward: [f64; 2],
    backward: [f64; 2],
    /// Left backwards, right forwards: a left turn if the encoders are correct.
    left: [f64; 2],
    right: [f64; 2],
}

/// Evidence about the wheels.
pub(super) struct WheelEvidence {
    widener: Widener,
    /// Steps that no wheel can roll are left out, as the estimator does.
    steps: WheelSteps,
    last: Option<(DeviceTime, [i64; 2])>,
    rolled: Rolled,
    /// Absolute ticks of each wheel.
    path: [f64; 2],
}

impl WheelEvidence {
    pub(super) fn new(robot: &RobotConfig) -> Self {
        Self {
            widener: Widener::default(),
            steps: WheelSteps::new(robot.max_speed_m_s, AlignParams::default()),
            last: None,
            rolled: Rolled::default(),
            path: [0.0; 2],
        }
    }

    /// Takes counts of wheels that roll `metres_per_tick`, latched at `t_us`.
    pub(super) fn counts(&mut self, t_us: u32, left: i32, right: i32, metres_per_tick: f64) {
        let Some(at) = self.widener.widen(t_us) else { return self.restart() };
        let now = self.steps.add(at, [left, right], [metres_per_tick; 2]);
        let (then, before) = *self.last.get_or_insert((at, now));
        // Skips a late message, whose counts are older than the last ones.
        if at.seconds_since(then) < STEP_S {
            return;
        }
        self.last = Some((at, now));
        let ([left, right], [last_left, last_right]) = (now, before);
        let step = [(left - last_left) as f64, (right - last_right) as f64];
        let [left, right] = step;
        let kind = match (left >= 0.0, right >= 0.0) {
            (true, true) => &mut self.rolled.forward,
            (false, false) => &mut self.rolled.backward,
            (false, true) => &mut self.rolled.left,
            (true, false) => &mut self.rolled.right,
        };
        for ((sum, path), step) in kind.iter_mut().zip(&mut self.path).zip(step) {
            *sum += step.abs();
            *path += step.abs();
        }
    }

    /// The counts restarted.
    pub(super) fn restart(&mut self) {
        self.widener.reset();
        self.steps.restart();
        self.last = None;
    }

    /// Path of the wheels, mean of both, metres.
    pub(super) fn path_m(&self, robot: &RobotConfig, board: &Board) -> f64 {
        mean(self.path) * metres_per_tick(robot, board)
    }

    /// The findings; `is_set` returns whether a setting of the board is on.
    pub(super) fn findings(
        &self,
        robot: &RobotConfig,
        board: &Board,
        is_set: impl Fn(Setting) -> bool,
    ) -> Vec<Finding> {
        let path_m = self.path_m(robot, board);
        if path_m < MIN_PATH_M {
            return vec![Finding::new(
                Level::Note,
                "wheels.still",
                "the robot did not move, so its wheels and stuck sensors cannot be checked",
                "push the robot forward 30 cm while this runs, then turn it left on the spot",
            )];
        }
        let toggled = |setting: Setting| format!("{} = {}", setting.name(), !is_set(setting));
        if let Some(finding) = self.dead(path_m) {
            return vec![finding];
        }
        let Rolled { forward, backward, left, right } = &self.rolled;
        let (ahead, back) = (mean(*forward), mean(*backward));
        let (to_left, to_right) = (mean(*left), mean(*right));
        let text = format!("if the robot was pushed straight ahead, over {path_m:.1} m");
        if back > ahead.max(to_left).max(to_right) {
            return vec![Finding::new(
                Level::Warning,
                "wheels.both_reversed",
                format!("both wheels count down; {text}, both are reversed"),
                format!(
                    "set [board] {} and {} in the robot's TOML (--config)",
                    toggled(Setting::LeftReversed),
                    toggled(Setting::RightReversed)
                ),
            )];
        }
        if to_left.max(to_right) > ahead {
            let (setting, which, id) = if to_left > to_right {
                (Setting::LeftReversed, "left", "wheels.left_reversed")
            } else {
                (Setting::RightReversed, "right", "wheels.right_reversed")
            };
            return vec![Finding::new(
                Level::Warning,
                id,
                format!("the {which} wheel counts down while the other counts up; {text}, it is reversed"),
                format!("set [board] {} in the robot's TOML (--config)", toggled(setting)),
            )];
        }
        let mut findings = vec![equal(*forward, path_m)];
        findings.extend(self.sides(robot, board, path_m, &toggled(Setting::WheelsSwapped)));
        findings
    }

    fn dead(&self, path_m: f64) -> Option<Finding> {
        let [left, right] = self.path;
        let (which, pins) = if left < DEAD * right {
            ("left", "D21 and D20")
        } else if right < DEAD * left {
            ("right", "D19 and D18")
        } else {
            return None;
        };
        Some(Finding::new(
            Level::Problem,
            "wheels.dead",
            format!("the {which} wheel's encoder does not count, the other rolled {:.1} m", 2.0 * path_m),
            format!("check the {which} encoder's supply and its channels A and B (Arduino Mega: {pins})"),
        ))
    }

    /// Whether left and right are swapped, if the robot turned.
    fn sides(&self, robot: &RobotConfig, board: &Board, path_m: f64, swapped: &str) -> Option<Finding> {
        let scale = metres_per_tick(robot, board);
        let (left_m, right_m) = (mean(self.rolled.left) * scale, mean(self.rolled.right) * scale);
        let degrees = |rolled_m: f64| (2.0 * rolled_m / robot.wheel_base_m).to_degrees();
        let (left_deg, right_deg) = (degrees(left_m), degrees(right_m));
        if left_deg.max(right_deg) < 30.0 {
            let text = "the robot was not turned on the spot, so swapped wheels cannot be detected";
            let fix = "after the push, turn the robot left (counter-clockwise) by a quarter while this runs";
            return Some(Finding::new(Level::Note, "wheels.sides", text, fix));
        }
        let is_test = path_m < MAX_PUSHED_M && left_deg.min(right_deg) < 0.2 * left_deg.max(right_deg);
        if !is_test {
            return None;
        }
        Some(if left_deg > right_deg {
            Finding::ok("wheels.sides", format!("turned left by {left_deg:.0} degrees, as the wheels count"))
        } else {
            Finding::new(
                Level::Warning,
                "wheels.swapped",
                format!(
                    "turned right by {right_deg:.0} degrees, as the wheels count; if it was turned left, they are swapped"
                ),
                format!("if it was turned left, set [board] {swapped} in the robot's TOML (--config)"),
            )
        })
    }
}

/// Compares the wheels' counts while both roll forwards.
fn equal(forward: [f64; 2], path_m: f64) -> Finding {
    let [left, right] = forward;
    let ratio = left / right.max(1.0);
    let text = format!("both wheels count up; left over right is {ratio:.3} over {path_m:.1} m");
    if (1.0 - MAX_UNEQUAL..=1.0 / (1.0 - MAX_UNEQUAL)).contains(&ratio) {
        return Finding::ok("wheels.ahead", text);
    }
    let fix = "if it was pushed straight: one encoder loses edges (check its channel B and its magnet), or the wheels differ in size";
    Finding::new(Level::Warning, "wheels.unequal", text, fix)
}

fn mean([left, right]: [f64; 2]) -> f64 {
    0.5 * (left + right)
}

/// Metres per tick; without a configured or reported number of ticks, the protocol's default.
pub(super) fn metres_per_tick(robot: &RobotConfig, board: &Board) -> f64 {
    let ticks = robot.ticks_per_turn.or_else(|| board.ticks_per_turn());
    let ticks = ticks.map_or_else(|| f64::from(Setting::TicksPerTurn.default()), f64::from);
    TAU * robot.wheel_radius_m / ticks
}
