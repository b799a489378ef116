//! The true robot: a differential drive whose sizes differ from the drawing, and two encoders that
//! do not see slip.

use super::home::Grip;
use super::random::Random;
use super::world::World;
use slamd_core::Pose2;
use std::f64::consts::TAU;

/// Length of one step, seconds. Wheel speeds are constant within it.
pub const STEP_S: f64 = 0.005;
/// Length of one step, microseconds.
pub const STEP_US: u64 = 5_000;
/// Radius of both wheels by the drawing, metres: the configuration's default.
pub const NOMINAL_WHEEL_RADIUS_M: f64 = 0.035;
/// Distance between the wheels by the drawing, metres: the configuration's default.
pub const NOMINAL_WHEEL_BASE_M: f64 = 0.26;
/// Encoder ticks per turn of a wheel.
pub const TICKS_PER_TURN: u32 = 1440;
/// Radius of the robot's body, metres.
pub const BODY_RADIUS_M: f64 = 0.17;

/// Relative difference between the true wheels.
const WHEEL_MISMATCH: f64 = 0.01;
/// Relative error of the wheel base.
const BASE_ERROR: f64 = 0.02;
/// Slip of one wheel: standard deviation after one metre, metres. It grows with the square root of
/// the distance.
const SLIP_M: f64 = 0.005;
/// Maximum acceleration: metres per second squared, and radians per second squared.
const ACCELERATION: f64 = 0.8;
const TURN_ACCELERATION: f64 = 4.0;

/// A velocity command.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Twist {
    /// Speed forward, metres per second.
    pub forward_m_s: f64,
    /// Turn rate counter-clockwise, radians per second.
    pub turn_rad_s: f64,
}

/// What a motor is told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum WheelDrive {
    /// The voltage that turns a free wheel at this speed, metres per second.
    Speed(f64),
    /// Nothing: it coasts.
    Coast,
    /// It is short-circuited.
    Brake,
}

impl WheelDrive {
    /// The speed that a wheel tends to, metres per second, and the time constant, seconds.
    const fn tends_to(self) -> (f64, f64) {
        match self {
            Self::Speed(m_s) => (m_s, MOTOR_LAG_S),
            Self::Coast => (0.0, COAST_LAG_S),
            Self::Brake => (0.0, BRAKE_LAG_S),
        }
    }
}

/// Inertia of robot and motors: time constants of a wheel that is driven, that coasts and that is short-circuited, seconds.
const MOTOR_LAG_S: f64 = 0.06;
const COAST_LAG_S: f64 = 0.3;
const BRAKE_LAG_S: f64 = 0.02;
/// Friction stops a wheel that is slower than this, metres per second.
const STICTION_M_S: f64 = 0.002;

/// The true robot.
#[derive(Clone, Debug)]
pub struct Robot {
    /// True radius of the left and the right wheel, metres.
    radius_m: [f64; 2],
    base_m: f64,
    /// Radius, base and ticks per turn that the driver knows.
    known_radius_m: f64,
    known_base_m: f64,
    ticks_per_turn: f64,
    slip_m: f64,
    twist: Twist,
    /// Pose and wheel angles at the beginning of the current step, and the wheels' motion in it.
    world_from_robot: Pose2,
    turned_rad: [f64; 2],
    step: WheelStep,
    random: Random,
}

/// The wheels' motion in one step.
#[derive(Clone, Copy, Debug, Default)]
struct WheelStep {
    /// Radians each wheel turns.
    turns_rad: [f64; 2],
    /// Metres each wheel moves over the floor.
    rolls_m: [f64; 2],
}

impl Robot {
    /// A robot at rest. `odometry_errors` scales its differences from the drawing: 0 is perfect, 1
    /// usual.
    #[must_use]
    pub fn new(world_from_robot: Pose2, odometry_errors: f64, mut random: Random) -> Self {
        let mismatch = 0.5 * WHEEL_MISMATCH * odometry_errors * random.sign();
        let base_error = BASE_ERROR * odometry_errors * random.sign();
        Self {
            radius_m: [1.0 + mismatch, 1.0 - mismatch].map(|scale| scale * NOMINAL_WHEEL_RADIUS_M),
            base_m: NOMINAL_WHEEL_BASE_M * (1.0 + base_error),
            known_radius_m: NOMINAL_WHEEL_RADIUS_M,
            known_base_m: NOMINAL_WHEEL_BASE_M,
            ticks_per_turn: f64::from(TICKS_PER_TURN),
            slip_m: SLIP_M * odometry_errors,
            twist: Twist::default(),
            world_from_robot,
            turned_rad: [0.0; 2],
            step: WheelStep::default(),
            random,
        }
    }

    /// The same robot with other wheels, base and encoders: factors on what the drawing says. The driver knows them.
    #[must_use]
    pub fn scaled(mut self, radius: f64, base: f64, ticks: f64) -> Self {
        self.radius_m = self.radius_m.map(|radius_m| radius_m * radius);
        self.base_m *= base;
        self.known_radius_m *= radius;
        self.known_base_m *= base;
        self.ticks_per_turn *= ticks;
        self
    }

    /// Puts the robot at rest at another pose. The wheels do not turn.
    pub fn carry(&mut self, world_from_robot: Pose2) {
        (self.world_from_robot, self.twist) = (world_from_robot, Twist::default());
        for (turned, turn) in self.turned_rad.iter_mut().zip(self.step.turns_rad) {
            *turned += turn;
        }
        self.step = WheelStep::default();
    }

    /// True radii of the left and the right wheel and the true base, metres.
    #[must_use]
    pub fn true_sizes_m(&self) -> [f64; 3] {
        [self.radius_m[0], self.radius_m[1], self.base_m]
    }

    /// Ends the current step and begins the next, in which the wheels follow `command` within the
    /// maximum acceleration.
    pub fn step(&mut self, command: Twist) {
        self.step_on(command, Grip::FULL);
    }

    /// The same on a floor with this grip.
    pub fn step_on(&mut self, command: Twist, grip: Grip) {
        let follow = |now: f64, wanted: f64, max: f64| now + (wanted - now).clamp(-max * STEP_S, max * STEP_S);
        self.twist.forward_m_s = follow(self.twist.forward_m_s, command.forward_m_s, ACCELERATION);
        self.twist.turn_rad_s = follow(self.twist.turn_rad_s, command.turn_rad_s, TURN_ACCELERATION);
        self.roll(self.speeds_m_s(), grip);
    }

    /// Ends the current step and begins the next, in which motors drive the wheels.
    pub fn step_driven(&mut self, drives: [WheelDrive; 2], grip: Grip) {
        let mut speeds = self.speeds_m_s();
        for (speed, drive) in speeds.iter_mut().zip(drives) {
            let (target, lag_s) = drive.tends_to();
            *speed += (target - *speed) * (1.0 - libm::exp(-STEP_S / lag_s));
            if target == 0.0 && speed.abs() < STICTION_M_S {
                *speed = 0.0;
            }
        }
        let [left, right] = speeds;
        self.twist = Twist { forward_m_s: 0.5 * (left + right), turn_rad_s: (right - left) / self.known_base_m };
        self.roll(speeds, grip);
    }

    /// The wheels' speeds by the drawing, left and right, metres per second.
    #[must_use]
    pub fn speeds_m_s(&self) -> [f64; 2] {
        let half = 0.5 * self.known_base_m * self.twist.turn_rad_s;
        [self.twist.forward_m_s - half, self.twist.forward_m_s + half]
    }

    /// True if the body would press against a surface in the next step: then the wheels slip.
    #[must_use]
    pub fn presses(&self, world: &World) -> bool {
        let here = self.pose(1.0);
        let there_m = world.clearance(here.ahead(self.twist.forward_m_s * STEP_S));
        there_m < BODY_RADIUS_M && there_m < world.clearance(here.position())
    }

    fn roll(&mut self, speeds: [f64; 2], grip: Grip) {
        self.world_from_robot = self.pose(1.0);
        for (turned, turn) in self.turned_rad.iter_mut().zip(self.step.turns_rad) {
            *turned += turn;
        }
        self.step.turns_rad = speeds.map(|speed| speed * STEP_S / self.known_radius_m);
        for wheel in 0..2 {
            let way_m = self.step.turns_rad[wheel] * self.radius_m[wheel];
            self.step.rolls_m[wheel] = way_m + self.slip_m * way_m.abs().sqrt() * self.random.normal();
        }
        if grip != Grip::FULL {
            let [left_m, right_m] = [0, 1].map(|wheel| if grip.spins[wheel] { 0.0 } else { self.step.rolls_m[wheel] });
            let (way_m, half_m) = (0.5 * (left_m + right_m) * grip.forward, 0.5 * (right_m - left_m) * grip.turn);
            self.step.rolls_m = [way_m - half_m, way_m + half_m];
        }
    }

    /// The true pose after `share` (0 to 1) of the current step.
    #[must_use]
    pub fn pose(&self, share: f64) -> Pose2 {
        let [left_m, right_m] = self.step.rolls_m.map(|roll| share * roll);
        self.world_from_robot.rolled(left_m, right_m, self.base_m)
    }

    /// Ticks of the left and the right encoder after `share` (0 to 1) of the current step.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "2^31 ticks are 300 km")]
    pub fn ticks(&self, share: f64) -> [i32; 2] {
        [0, 1].map(|wheel| {
            let angle_rad = self.turned_rad[wheel] + share * self.step.turns_rad[wheel];
            libm::floor(angle_rad / TAU * self.ticks_per_turn) as i32
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;
    use slamd_core::Config;

    fn driven(odometry_errors: f64, seed: u64, twist: Twist, seconds: u32) -> Robot {
        let mut robot = Robot::new(Pose2::default(), odometry_errors, Random::new(seed, Stream::Robot));
        (0..seconds * 200).for_each(|_| robot.step(twist));
        robot
    }

    /// The wheels' travel according to the encoders and the drawing, metres.
    fn encoder_travel(robot: &Robot) -> [f64; 2] {
        robot.ticks(1.0).map(|ticks| f64::from(ticks) / f64::from(TICKS_PER_TURN) * TAU * NOMINAL_WHEEL_RADIUS_M)
    }

    #[test]
    fn the_drawing_is_the_default_configuration() {
        let robot = Config::default().robot;
        assert!((robot.wheel_radius_m - NOMINAL_WHEEL_RADIUS_M).abs() < 1e-12);
        assert!((robot.wheel_base_m - NOMINAL_WHEEL_BASE_M).abs() < 1e-12);
    }

    #[test]
    fn a_perfect_robots_pose_agrees_with_its_encoders() {
        let robot = driven(0.0, 1, Twist { forward_m_s: 0.3, turn_rad_s: 0.4 }, 10);
        let [left_m, right_m] = encoder_travel(&robot);
        let turn = (right_m - left_m) / NOMINAL_WHEEL_BASE_M;
        let truth = robot.pose(1.0).theta_rad;
        assert!(slamd_core::wrap_angle(turn - truth).abs() < 0.002, "{turn} {truth}");
        assert!((0.5 * (left_m + right_m) - 3.0).abs() < 0.06);
    }

    #[test]
    fn the_usual_robot_deviates_as_stated() {
        for seed in 0..4 {
            let [left_m, right_m, base_m] = driven(1.0, seed, Twist::default(), 0).true_sizes_m();
            assert!(((left_m / right_m - 1.0).abs() - 0.01).abs() < 1e-4);
            assert!(((base_m / NOMINAL_WHEEL_BASE_M - 1.0).abs() - 0.02).abs() < 1e-9);
        }
    }

    #[test]
    fn slip_has_the_stated_deviation() {
        let straight = Twist { forward_m_s: 0.3, turn_rad_s: 0.0 };
        let off: Vec<f64> = (0..100)
            .map(|seed| {
                let robot = driven(1.0, seed, straight, 2);
                let [left_m, right_m, base_m] = robot.true_sizes_m();
                let [left_turns, right_turns] = encoder_travel(&robot).map(|way| way / NOMINAL_WHEEL_RADIUS_M);
                robot.pose(1.0).theta_rad - (right_turns * right_m - left_turns * left_m) / base_m
            })
            .collect();
        let rms = (off.iter().map(|x| x * x).sum::<f64>() / off.len() as f64).sqrt();
        // Two wheels slip by 5 mm per √m, after 0.54 m, on a base of 0.26 m.
        let expected = SLIP_M * (2.0 * 0.54_f64).sqrt() / NOMINAL_WHEEL_BASE_M;
        assert!((rms / expected - 1.0).abs() < 0.25, "{rms} {expected}");
    }

    #[test]
    fn poses_within_a_step_are_interpolated() {
        let robot = driven(1.0, 3, Twist { forward_m_s: 0.3, turn_rad_s: 1.0 }, 3);
        let (begin, middle, end) = (robot.pose(0.0), robot.pose(0.5), robot.pose(1.0));
        let whole = (end.position() - begin.position()).norm();
        assert!(((middle.position() - begin.position()).norm() / whole - 0.5).abs() < 0.01);
    }
}
