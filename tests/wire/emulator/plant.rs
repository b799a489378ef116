//! The world around the emulated board: a robot that drives through the flat, and what its sonars and encoders put on the pins.

#![allow(unreachable_pub, reason = "a test's module")]

use super::emulation::Wiring;
use slamd_core::{Pose2, Ring};
use slamd_sim::explore::Explorer;
use slamd_sim::home::Grip;
use slamd_sim::random::{Random, Stream};
use slamd_sim::robot::{Robot, STEP_S, STEP_US, Twist, WheelDrive};
use slamd_sim::sonar::{BeamShape, reading};
use slamd_sim::world::World;
use std::f64::consts::PI;

/// An HC-SR04 sings for this long before its echo pin rises, and gives up this long after that.
const RISE_US: u64 = 450;
const SILENCE_US: u64 = 38_000;
/// Speed of sound in air of 20 degrees Celsius.
const SOUND_M_S: f64 = 343.42;
const COMMAND_US: u64 = 50_000;

/// A pulse on an echo pin.
#[derive(Clone, Copy, Debug)]
pub struct Pulse {
    pub sensor: usize,
    pub rise_us: u64,
    pub fall_us: u64,
}

/// The wheels' speed at full voltage, metres per second.
const FULL_M_S: f64 = 1.0;

/// What a bridge makes of its pins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bridge {
    /// Both ends of the motor are connected.
    Brake,
    /// The mean voltage as a share of the full one.
    Voltage(f64),
}

/// World, robot and acoustics.
pub struct Plant {
    world: World,
    ring: Ring,
    trigger_lines: usize,
    /// Each sensor's latest pulse on its echo pin, microseconds; 0 before the first.
    pub pulses_us: Vec<u64>,
    robot: Robot,
    explorer: Explorer,
    noise: Random,
    command: Twist,
    bridges: [Bridge; 2],
    /// A bridge has had a voltage: from then on the motors move the robot.
    is_driven: bool,
    /// Time of the robot's present step, microseconds since the board's start.
    step_us: u64,
    drives_since_us: Option<u64>,
}

impl Plant {
    /// The same world and robot as the simulator's with this seed.
    pub fn new(seed: u64, wiring: Wiring) -> Self {
        let world = World::named("flat").expect("a built-in world");
        let random = |stream| Random::new(seed, stream);
        let heading_rad = world.start_heading_rad.unwrap_or_else(|| random(Stream::Start).uniform(-PI, PI));
        let start = Pose2::new(world.start.x, world.start.y, heading_rad);
        Self {
            ring: Ring::circle(wiring.sensors, 0.15, BeamShape::Cone.half_angle_rad(), 4),
            trigger_lines: usize::from(wiring.trigger_lines),
            pulses_us: vec![0; usize::from(wiring.sensors)],
            robot: Robot::new(start, 1.0, random(Stream::Robot)),
            explorer: Explorer::new(&world, random(Stream::Explore)),
            noise: random(Stream::Sonar),
            command: Twist::default(),
            bridges: [Bridge::Brake; 2],
            is_driven: false,
            step_us: 0,
            drives_since_us: None,
            world,
        }
    }

    /// The same with a robot that stands until its motors drive it.
    pub fn standing(mut self) -> Self {
        self.is_driven = true;
        self
    }

    /// What the bridges do from now on.
    pub fn bridges(&mut self, bridges: [Bridge; 2]) {
        self.bridges = bridges;
        self.is_driven |= bridges.iter().any(|bridge| matches!(bridge, Bridge::Voltage(share) if *share != 0.0));
    }

    /// The wheels' speeds, left and right, metres per second.
    pub fn wheel_speeds_m_s(&self) -> [f64; 2] {
        self.robot.speeds_m_s()
    }

    /// Metres from the middle of the robot to the nearest surface.
    pub fn clearance_m(&self) -> f64 {
        self.world.clearance(self.robot.pose(0.0).position())
    }

    /// Lets the world run on to `us`.
    pub fn run_until(&mut self, us: u64) {
        while self.step_us + STEP_US <= us {
            if let Some(since_us) = self.drives_since_us
                && (self.step_us - since_us).is_multiple_of(COMMAND_US)
            {
                let seconds = self.step_us as f64 * 1e-6;
                self.command = self.explorer.command(&self.world, self.robot.pose(0.0), seconds);
            }
            if self.is_driven {
                let grip =
                    if self.robot.presses(&self.world) { Grip { forward: 0.0, ..Grip::FULL } } else { Grip::FULL };
                let drives = self.bridges.map(|bridge| match bridge {
                    Bridge::Brake => WheelDrive::Brake,
                    Bridge::Voltage(0.0) => WheelDrive::Coast,
                    Bridge::Voltage(share) => WheelDrive::Speed(FULL_M_S * share),
                });
                self.robot.step_driven(drives, grip);
            } else {
                self.robot.step(self.command);
            }
            self.step_us += STEP_US;
        }
    }

    /// Encoder edges of the left and the right wheel at `us`, which is not before the last.
    pub fn ticks(&self, us: u64) -> [i32; 2] {
        self.robot.ticks(self.share(us))
    }

    /// Where the robot truly is at `us`.
    pub fn pose(&self, us: u64) -> Pose2 {
        self.robot.pose(self.share(us))
    }

    /// The sonars on these trigger lines are triggered at `us`: the robot drives from the first time on.
    pub fn ping(&mut self, us: u64, lines: u32) -> Vec<Pulse> {
        self.drives_since_us.get_or_insert(self.step_us);
        let mut pulses = Vec::new();
        for sensor in (0..self.ring.len()).filter(|sensor| lines >> (sensor % self.trigger_lines) & 1 == 1) {
            let mounting = self.ring.mountings[sensor].robot_from_sensor;
            let share = self.share(us);
            let distance = |later_s: f64| {
                BeamShape::Cone.distance(&self.world, self.robot.pose(share + later_s / STEP_S) * mounting)
            };
            let true_m = distance(0.0).and_then(|range_m| distance(range_m / SOUND_M_S));
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a time of flight")]
            let flight_us = reading(true_m, &mut self.noise).map(|range_m| (2e6 * range_m / SOUND_M_S).round() as u64);
            let rise_us = us + RISE_US;
            self.pulses_us[sensor] = flight_us.unwrap_or(SILENCE_US);
            pulses.push(Pulse { sensor, rise_us, fall_us: rise_us + flight_us.unwrap_or(SILENCE_US) });
        }
        pulses
    }

    fn share(&self, us: u64) -> f64 {
        (us.saturating_sub(self.step_us)) as f64 / STEP_US as f64
    }
}
