//! A session file carries on what a run knew: the same map to the bit, and a second half as good as an uninterrupted run's.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd_capture::Record;
use slamd_core::{Config, Event, Pipeline, Pose2, SavedState, Start};
use slamd_sim::fault::FaultMix;
use slamd_testkit::known_building::{Truths, drive, feed, world};

const HALF_S: f64 = 90.0;

/// Squared errors of the positions from the half on, in the frame of the whole run's first pose.
#[derive(Default)]
struct Half {
    world_from_map: Option<Pose2>,
    truths: Truths,
    square_sum_m2: f64,
    count: f64,
    faults: Vec<usize>,
}

impl Half {
    fn take(&mut self, pipeline: &mut Pipeline, record: &Record, counts: bool) {
        let Self { world_from_map, truths, square_sum_m2, count, faults } = self;
        let new = feed(pipeline, record, |event| match event {
            Event::Estimate(estimate) => {
                let Some(truth) = truths.at(estimate.at) else { return };
                let world_from_map = *world_from_map.get_or_insert_with(|| truth * estimate.pose.inverse());
                if counts {
                    let apart = (world_from_map * estimate.pose).position() - truth.position();
                    *square_sum_m2 += apart.norm_squared();
                    *count += 1.0;
                }
            }
            Event::Fault(fault) => faults.push(fault.sensor),
            _ => {}
        });
        truths.add(record.at(), new);
    }

    fn rms_m(&self) -> f64 {
        (self.square_sum_m2 / self.count).sqrt()
    }
}

#[test]
fn the_second_half_goes_on_where_the_first_ended() {
    let records: Vec<Record> = drive(world("flat"), 4, 2.0 * HALF_S, FaultMix::Paper).collect();
    let (mut whole, mut first, mut second) = (Half::default(), Half::default(), Half::default());
    let mut pipeline = slamd_paper::pipeline(&Config::default(), slamd_core::Start::Fresh).unwrap();
    for record in &records {
        whole.take(&mut pipeline, record, record.at().seconds() > HALF_S);
    }

    let mut before = slamd_paper::pipeline(&Config::default(), slamd_core::Start::Fresh).unwrap();
    for record in records.iter().take_while(|record| record.at().seconds() <= HALF_S) {
        first.take(&mut before, record, false);
    }
    let memory = before.saved_state().unwrap();
    // The payload of a session file.
    let bytes = postcard::to_allocvec(&memory).unwrap();
    let memory: SavedState = postcard::from_bytes(&bytes).unwrap();
    assert_eq!(postcard::to_allocvec(&memory).unwrap(), bytes, "a round trip changes nothing");

    // The ring and the ticks come from the board, whose greeting is in the first second.
    let mut after = slamd_paper::pipeline(&Config::default(), Start::Resume(Box::new(memory))).unwrap();
    second.world_from_map = first.world_from_map;
    let greeting = records.iter().take_while(|record| record.at().seconds() < 0.34);
    for record in greeting.filter(|record| !matches!(record, Record::Truth { .. })) {
        second.take(&mut after, record, false);
    }
    assert_eq!(after.raster(), before.raster(), "the map is the same to the bit");
    assert_eq!(after.states(), before.states(), "and so is what is known of the sensors");
    let faulty = before.states().iter().filter(|state| **state != slamd_core::SensorState::Healthy).count();
    assert!(faulty >= 6 && second.faults.len() == faulty, "{faulty} faulty, {:?} told", second.faults);
    for record in records.iter().filter(|record| record.at().seconds() > HALF_S) {
        second.take(&mut after, record, true);
    }
    println!("second half: uninterrupted {:.3} m, resumed {:.3} m RMS", whole.rms_m(), second.rms_m());
    assert!(second.count > 0.9 * whole.count);
    assert!(second.rms_m() < whole.rms_m() + 0.05, "{} against {}", second.rms_m(), whole.rms_m());
}

#[test]
fn a_paper_run_refuses_a_memory() {
    let mut pipeline = slamd_paper::pipeline(&Config::default(), slamd_core::Start::Fresh).unwrap();
    let mut nothing = Half::default();
    for record in drive(world("flat"), 5, 20.0, FaultMix::None) {
        nothing.take(&mut pipeline, &record, false);
    }
    let config = Config { method: slamd_core::Method::Paper, ..Config::default() };
    let memory = Box::new(pipeline.saved_state().unwrap());
    let error = slamd_paper::pipeline(&config, Start::Resume(memory.clone())).unwrap_err();
    assert!(error.to_string().contains("paper"), "{error}");
    let mut bent = memory;
    bent.filter.covariance.pop();
    let error = slamd_paper::pipeline(&Config::default(), Start::Localize(bent)).unwrap_err();
    assert!(error.to_string().contains("not of one size"), "{error}");
}
