//! A bad cable costs sweeps, not the map: one byte in a hundred suffers.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd_capture::Record;
use slamd_core::{Config, Event, Input, Output, Timestamp};
use slamd_metrics::AccuracyMeter;
use slamd_sim::link::LinkFaults;
use slamd_sim::simulation::{SimConfig, Simulation};
use slamd_sim::world::World;

#[derive(Debug)]
struct Drive {
    sweeps: u64,
    bad_frames: u64,
    ate_m: f64,
    occupied: usize,
}

/// Two minutes through the flat; the line from the host to the board is good, the line from the board to the host is this one.
fn drive(link: LinkFaults) -> Drive {
    let mut simulation =
        Simulation::new(SimConfig { link, ..SimConfig::usual(World::named("flat").unwrap(), 11, 120.0, 32) });
    let mut pipeline = slamd_paper::pipeline(&Config::default(), slamd_core::Start::Fresh).unwrap();
    let mut meter = AccuracyMeter::default();
    for ms in (0..120_000).step_by(5) {
        let now = Timestamp::from_us(ms * 1_000);
        while let Some(record) = simulation.poll(now) {
            match record {
                Record::Received { at, bytes } => pipeline.handle(Input::Received { at, bytes: &bytes }),
                Record::Truth { at, pose } => meter.truth(at, pose),
                Record::Sent { .. } | Record::Opened { .. } => {}
            }
        }
        if pipeline.next_deadline() <= now {
            pipeline.handle(Input::Tick { at: now });
        }
        while let Some(output) = pipeline.poll_output() {
            match output {
                Output::Transmit(bytes) => {
                    simulation.hear(now, &bytes);
                    pipeline.handle(Input::Sent { at: now, bytes: &bytes });
                }
                Output::Event(Event::Estimate(estimate)) => meter.estimate(estimate.at, estimate.pose),
                Output::Event(_) => {}
            }
        }
    }
    let counters = pipeline.counters();
    Drive {
        sweeps: counters.sweeps,
        bad_frames: counters.crc_errors + counters.malformed,
        ate_m: meter.accuracy().unwrap().ate_m,
        occupied: pipeline.raster().occupancy.iter().filter(|&&cell| cell > 65).count(),
    }
}

#[test]
fn one_percent_of_bad_bytes_still_makes_a_map() {
    let clean = drive(LinkFaults::default());
    let noisy = drive(LinkFaults { bit_flips: 0.008, drops: 0.001, insertions: 0.001 });
    println!("clean {clean:?}\nnoisy {noisy:?}");
    assert!(noisy.bad_frames > 1_000, "the line is bad: {noisy:?}");
    assert!(noisy.sweeps * 2 > clean.sweeps, "{noisy:?} of {clean:?}");
    assert!(noisy.occupied * 2 > clean.occupied, "a map comes out: {noisy:?} of {clean:?}");
    assert!(noisy.ate_m < 0.15, "{noisy:?}");
}
