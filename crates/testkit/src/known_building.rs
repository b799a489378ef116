//! One drive that maps a building, and others that begin anywhere in it and know only that map.

#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "shares of a list")]

use slamd_capture::Record;
use slamd_core::{
    Config, Event, LocalizationChange, LocalizationEvent, Output, Pipeline, Point, Pose2, SavedState, SearchState,
    Start, Timestamp, wrap_angle,
};
use slamd_metrics::AccuracyMeter;
use slamd_sim::fault::FaultMix;
use slamd_sim::simulation::{SimConfig, Simulation, session};
use slamd_sim::world::World;

/// A room that looks the same from both ends.
pub const SYMMETRICAL: &str = "start = [2.0, 1.5, 0.0]
[[wall]]\nfrom = [0.0, 0.0]\nto = [6.0, 0.0]\n[[wall]]\nfrom = [6.0, 0.0]\nto = [6.0, 4.0]
[[wall]]\nfrom = [6.0, 4.0]\nto = [0.0, 4.0]\n[[wall]]\nfrom = [0.0, 4.0]\nto = [0.0, 0.0]\n";

/// A world by name.
pub fn world(name: &str) -> World {
    let mut world = World::named(name).unwrap_or_else(|| World::from_toml(name, SYMMETRICAL).expect("a good world"));
    world.start_heading_rad = None;
    world
}

/// A drive's records.
pub fn drive(world: World, seed: u64, duration_s: f64, mix: FaultMix) -> impl Iterator<Item = Record> {
    session(Simulation::new(SimConfig { mix, ..SimConfig::usual(world, seed, duration_s, 32) }))
}

/// Hands a record to a pipeline and its events to `each`; the truth, where the record is one.
pub fn feed(pipeline: &mut Pipeline, record: &Record, mut each: impl FnMut(Event)) -> Option<Pose2> {
    if let Record::Truth { pose, .. } = record {
        return Some(*pose);
    }
    record.input().into_iter().for_each(|input| pipeline.handle(input));
    while let Some(output) = pipeline.poll_output() {
        if let Output::Event(event) = output {
            each(event);
        }
    }
    None
}

/// Where the robot truly was.
#[derive(Default)]
pub struct Truths {
    poses: Vec<(Timestamp, Pose2)>,
}

impl Truths {
    pub fn add(&mut self, at: Timestamp, pose: Option<Pose2>) {
        self.poses.extend(pose.map(|pose| (at, pose)));
    }

    /// The pose nearest in time, within the twentieth of a second that two sweeps leave.
    pub fn at(&self, at: Timestamp) -> Option<Pose2> {
        let after = self.poses.partition_point(|(then, _)| *then < at);
        let near = self.poses[after.saturating_sub(1)..].iter().take(2);
        let apart = |then: Timestamp| then.seconds_since(at).abs();
        let nearest = near.min_by(|a, b| apart(a.0).total_cmp(&apart(b.0)))?;
        (apart(nearest.0) < 0.05).then_some(nearest.1)
    }
}

/// A building as a drive has left it.
pub struct Known {
    pub memory: SavedState,
    pub world_from_map: Pose2,
    /// Where the drive went.
    pub places: Vec<Point>,
}

/// Maps a world; its state passes through the bytes of a session file's payload.
pub fn remember(name: &str, seed: u64, duration_s: f64) -> Known {
    let mut pipeline = slamd_paper::pipeline(&Config::default(), slamd_core::Start::Fresh).unwrap();
    let mut meter = AccuracyMeter::default();
    let mut places = Vec::new();
    for record in drive(world(name), seed, duration_s, FaultMix::Paper) {
        let truth = feed(&mut pipeline, &record, |event| {
            if let Event::Estimate(estimate) = event {
                meter.estimate(estimate.at, estimate.pose);
            }
        });
        if let Some(pose) = truth {
            meter.truth(record.at(), pose);
            places.push(pose.position());
        }
    }
    let memory = pipeline.saved_state().expect("the walls method remembers");
    let bytes = postcard::to_allocvec(&memory).expect("numbers and lists");
    let memory = postcard::from_bytes(&bytes).expect("what was written is read");
    Known { memory, world_from_map: meter.world_from_map().expect("a drive has a truth"), places }
}

/// What became of a robot that knew only the map.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// Seconds of driving until the position was found first.
    pub found_after_s: Option<f64>,
    /// Greatest error while it was thought to be known: metres and degrees.
    pub worst_m: f64,
    pub worst_deg: f64,
    /// Error at each sweep, squared and summed, and their number.
    pub square_sum_m2: f64,
    pub sweeps: f64,
    /// The robot's messages about its position.
    pub said: Vec<String>,
}

impl Outcome {
    fn compare(&mut self, believed: Pose2, truth: Pose2) {
        let apart_m = (believed.position() - truth.position()).norm();
        self.worst_m = self.worst_m.max(apart_m);
        let turn_rad = wrap_angle(believed.theta_rad - truth.theta_rad);
        self.worst_deg = self.worst_deg.max(turn_rad.abs().to_degrees());
        self.square_sum_m2 += apart_m * apart_m;
        self.sweeps += 1.0;
    }

    /// Farther off than any door is wide.
    pub fn is_wrong(&self) -> bool {
        self.worst_m > 0.5 || self.worst_deg > 20.0
    }
}

/// Puts the robot somewhere the first drive has been and lets it drive, with another seed.
pub fn seek(known: &Known, name: &str, seed: u64, duration_s: f64) -> Outcome {
    let mut world = world(name);
    // Another place for each seed, spread over the first drive by the golden ratio.
    let share = (seed as f64 * 0.618_033_988_75).fract();
    let place = known.places[(share * known.places.len() as f64) as usize];
    if world.clearance(place) > 0.2 {
        world.start = place;
    }
    let start = Start::Localize(Box::new(known.memory.clone()));
    let mut pipeline = slamd_paper::pipeline(&Config::default(), start).expect("a good memory");
    let mut outcome = Outcome::default();
    let mut truths = Truths::default();
    for record in drive(world, seed + 5_000, duration_s, FaultMix::None) {
        let truth = feed(&mut pipeline, &record, |event| match event {
            Event::Localization(LocalizationEvent { change: LocalizationChange::KnownMap(search), .. }) => {
                if search.state == SearchState::Found && outcome.found_after_s.is_none() {
                    outcome.found_after_s = Some(search.driven_s);
                }
                outcome.said.push(search.reason);
            }
            Event::Estimate(estimate) => {
                if let Some(truth) = truths.at(estimate.at) {
                    outcome.compare(known.world_from_map * estimate.pose, truth);
                }
            }
            _ => {}
        });
        truths.add(record.at(), truth);
    }
    outcome
}
