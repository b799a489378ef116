//! One home, driven by the explorer and by the simulator's own driver.

use super::judge::{Contacts, Floor};
use slamd::drive::{Conditions, Driver as Client, Helm, Order, Twist, Wish};
use slamd_core::config::SettingValue;
use slamd_core::{
    Config, Driver, Event, Pipeline, Point, Raster, Record, SensorState, SessionState, Start, Timestamp, Update,
};
use slamd_explore::{Explorer, Observation, Params, Report, Status};
use slamd_metrics::AccuracyMeter;
use slamd_protocol::Drive;
use slamd_sim::robot::STEP_US;
use slamd_sim::simulation::{SimConfig, Simulation, session};
use slamd_sim::world::World;
use std::collections::VecDeque;

/// A home and a ring.
#[derive(Clone, Copy, Debug)]
pub(super) struct Case {
    pub(super) seed: u64,
    pub(super) sensors: u8,
    /// The drive is ended then, seconds.
    pub(super) limit_s: f64,
}

/// What an exploration came to.
#[derive(Debug)]
pub(super) struct Outcome {
    pub(super) report: Option<Report>,
    /// Share of the reachable floor that the map tells of.
    pub(super) seen: f64,
    /// When it told of 95 % of it, seconds.
    pub(super) most_seen_s: Option<f64>,
    pub(super) contacts: Contacts,
    /// True way and time, metres and seconds.
    pub(super) way_m: f64,
    pub(super) time_s: f64,
    /// True distance from the start at the end, metres.
    pub(super) home_m: f64,
    pub(super) ate_m: f64,
    /// What the helm refused, and how often.
    pub(super) refused: Vec<(String, u32)>,
    /// The last thing it did.
    pub(super) status: Status,
    pub(super) raster: Raster,
    /// Where the robot believed to be, once a second.
    pub(super) trail: Vec<Point>,
}

/// The drive of the simulator's own driver, who knows the truth.
#[derive(Debug)]
pub(super) struct Reference {
    pub(super) ate_m: f64,
    pub(super) most_seen_s: Option<f64>,
}

/// Between two looks at how much has been seen, seconds.
const LOOK_S: f64 = 20.0;
const MOST: f64 = 0.95;

fn simulation(case: Case, duration_s: f64) -> Simulation {
    Simulation::new(SimConfig::usual(World::random(case.seed), case.seed, duration_s, case.sensors))
}

/// The default configuration, but for the board's stop distance: with 250 mm the robot cannot turn into a door.
const STOP_MM: i32 = 120;

fn config() -> Config {
    let mut config = Config::default();
    config.board.insert("stop_distance_mm".into(), SettingValue::Number(STOP_MM));
    config
}

fn pipeline() -> Pipeline {
    slamd_paper::pipeline(&config(), Start::Fresh).expect("a fresh start has no saved state")
}

/// The host: the pipeline, the explorer and the helm, as in the daemon.
struct Host {
    driver: Driver,
    state: SessionState,
    accuracy: AccuracyMeter,
    explorer: Explorer,
    helm: Helm,
    commanded: Option<Timestamp>,
    status: Status,
    refused: Vec<(String, u32)>,
}

/// The explorer as a client of the helm.
const CLIENT: Client = Client { number: 0, source: Drive::FROM_SOCKET };
/// A command holds for so long, milliseconds.
const COMMAND_MS: u16 = 300;

impl Host {
    fn new() -> Self {
        Self {
            driver: Driver::new(pipeline()),
            state: SessionState::default(),
            accuracy: AccuracyMeter::default(),
            explorer: Explorer::new(Params::default(), Point::origin()),
            helm: Helm::new(&config()),
            commanded: None,
            status: Status::Waiting,
            refused: Vec::new(),
        }
    }

    /// Handles what the board sent, or the deadlines up to `at`; gives what is to be written.
    fn take(&mut self, at: Timestamp, record: Option<&Record>) -> VecDeque<Vec<u8>> {
        let Self { driver, state, accuracy, .. } = self;
        let mut frames = VecDeque::new();
        let mut observe = |update: Update<'_>| match update {
            Update::Event(event) => {
                state.take(event);
                if let Event::Estimate(estimate) = event {
                    accuracy.estimate(estimate.at, estimate.pose);
                }
            }
            Update::Transmit(frame) => frames.push_back(frame.to_vec()),
            Update::Truth(at, pose) => accuracy.truth(at, pose),
            Update::Input => {}
        };
        match record {
            Some(record) => driver.feed(record, |_, update| observe(update)),
            None => {
                driver.advance(at, |_, update| observe(update));
            }
        }
        frames
    }

    fn conditions(&self) -> Conditions {
        let pipeline = self.driver.pipeline();
        Conditions::of_robot(pipeline, &self.state, pipeline.sweep().is_some_and(|sweep| sweep.index > 0))
    }

    /// Asks the explorer once per sweep, and the helm for the frame that is due.
    fn steer(&mut self, at: Timestamp) -> Option<Vec<u8>> {
        let conditions = self.conditions();
        let swept = self.driver.pipeline().sweep().map(|sweep| sweep.at);
        if conditions.is_streaming && swept != self.commanded {
            self.commanded = swept;
            let wish = self.wish(at);
            let order = if wish.twist == Twist::default() { Order::Stop } else { Order::Drive(wish) };
            if let Err(refusal) = self.helm.order(at, CLIENT, order, &conditions) {
                let words = refusal.to_string();
                match self.refused.iter_mut().find(|(known, _)| *known == words) {
                    Some((_, count)) => *count += 1,
                    None => self.refused.push((words, 1)),
                }
            }
        }
        self.helm.tick(at, &conditions).map(|frame| frame.to_vec())
    }

    fn wish(&mut self, at: Timestamp) -> Wish {
        let pipeline = self.driver.pipeline();
        let is_healthy =
            |sensor: usize| pipeline.states().get(sensor).is_none_or(|&state| state == SensorState::Healthy);
        let beams = pipeline.sweep().map(|sweep| sweep.beams.iter().enumerate()).into_iter().flatten();
        let echoes: Vec<Point> =
            beams.filter(|(sensor, _)| is_healthy(*sensor)).filter_map(|(_, beam)| slamd_explore::echo(beam)).collect();
        let map = self.explorer.wants_map(at).then(|| pipeline.raster());
        let command = self.explorer.command(&Observation {
            at,
            estimate: self.state.estimate(),
            is_uncertain: self.state.is_lost(),
            echoes: &echoes,
            map: map.as_ref(),
        });
        self.status = command.status;
        let twist = Twist { forward_m_s: command.twist.forward_m_s, turn_rad_s: command.twist.turn_rad_s };
        Wish { twist, for_ms: COMMAND_MS, is_autonomous: command.uses_pose }
    }
}

/// Explores a home.
pub(super) fn explore(case: Case, log: bool) -> Outcome {
    let mut simulation = simulation(case, case.limit_s).driven_by_host();
    let (start, mut host) = (simulation.pose(), Host::new());
    let floor = Floor::of(&World::random(case.seed));
    let (mut contacts, mut way_m, mut last, mut most_seen_s) = (Contacts::default(), 0.0, start, None);
    let (mut looked_s, mut said) = (0.0, host.status);
    let (mut now_us, mut trail) = (0, Vec::new());
    while now_us < simulation.duration().us() && host.explorer.report().is_none() {
        now_us += STEP_US;
        let at = Timestamp::from_us(now_us);
        let mut frames = VecDeque::new();
        while let Some(record) = simulation.poll(at) {
            frames.extend(host.take(at, Some(&record)));
        }
        frames.extend(host.take(at, None));
        frames.extend(host.steer(at));
        while let Some(bytes) = frames.pop_front() {
            simulation.hear(at, &bytes);
            frames.extend(host.take(at, Some(&Record::Sent { at, bytes })));
        }
        if now_us % 1_000_000 == 0 {
            trail.extend(host.state.estimate().map(|estimate| estimate.pose.position()));
        }
        let pose = simulation.pose();
        way_m += (pose.position() - last.position()).norm();
        last = pose;
        contacts.take(simulation.clearance_m(), simulation.wheel_speeds_m_s());
        if at.seconds() > looked_s + LOOK_S {
            looked_s = at.seconds();
            let seen = floor.seen(&host.driver.pipeline().raster(), host.accuracy.world_from_map());
            most_seen_s = most_seen_s.or_else(|| (seen >= MOST).then_some(looked_s));
        }
        if log && std::mem::discriminant(&host.status) != std::mem::discriminant(&said) {
            said = host.status;
            eprintln!("{:.1} s: {said:?}, way {way_m:.1} m, truth {:.2} {:.2}", at.seconds(), pose.x_m, pose.y_m);
        }
    }
    let raster = host.driver.pipeline().raster();
    Outcome {
        report: host.explorer.report().cloned(),
        seen: floor.seen(&raster, host.accuracy.world_from_map()),
        most_seen_s,
        contacts,
        way_m,
        time_s: Timestamp::from_us(now_us).seconds(),
        home_m: (last.position() - start.position()).norm(),
        ate_m: host.accuracy.accuracy().map_or(f64::NAN, |accuracy| accuracy.ate_m),
        refused: host.refused,
        status: host.status,
        raster,
        trail,
    }
}

/// The same home, for the same time, driven by the truth.
pub(super) fn reference(case: Case, duration_s: f64) -> Reference {
    let floor = Floor::of(&World::random(case.seed));
    let mut driver = Driver::new(pipeline());
    let (mut accuracy, mut most_seen_s, mut looked_s) = (AccuracyMeter::default(), None, 0.0);
    for record in session(simulation(case, duration_s)) {
        driver.feed(&record, |_, update| match update {
            Update::Event(Event::Estimate(estimate)) => accuracy.estimate(estimate.at, estimate.pose),
            Update::Truth(at, pose) => accuracy.truth(at, pose),
            _ => {}
        });
        let at_s = record.at().seconds();
        if at_s > looked_s + LOOK_S && most_seen_s.is_none() {
            looked_s = at_s;
            let seen = floor.seen(&driver.pipeline().raster(), accuracy.world_from_map());
            most_seen_s = (seen >= MOST).then_some(looked_s);
        }
    }
    Reference { ate_m: accuracy.accuracy().map_or(f64::NAN, |accuracy| accuracy.ate_m), most_seen_s }
}
