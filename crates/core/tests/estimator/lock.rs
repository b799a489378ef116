//! Lost and found: the wheels slip by half a metre, the robot notices, and finds its place among the walls it knows.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd_capture::Record;
use slamd_core::{Config, Driver, Event, LocalizationChange, LocalizationEvent, Update};
use slamd_metrics::AccuracyMeter;
use slamd_protocol::{FrameDecoder, FrameEncoder, Message};
use slamd_sim::fault::FaultMix;
use slamd_sim::simulation::{SimConfig, Simulation, session};
use slamd_sim::world::World;

const SLIP_S: f64 = 100.0;
const SLIP_M: f64 = 0.5;
/// The default wheels: 2 pi 0.035 m in 1440 ticks.
const METRES_PER_TICK: f64 = 0.219_911_5 / 1440.0;

/// Both encoders count wheels that spin on the spot for half a second.
fn slipped(records: impl Iterator<Item = Record>) -> Vec<Record> {
    let (mut decoder, mut encoder) = (FrameDecoder::new(), FrameEncoder::new());
    let mut out = Vec::new();
    for record in records {
        let Record::Received { at, bytes } = record else {
            out.push(record);
            continue;
        };
        let share = ((at.seconds() - SLIP_S) / 0.5).clamp(0.0, 1.0);
        #[expect(clippy::cast_possible_truncation, reason = "some thousand ticks")]
        let ticks = (share * SLIP_M / METRES_PER_TICK) as i32;
        for byte in bytes {
            let Some(frame) = decoder.push(byte) else { continue };
            let mut message = Message::parse(frame.kind, frame.payload).unwrap();
            if let Message::Encoder(encoder) = &mut message {
                encoder.left_ticks += ticks;
                encoder.right_ticks += ticks;
            }
            if let Message::Sonar(sonar) = &mut message {
                sonar.left_ticks += ticks;
                sonar.right_ticks += ticks;
            }
            out.push(Record::Received { at, bytes: encoder.encode(&message).to_vec() });
        }
    }
    out
}

/// The lock's changes, and the greatest error after the last of them, metres.
fn drive(records: &[Record]) -> (Vec<LocalizationEvent>, f64) {
    let pipeline = slamd_paper::pipeline(&Config::default(), slamd_core::Start::Fresh).unwrap();
    let mut driver = Driver::new(pipeline);
    let (mut changes, mut worst_m, mut meter) = (Vec::new(), 0.0_f64, AccuracyMeter::default());
    let mut first = None;
    let mut last_truth = None;
    for record in records {
        driver.feed(record, |_, update| match update {
            Update::Truth(at, pose) => {
                meter.truth(at, pose);
                last_truth = Some(pose);
            }
            Update::Event(Event::Localization(lock)) => {
                changes.push(lock.clone());
                worst_m = 0.0;
            }
            Update::Event(Event::Estimate(estimate)) => {
                meter.estimate(estimate.at, estimate.pose);
                first = first.or_else(|| meter.world_from_map());
                if let (Some(world_from_map), Some(truth)) = (first, last_truth) {
                    let error_m = ((world_from_map * estimate.pose).position() - truth.position()).norm();
                    worst_m = worst_m.max(error_m);
                }
            }
            _ => {}
        });
    }
    (changes, worst_m)
}

fn flat(duration_s: f64) -> impl Iterator<Item = Record> {
    session(Simulation::new(SimConfig {
        mix: FaultMix::Paper,
        ..SimConfig::usual(World::named("flat").unwrap(), 3, duration_s, 32)
    }))
}

#[test]
fn a_slip_is_detected_reported_and_corrected() {
    let (changes, worst_m) = drive(&slipped(flat(150.0)));
    println!("{changes:?}, then at most {worst_m:.3} m off");
    let [lost, found] = &changes[..] else { panic!("{changes:?}") };
    assert_eq!(lost.change, LocalizationChange::Lost);
    assert!((SLIP_S - 1.0..SLIP_S + 10.0).contains(&lost.at.seconds()), "{lost:?}");
    assert!((SLIP_S - 1.0..SLIP_S + 2.0).contains(&found.since.seconds()), "{found:?}");
    let LocalizationChange::Regained { moved_m, turned_rad } = found.change else { panic!("{found:?}") };
    assert!((moved_m - SLIP_M).abs() < 0.1 && turned_rad.abs() < 0.15, "{found:?}");
    assert!(worst_m < 0.2, "{worst_m} m");
}
