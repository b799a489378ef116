//! A robot that drives laps for ever through a building of corridors, with a real board and a real pipeline, at no cost to speak of.
//!
//! The corridors run on a lattice, so around every crossing the building looks the same and only one cell of it is ever looked at: it may be a
//! kilometre wide. The echoes of one lap are kept and repeated on the next; stamps, sequence numbers and wheel counts go on, and the
//! lap is closed, so the building stays where it is.

use slamd_core::{Config, Event, Input, Output, Pipeline, Point, Pose2, Ring, Timestamp, wrap_angle};
use slamd_sim::board::Board;
use slamd_sim::fault::Reading;
use slamd_sim::floor_plan::box_faces;
use slamd_sim::random::{Random, Stream};
use slamd_sim::sonar::{BeamShape, reading};
use slamd_sim::world::World;
use std::f64::consts::TAU;

/// A building: `lines` corridors each way, `pitch_m` apart.
#[derive(Clone, Copy)]
pub struct Plan {
    pub lines: u32,
    pub pitch_m: f64,
}

const CORRIDOR_M: f64 = 2.5;
const GROUPS: u8 = 4;
/// From one group to the next: 10 sweeps a second.
const SLOT_S: f64 = 0.025;
const SLOT_US: u64 = 25_000;
const STATUS_SLOTS: u64 = 40;
const SPEED_M_S: f64 = 0.4;
const TURN_RAD_S: f64 = 1.0;
const TICKS_PER_TURN: f64 = 1440.0;

impl Plan {
    /// The lap: to and fro along the rows, and back along the first column.
    fn corners(self) -> Vec<Point> {
        let far = f64::from(self.lines - 1) * self.pitch_m;
        let mut corners = Vec::new();
        for row in 0..self.lines {
            let y = f64::from(row) * self.pitch_m;
            let near = if row == 0 || row + 1 == self.lines { 0.0 } else { self.pitch_m };
            let ends = if row % 2 == 0 { [near, far] } else { [far, near] };
            corners.extend(ends.map(|x| Point::new(x, y)));
        }
        corners
    }

    /// What stands round the crossing at the origin.
    fn cell(self) -> World {
        let size_m = [self.pitch_m - CORRIDOR_M; 2];
        // What stands beyond these is out of hearing.
        let middles = [-0.5, 0.5].map(|step| step * self.pitch_m);
        let pillars = middles.iter().flat_map(|&x| middles.map(|y| box_faces(Point::new(x, y), size_m, 0.0)));
        World::new("lattice", pillars.flatten().collect(), Point::origin(), Some(0.0))
    }

    /// The same place in the cell at the origin.
    fn fold(self, pose: Pose2) -> Pose2 {
        let fold = |m: f64| m - self.pitch_m * (m / self.pitch_m).round();
        Pose2::new(fold(pose.x_m), fold(pose.y_m), pose.theta_rad)
    }
}

/// One fired group of the lap: its ranges, millimetres, 0 for no echo, and how far the wheels had rolled by then, metres.
struct Slot {
    heard_mm: [u16; 8],
    wheels_m: [f64; 2],
}

/// The drive.
pub struct Drive {
    board: Board,
    lap: Vec<Slot>,
    slot: u64,
    metres_per_tick: f64,
    pub pipeline: Pipeline,
}

/// What `drive` tells of each slot: the input for the pipeline; what it gives is for the board.
pub type Handle<'a> = dyn FnMut(&mut Pipeline, Input<'_>) -> Vec<bytes::Bytes> + 'a;

impl Drive {
    /// A robot at the first corner of the lap, which is driven once beforehand, or as far as one gets in `hours`.
    pub fn new(plan: Plan, hours: f64) -> Self {
        let config = Config::default();
        let ring = Ring::circle(32, 0.15, BeamShape::Cone.half_angle_rad(), GROUPS);
        let lap = lap(plan, &ring, config.robot.wheel_base_m, hours);
        let board = Board::new(ring, 0.0, Random::new(1, Stream::Board));
        let metres_per_tick = TAU * config.robot.wheel_radius_m / TICKS_PER_TURN;
        Self {
            board,
            lap,
            slot: 0,
            metres_per_tick,
            pipeline: slamd_paper::pipeline(&config, slamd_core::Start::Fresh)
                .expect("a fresh start holds nothing that could be refused"),
        }
    }

    /// How long a lap takes, hours.
    pub fn lap_h(&self) -> f64 {
        self.lap.len() as f64 * SLOT_S / 3600.0
    }

    /// Drives on for one sweep.
    pub fn sweep(&mut self, handle: &mut Handle<'_>) {
        for _ in 0..GROUPS {
            self.fire(handle);
        }
    }

    fn fire(&mut self, handle: &mut Handle<'_>) {
        let at = Timestamp::from_us((self.slot + 1) * SLOT_US);
        let mut answers = Vec::new();
        while self.pipeline.next_deadline() <= at {
            let at = self.pipeline.next_deadline();
            for bytes in handle(&mut self.pipeline, Input::Tick { at }) {
                handle(&mut self.pipeline, Input::Sent { at, bytes: &bytes });
                answers.extend(self.board.hear(at, &bytes));
            }
        }
        for answer in answers {
            handle(&mut self.pipeline, Input::Received { at, bytes: &answer });
        }
        let trigger = Timestamp::from_us(self.slot * SLOT_US);
        let frame = if self.board.is_streaming() { self.sonar(trigger) } else { self.board.hello() };
        handle(&mut self.pipeline, Input::Received { at, bytes: &frame });
        if self.slot.is_multiple_of(STATUS_SLOTS) {
            let status = self.board.status(trigger);
            handle(&mut self.pipeline, Input::Received { at, bytes: &status });
        }
        self.slot += 1;
    }

    #[expect(clippy::cast_possible_truncation, reason = "within a lap, and ticks of a wheel")]
    fn sonar(&mut self, trigger: Timestamp) -> slamd_protocol::FrameBuf {
        let (lap, place) = (self.slot / self.lap.len() as u64, (self.slot % self.lap.len() as u64) as usize);
        let whole_m = self.lap.last().map_or([0.0; 2], |slot| slot.wheels_m);
        let slot = &self.lap[place];
        let ticks = [0, 1].map(|wheel| {
            let metres = lap as f64 * whole_m[wheel] + slot.wheels_m[wheel];
            (metres / self.metres_per_tick).round() as i64 as i32
        });
        let group = (self.slot % u64::from(GROUPS)) as u8;
        let readings = [0u8, 1, 2, 3, 4, 5, 6, 7].map(|k| match slot.heard_mm[usize::from(k)] {
            0 => (k * GROUPS + group, Reading::NoEcho),
            mm => (k * GROUPS + group, Reading::Range(1e-3 * f64::from(mm))),
        });
        self.board.sonar(trigger, group, group == GROUPS - 1, ticks, &readings)
    }
}

/// The lap slot by slot, a whole number of sweeps; it ends early where more than `hours` are known.
fn lap(plan: Plan, ring: &Ring, base_m: f64, hours: f64) -> Vec<Slot> {
    let corners = plan.corners();
    let mut listener = Listener {
        plan,
        cell: plan.cell(),
        ring,
        random: Random::new(1, Stream::Sonar),
        slots: Vec::new(),
        wheels_m: [0.0; 2],
    };
    let mut pose = Pose2::new(corners[0].x, corners[0].y, 0.0);
    for next in (1..=corners.len()).map(|index| corners[index % corners.len()]) {
        if listener.slots.len() as f64 * SLOT_S > 3600.0 * hours {
            return listener.slots;
        }
        let way = next - pose.position();
        let to = Pose2::new(next.x, next.y, libm::atan2(way.y, way.x));
        listener.turn(pose, to.theta_rad, base_m);
        let steps = whole_sweeps(way.norm() / (SPEED_M_S * SLOT_S));
        for k in 1..=steps {
            let here = pose.position() + k as f64 / steps as f64 * way;
            listener.step(Pose2::new(here.x, here.y, to.theta_rad), [way.norm() / steps as f64; 2]);
        }
        pose = to;
    }
    listener.turn(pose, 0.0, base_m);
    listener.slots
}

/// Drives the lap and records the echoes.
struct Listener<'a> {
    plan: Plan,
    cell: World,
    ring: &'a Ring,
    random: Random,
    slots: Vec<Slot>,
    wheels_m: [f64; 2],
}

impl Listener<'_> {
    fn step(&mut self, pose: Pose2, rolled_m: [f64; 2]) {
        let group = self.slots.len() % usize::from(GROUPS);
        let mut heard_mm = [0; 8];
        for (k, heard) in heard_mm.iter_mut().enumerate() {
            let sensor = pose * self.ring.mountings[k * usize::from(GROUPS) + group].robot_from_sensor;
            let distance_m = BeamShape::Cone.distance(&self.cell, self.plan.fold(sensor));
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "millimetres of a sonar")]
            let read_mm = reading(distance_m, &mut self.random).map_or(0, |m| (1e3 * m).round() as u16);
            *heard = read_mm;
        }
        self.wheels_m = [0, 1].map(|wheel| self.wheels_m[wheel] + rolled_m[wheel]);
        self.slots.push(Slot { heard_mm, wheels_m: self.wheels_m });
    }

    fn turn(&mut self, from: Pose2, to_rad: f64, base_m: f64) {
        let turn_rad = wrap_angle(to_rad - from.theta_rad);
        if turn_rad.abs() < 1e-9 {
            return;
        }
        let steps = whole_sweeps(turn_rad.abs() / (TURN_RAD_S * SLOT_S));
        let rolled_m = 0.5 * base_m * turn_rad / steps as f64;
        for k in 1..=steps {
            let theta_rad = from.theta_rad + turn_rad * k as f64 / steps as f64;
            self.step(Pose2::new(from.x_m, from.y_m, theta_rad), [-rolled_m, rolled_m]);
        }
    }
}

/// So many slots, rounded up to whole sweeps: a lap must end with the ring's last group.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "slots of a corridor")]
fn whole_sweeps(slots: f64) -> usize {
    (slots.ceil() as usize).next_multiple_of(usize::from(GROUPS))
}

/// Drains the pipeline: what is for the board, and how many poses came out.
pub fn drain(pipeline: &mut Pipeline, poses: &mut u64) -> Vec<bytes::Bytes> {
    let mut transmit = Vec::new();
    while let Some(output) = pipeline.poll_output() {
        match output {
            Output::Transmit(bytes) => transmit.push(bytes),
            Output::Event(Event::Estimate(_)) => *poses += 1,
            Output::Event(_) => {}
        }
    }
    transmit
}
