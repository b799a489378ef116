//! A robot that is carried or pushed: it is noticed, the pose is called uncertain until it is right, and nothing is drawn meanwhile.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd_core::{Config, Driver, Estimate, Event, LocalizationChange, LocalizationEvent, Record, Start, Update};
use slamd_metrics::{Pair, Pairing, building_frame};
use slamd_sim::simulation::{SimConfig, Simulation, session};
use slamd_sim::world::World;

/// When the hands come, seconds.
const HANDS_S: f64 = 60.0;
/// A pose is right within this, metres.
const RIGHT_M: f64 = 0.3;
/// The robot stands for so long around a kidnap or a push, seconds.
const HOLD_S: f64 = 3.0;

/// What was said and true at one sweep.
struct Moment {
    at_s: f64,
    driven_m: f64,
    error_m: f64,
    is_lost: bool,
}

struct Outcome {
    moments: Vec<Moment>,
    events: Vec<LocalizationEvent>,
    /// Revisions of the map while the pose was lost.
    drawn_while_lost: u64,
}

/// A drive of 8 sensors through a random home.
fn drive(seed: u64, seconds: f64, robot_fault: &str) -> Outcome {
    let config = SimConfig::usual(World::random(seed), seed, seconds, 8);
    let faults: Vec<_> = robot_fault.split_whitespace().map(|text| text.parse().unwrap()).collect();
    let simulation = Simulation::new(config).with_robot_faults(&faults);
    let mut driver = Driver::new(slamd_paper::pipeline(&Config::default(), Start::Fresh).unwrap());
    let (mut pairing, mut first) = (Pairing::default(), None);
    let mut outcome = Outcome { moments: Vec::new(), events: Vec::new(), drawn_while_lost: 0 };
    let mut before: Option<slamd_core::Point> = None;
    let (mut is_lost, mut driven_m, mut revision) = (false, 0.0, 0);
    for record in session(simulation) {
        if let Record::Truth { at, pose } = record {
            pairing.truth(at, pose);
        }
        let was_lost = is_lost;
        driver.feed(&record, |context, update| {
            match update {
                Update::Event(Event::Estimate(estimate)) => pairing.estimate(estimate.at, *estimate),
                Update::Event(Event::Localization(event)) => {
                    is_lost = event.is_lost();
                    outcome.events.push(event.clone());
                }
                _ => {}
            }
            let newest = context.pipeline.map_since(u64::MAX).map_or(0, |(_, newest)| newest);
            outcome.drawn_while_lost += if was_lost && is_lost { newest - revision } else { 0 };
            revision = newest;
        });
        while let Some(pair) = pairing.next_pair() {
            let map_from_world = *first.get_or_insert_with(|| building_frame(&pair).inverse());
            let Pair { at, estimate, truth } = pair;
            let estimate: Estimate = estimate;
            let step_m = before.map_or(0.0, |before| (truth.position() - before).norm());
            before = Some(truth.position());
            driven_m += if step_m < 0.3 { step_m } else { 0.0 };
            let error_m = (estimate.pose.position() - (map_from_world * truth).position()).norm();
            outcome.moments.push(Moment { at_s: at.seconds(), driven_m, error_m, is_lost });
        }
    }
    outcome
}

impl Outcome {
    /// The way from the hands to the first moment after them that `is_so`, metres.
    fn way_until(&self, is_so: impl Fn(&Moment) -> bool) -> Option<f64> {
        let mut after = self.moments.iter().filter(|moment| moment.at_s > HANDS_S + HOLD_S);
        let from_m = self.moments.iter().find(|moment| moment.at_s > HANDS_S + 1.0)?.driven_m;
        Some(after.find(|moment| is_so(moment))?.driven_m - from_m)
    }

    /// The longest time of poses that are wrong and not called uncertain, seconds.
    fn silent_s(&self) -> f64 {
        let is_silent = |moment: &Moment| !moment.is_lost && moment.error_m > RIGHT_M;
        let runs = self.moments.chunk_by(|a, b| is_silent(a) == is_silent(b)).filter(|run| is_silent(&run[0]));
        runs.map(|run| run[run.len() - 1].at_s - run[0].at_s).fold(0.0, f64::max)
    }

    fn end(&self) -> &Moment {
        self.moments.last().unwrap()
    }
}

#[test]
fn a_carried_robot_is_lost_at_once_and_then_found() {
    let outcome = drive(13, 110.0, "kidnap@60s");
    println!("{:?}", outcome.events);
    let noticed_m = outcome.way_until(|moment| moment.is_lost).unwrap();
    assert!(noticed_m < 2.0, "{noticed_m:.2} m");
    let found_m = outcome.way_until(|moment| !moment.is_lost).unwrap();
    assert!(found_m < 10.0 && outcome.end().error_m < RIGHT_M, "{found_m:.2} m, {:.2} m", outcome.end().error_m);
    assert!(outcome.silent_s() < 5.0, "{:.1} s", outcome.silent_s());
    assert_eq!(outcome.drawn_while_lost, 0);
    let far = outcome
        .events
        .iter()
        .any(|event| matches!(event.change, LocalizationChange::Regained { moved_m, .. } if moved_m > 1.5));
    assert!(far, "{:?}", outcome.events);
}

#[test]
fn a_robot_carried_where_it_has_never_been_stays_lost() {
    let outcome = drive(19, 140.0, "kidnap@60s");
    println!("{:?}", outcome.events);
    assert!(outcome.way_until(|moment| moment.is_lost).unwrap() < 2.0);
    assert!(outcome.end().is_lost && outcome.end().error_m > RIGHT_M, "{:.2} m", outcome.end().error_m);
    assert!(outcome.silent_s() < 5.0, "{:.1} s", outcome.silent_s());
    assert_eq!(outcome.drawn_while_lost, 0);
}

#[test]
fn a_lifted_robot_is_lost_at_once() {
    let outcome = drive(3, 75.0, "kidnap=lifted@60s");
    println!("{:?}", outcome.events);
    assert!(outcome.way_until(|moment| moment.is_lost).unwrap() < 2.0);
    assert!(outcome.silent_s() < 5.0, "{:.1} s", outcome.silent_s());
}

#[test]
fn a_push_is_mended_within_two_metres() {
    let outcome = drive(14, 80.0, "push=0.48@60s");
    println!("{:?}", outcome.events);
    let mended_m = outcome.way_until(|moment| moment.error_m < 0.15).unwrap();
    assert!(mended_m < 2.0, "{mended_m:.2} m");
    assert!(outcome.end().error_m < 0.15 && !outcome.end().is_lost, "{:.2} m", outcome.end().error_m);
}

#[test]
fn a_pushed_robot_is_not_at_the_other_end_of_an_alike_room() {
    let outcome = drive(2, 110.0, "push=0.25@60s");
    println!("{:?}", outcome.events);
    let is_told = |event: &LocalizationEvent| matches!(&event.change, LocalizationChange::Doubted { reason } if reason.contains("nearly alike"));
    assert!(outcome.events.iter().any(is_told), "{:?}", outcome.events);
    assert!(outcome.silent_s() < 5.0, "{:.1} s", outcome.silent_s());
    assert!(outcome.end().is_lost || outcome.end().error_m < RIGHT_M, "{:.2} m", outcome.end().error_m);
}

#[test]
fn a_wheel_that_spins_in_place_is_noticed() {
    let outcome = drive(7, 100.0, "spin=left@60s-61s");
    println!("{:?}", outcome.events);
    assert!(outcome.way_until(|moment| moment.is_lost).unwrap() < 4.0);
    assert!(outcome.silent_s() < 20.0, "{:.1} s", outcome.silent_s());
    assert!(outcome.end().is_lost || outcome.end().error_m < RIGHT_M, "{:.2} m", outcome.end().error_m);
}

#[test]
fn people_and_doors_are_no_other_place() {
    for seed in [1, 6] {
        let outcome = drive(seed, 100.0, "");
        assert!(outcome.events.is_empty(), "home {seed}: {:?}", outcome.events);
    }
}
