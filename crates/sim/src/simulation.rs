//! The simulated session: world, robot, beams, faults, board and line, stepped together.

mod config;
mod driven;

pub use config::SimConfig;

use super::board::{Board, SLOT_US};
use super::encoder::{EncoderFault, Encoders};
use super::explore::Explorer;
use super::fault::{Faults, Reading, SensorFault};
use super::home::{Grip, Life, Noise, echo};
use super::link::Link;
use super::misfit::Misfit;
use super::random::{Random, Stream};
use super::robot::{Robot, STEP_S, STEP_US, Twist};
use super::robot_fault::{Act, Hands, Misbuilt, RobotFault};
use super::sonar::{BeamShape, reading};
use super::world::World;
use slamd_capture::Record;
use slamd_core::{Pose2, Ring, Timestamp};
use slamd_protocol::{FrameEncoder, Message, VERSION_MAJOR, VERSION_MINOR};
use std::collections::VecDeque;
use std::f64::consts::PI;
use std::time::Duration;

/// Radius of the sensors' circle, metres.
const RING_RADIUS_M: f64 = 0.15;
/// Groups of the ring: four slots make 10 sweeps a second.
const GROUPS: u8 = 4;
/// Periods of the encoder, the motion and the status messages, microseconds.
const ENCODER_US: u64 = 20_000;
const MOTION_US: u64 = 100_000;
const STATUS_US: u64 = 1_000_000;
/// End of the board's boot, and the period of its Hello until the host answers.
const BOOT: Timestamp = Timestamp::from_us(100_000);
const HELLO_US: u64 = 100_000;
/// Period of the driver's commands.
const COMMAND_US: u64 = 50_000;
/// Speed of sound for the sensor's motion during the flight. Temperature matters little here.
const SOUND_M_S: f64 = 344.0;

/// A running simulation.
#[derive(Debug)]
pub struct Simulation {
    world: World,
    beam: BeamShape,
    duration: Timestamp,
    robot: Robot,
    explorer: Explorer,
    sonar_noise: Random,
    /// What moves in a random home, and what disturbs its readings.
    life: Option<(Life, Noise)>,
    misfits: Vec<Misfit>,
    misbuilt: Misbuilt,
    hands: Hands,
    is_lifted: bool,
    seed: u64,
    faults: Faults,
    encoders: Encoders,
    board: Board,
    link: Link,
    command: Twist,
    /// The robot moves only as the host commands, from the first DRIVE on or from the beginning.
    is_host_driven: bool,
    now_us: u64,
    streaming_since_us: Option<u64>,
    ready: Option<(u64, slamd_protocol::FrameBuf)>,
    truths: VecDeque<(Timestamp, Pose2)>,
}

impl Simulation {
    /// The start of a session: the board boots and sends its Hello.
    #[must_use]
    pub fn new(config: SimConfig) -> Self {
        let random = |stream| Random::new(config.seed, stream);
        let heading_rad = config.world.start_heading_rad.unwrap_or_else(|| random(Stream::Start).uniform(-PI, PI));
        let start = Pose2::new(config.world.start.x, config.world.start.y, heading_rad);
        let mut fault_random = random(Stream::Fault);
        let mut schedule = config.mix.faults(config.sensors, &mut fault_random);
        schedule.extend(config.faults);
        let ring =
            Ring::circle(config.sensors, RING_RADIUS_M, config.beam.half_angle_rad(), GROUPS.min(config.sensors));
        let mut simulation = Self {
            beam: config.beam,
            duration: Timestamp::from_us(microseconds(config.duration_s)),
            robot: Robot::new(start, config.odometry_errors, random(Stream::Robot)),
            explorer: Explorer::new(&config.world, random(Stream::Explore)),
            sonar_noise: random(Stream::Sonar),
            life: config.world.home.as_ref().map(|home| {
                let life = Life::new(&config.world, home, random(Stream::Life));
                (life, Noise::new(random(Stream::Acoustics)))
            }),
            misfits: vec![Misfit::default(); usize::from(config.sensors)],
            misbuilt: Misbuilt::new(&[], random(Stream::RobotFault)),
            hands: Hands::new(&[], random(Stream::RobotFault)),
            is_lifted: false,
            seed: config.seed,
            faults: Faults::new(schedule, config.sensors, fault_random),
            encoders: Encoders::default(),
            board: Board::new(ring, config.clock_drift_ppm, random(Stream::Board)),
            link: Link::new(config.link, random(Stream::Link)),
            command: Twist::default(),
            is_host_driven: false,
            now_us: 0,
            streaming_since_us: None,
            ready: None,
            truths: VecDeque::new(),
            world: config.world,
        };
        let hello = simulation.board.hello();
        simulation.link.send(BOOT, &hello);
        simulation
    }

    /// The same session with calibration errors: each sensor gets a random range bias and bearing
    /// offset with these standard deviations. Nothing else of the session changes.
    #[must_use]
    pub fn with_misfits(mut self, range_bias_m: f64, bearing_offset_rad: f64) -> Self {
        let mut random = Random::new(self.seed, Stream::Mounting);
        for misfit in &mut self.misfits {
            *misfit = Misfit::draw(range_bias_m, bearing_offset_rad, &mut random);
        }
        self
    }

    /// The same session with broken wheel encoders.
    #[must_use]
    pub fn with_encoder_faults(mut self, faults: Vec<EncoderFault>) -> Self {
        self.encoders = Encoders::new(faults);
        self
    }

    /// The same session with a robot that differs from its configuration, or that hands move.
    #[must_use]
    pub fn with_robot_faults(mut self, faults: &[RobotFault]) -> Self {
        let mut random = Random::new(self.seed, Stream::RobotFault);
        let of_hands = Random::new(random.bits(), Stream::RobotFault);
        self.misbuilt = Misbuilt::new(faults, random);
        self.hands = Hands::new(faults, of_hands);
        self.robot = self.robot.scaled(self.misbuilt.radius, self.misbuilt.base, self.misbuilt.ticks);
        self
    }

    /// The true calibration errors, by sensor id.
    #[must_use]
    pub fn misfits(&self) -> &[Misfit] {
        &self.misfits
    }

    /// The true faults.
    #[must_use]
    pub fn faults(&self) -> &[SensorFault] {
        self.faults.schedule()
    }

    /// Length of the session.
    #[must_use]
    pub fn duration(&self) -> Timestamp {
        self.duration
    }

    /// Delivers bytes from the host to the board.
    pub fn hear(&mut self, at: Timestamp, bytes: &[u8]) {
        for answer in self.board.hear(at, bytes) {
            self.link.send(at, &answer);
        }
    }

    /// Restarts the board after a brief loss of power. The robot stops until the host asks for
    /// readings again.
    pub fn restart_board(&mut self) {
        let at = Timestamp::from_us(self.now_us);
        (self.command, self.streaming_since_us, self.ready) = (Twist::default(), None, None);
        let ticks = self.ticks(at);
        let hello = self.board.restart(at, ticks);
        self.link.send(at, &hello);
    }

    /// Advances the board's clock by `span` without measurements or motion, as when the host sleeps.
    pub fn pass(&mut self, span: Duration) {
        self.board.pass(span);
    }

    /// The next record up to `now`; `None` if there is none. Runs the simulation as far as needed.
    pub fn poll(&mut self, now: Timestamp) -> Option<Record> {
        let end_us = now.min(self.duration).us();
        while self.now_us + STEP_US <= end_us {
            self.step();
        }
        let now = Timestamp::from_us(end_us);
        let truth_at = self.truths.front().map(|(at, _)| *at).filter(|at| *at <= now);
        let chunk_at = self.link.next_at().filter(|at| *at <= now);
        if truth_at.is_some() && (chunk_at.is_none() || truth_at <= chunk_at) {
            return self.truths.pop_front().map(|(at, pose)| Record::Truth { at, pose });
        }
        self.link.receive(now).map(|(at, bytes)| Record::Received { at, bytes })
    }

    /// Simulates one step of 5 ms. The robot stands still until the host asks for readings.
    fn step(&mut self) {
        let at = Timestamp::from_us(self.now_us);
        if let Some((_, frame)) = self.ready.take_if(|(due_us, _)| *due_us <= at.us()) {
            self.link.send(at, &frame);
        }
        if !self.board.is_greeted() && at > BOOT && at.us().is_multiple_of(HELLO_US) {
            let hello = self.board.hello();
            self.link.send(at, &hello);
        }
        if self.board.is_streaming() {
            let since_us = at.us() - *self.streaming_since_us.get_or_insert_with(|| at.us());
            if since_us.is_multiple_of(COMMAND_US) && !self.is_host_driven {
                self.command = self.explorer.command(&self.world, self.robot.pose(0.0), at.seconds());
            }
            if since_us.is_multiple_of(SLOT_US) {
                self.fire(at, since_us / SLOT_US);
            }
            if since_us.is_multiple_of(ENCODER_US) {
                let ticks = self.ticks(at);
                let frame = self.board.encoders(at, ticks);
                self.link.send(at, &frame);
            }
            if since_us.is_multiple_of(MOTION_US) && self.board.motors().are_known() {
                let frame = self.board.motion(at, self.robot.speeds_m_s());
                self.link.send(at, &frame);
            }
            if since_us.is_multiple_of(STATUS_US) {
                let frame = self.board.status(at);
                self.link.send(at, &frame);
            }
        }
        let grip = self.live(at);
        self.handle(at);
        self.drive(at, grip);
        self.now_us += STEP_US;
    }

    /// The counts that reach the board.
    fn ticks(&mut self, at: Timestamp) -> [i32; 2] {
        self.encoders.counts(at.seconds(), self.misbuilt.counts(self.robot.ticks(0.0)))
    }

    /// Moves the doors and people of a home; the grip of the floor under the robot.
    fn live(&mut self, at: Timestamp) -> Grip {
        let robot = self.robot.pose(0.0).position();
        let grip = match (&mut self.life, &mut self.world.home) {
            (Some((life, _)), Some(home)) => {
                life.step(home, robot, at.seconds(), STEP_S);
                home.grip(robot, at.seconds())
            }
            _ => Grip::FULL,
        };
        self.misbuilt.spins(at.seconds()).map_or(grip, |spins| Grip { spins, ..grip })
    }

    /// Lets the hands hold or carry the robot.
    fn handle(&mut self, at: Timestamp) {
        let act = self.hands.step(&self.world, self.robot.pose(0.0), at.seconds());
        self.is_lifted = act == Act::Hold { is_lifted: true };
        if act != Act::Free {
            self.command = Twist::default();
        }
        if let Act::Carry(pose) = act {
            self.robot.carry(pose);
            self.explorer.forget();
        }
    }

    /// Fires one group. Its message is sent when the slot is over.
    fn fire(&mut self, at: Timestamp, slot: u64) {
        let groups = u64::from(self.board.ring().mountings.iter().map(|m| m.group).max().unwrap_or(0)) + 1;
        let group = u8::try_from(slot % groups).unwrap_or(0);
        let is_last = slot % groups == groups - 1;
        let readings = self.listen(at, group);
        let ticks = self.ticks(at);
        let frame = self.board.sonar(at, group, is_last, ticks, &readings);
        self.ready = Some((at.us() + SLOT_US - STEP_US, frame));
        if is_last {
            self.truths.push_back((at, self.robot.pose(0.0)));
        }
    }
}

impl Simulation {
    /// What the sensors of a group read.
    fn listen(&mut self, at: Timestamp, group: u8) -> Vec<(u8, Reading)> {
        let mountings = (0u8..).zip(&self.board.ring().mountings).filter(|(_, mounting)| mounting.group == group);
        let poses: Vec<(u8, Pose2)> = mountings
            .map(|(sensor, mounting)| {
                let built = self.misbuilt.mounted(mounting.robot_from_sensor);
                (sensor, self.misfits[usize::from(sensor)].turned(built))
            })
            .collect();
        // The sound reaches the surface half a flight after the trigger.
        let distances_m: Vec<Option<f64>> = match (&self.world.home, &mut self.life) {
            (Some(home), Some((_, noise))) => {
                let heard = |pose: Pose2| {
                    let echo = |share: f64| echo(self.beam, &self.world, home, self.robot.pose(share) * pose);
                    echo(0.0).and_then(|first| echo(first.distance_m / SOUND_M_S / STEP_S))
                };
                let group: Vec<_> = poses.iter().map(|&(_, pose)| heard(pose)).collect();
                (0..group.len()).map(|index| noise.distance_m(home, &group, index)).collect()
            }
            _ => {
                let heard = |pose: Pose2| {
                    let distance = |share: f64| self.beam.distance(&self.world, self.robot.pose(share) * pose);
                    distance(0.0).and_then(|m| distance(m / SOUND_M_S / STEP_S))
                };
                poses.iter().map(|&(_, pose)| heard(pose)).collect()
            }
        };
        let read = |((sensor, _), true_m): ((u8, Pose2), Option<f64>)| {
            let misfit = self.misfits[usize::from(sensor)];
            let heard_m = misfit.read(reading(true_m, &mut self.sonar_noise));
            let heard_m = if self.is_lifted { self.hands.nonsense() } else { heard_m };
            let read_m = self.misbuilt.reported(heard_m);
            (sensor, self.faults.apply(sensor, at.seconds(), read_m))
        };
        poses.into_iter().zip(distances_m).map(read).collect()
    }
}

/// The whole session with a host that behaves like the daemon: it requests the Hello, the geometry
/// and the readings, and the board's time once per second.
pub fn session(mut simulation: Simulation) -> impl Iterator<Item = Record> {
    let mut encoder = FrameEncoder::default();
    let mut script: VecDeque<(u64, Message)> = VecDeque::from([
        (200_000, Message::HelloRequest { major: VERSION_MAJOR, minor: VERSION_MINOR }),
        (250_000, Message::GeometryRequest),
        (350_000, Message::Start),
    ]);
    let mut now_us = 0;
    let mut token = 0u16;
    std::iter::from_fn(move || {
        loop {
            if let Some(record) = simulation.poll(Timestamp::from_us(now_us)) {
                return Some(record);
            }
            if now_us >= simulation.duration().us() {
                return None;
            }
            if let Some((_, message)) = script.pop_front_if(|(due_us, _)| *due_us <= now_us) {
                let (at, bytes) = (Timestamp::from_us(now_us), encoder.encode(&message).to_vec());
                simulation.hear(at, &bytes);
                return Some(Record::Sent { at, bytes });
            }
            now_us += STEP_US;
            if now_us % 1_000_000 == 400_000 {
                token = token.wrapping_add(1);
                script.push_back((now_us, Message::TimeRequest { token }));
            }
        }
    })
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a positive duration in seconds")]
fn microseconds(seconds: f64) -> u64 {
    (seconds.max(0.0) * 1e6) as u64
}
