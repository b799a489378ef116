//! One drive: simulates it, runs the estimator and keeps what was said beside the truth.

use super::kind::Kind;
use slamd_core::{
    Config, Driver, Estimate, Event, LocalizationEvent, ModelEvent, Pose2, Record, Start, Timestamp, Update,
};
use slamd_metrics::{Pair, Pairing};
use slamd_sim::simulation::{SimConfig, Simulation, session};
use slamd_sim::world::World;

/// What is driven.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Case {
    pub(super) kind: Kind,
    pub(super) sensors: u8,
    pub(super) seed: u64,
    pub(super) seconds: f64,
}

impl Case {
    /// The command that writes the same drive into a capture.
    pub(crate) fn command(&self) -> String {
        let faults: String = self.kind.texts(self.seed).iter().map(|fault| format!(" --robot-fault {fault}")).collect();
        format!(
            "slamd simulate --world random --seed {} --sensors {} --duration {}{faults} --capture {}-{}-{}.mcap",
            self.seed,
            self.sensors,
            self.seconds,
            self.kind.word(),
            self.sensors,
            self.seed
        )
    }
}

/// What was said during a drive, beside the truth.
#[derive(Clone, Debug, Default)]
pub(crate) struct Trace {
    /// Where the robot was at the session's start: the map's origin.
    pub(super) start: Option<Pose2>,
    /// The truth, at other times than the poses.
    pub(super) truths: Vec<(Timestamp, Pose2)>,
    pub(super) pairs: Vec<Pair<Estimate>>,
    pub(super) localization: Vec<LocalizationEvent>,
    pub(super) model: Vec<ModelEvent>,
    /// When the map was begun anew, and the first pose in it.
    pub(super) revised: Vec<(Timestamp, Estimate)>,
}

/// Simulates and estimates.
pub(super) fn drive(case: &Case) -> Trace {
    let simulation = Simulation::new(SimConfig::usual(World::random(case.seed), case.seed, case.seconds, case.sensors))
        .with_robot_faults(&case.kind.faults(case.seed));
    let pipeline = slamd_paper::pipeline(&Config::default(), Start::Fresh).expect("a fresh start has no saved state");
    let mut driver = Driver::new(pipeline);
    let (mut trace, mut pairing) = (Trace::default(), Pairing::default());
    for record in session(simulation) {
        if let Record::Truth { at, pose } = record {
            trace.start.get_or_insert(pose);
            trace.truths.push((at, pose));
            pairing.truth(at, pose);
        }
        driver.feed(&record, |_, update| match update {
            Update::Event(Event::Estimate(estimate)) => pairing.estimate(estimate.at, *estimate),
            Update::Event(Event::Localization(event)) => trace.localization.push(event.clone()),
            Update::Event(Event::Model(event)) => trace.model.push(event.clone()),
            Update::Event(Event::Revised { at, poses }) => {
                trace.revised.extend(poses.first().map(|first| (*at, *first)));
            }
            _ => {}
        });
        trace.pairs.extend(std::iter::from_fn(|| pairing.next_pair()));
    }
    trace
}
