//! In steady state a sweep allocates nothing: neither the estimator, nor the events, nor what is drained.
//!
//! Allowed are what the pipeline must keep for ever or has to say in words, and only in that very input: a new tile of the map, a new wall, a
//! sensor's verdict, the lock's loss and return, a question to the board. The paper's method does not tell
//! how many tiles its map has, and is not looked at.

#![allow(clippy::unwrap_used, reason = "a test may")]

use allocation_counter::measure;
use slamd_capture::CaptureReader;
use slamd_core::{Config, Event, Input, Output, Pipeline, Timestamp};

/// By then the ring and the axis are known, and the clock's windows of a minute are as long as they get.
const WARM_UP_S: f64 = 65.0;

/// What one input caused.
#[derive(Default)]
struct Caused {
    allocations: u64,
    bytes: u64,
    sweeps: u64,
    /// A message was logged, or something was requested.
    said: bool,
}

fn cause(pipeline: &mut Pipeline, input: Input<'_>) -> Caused {
    let mut caused = Caused::default();
    let info = measure(|| {
        pipeline.handle(input);
        while let Some(output) = pipeline.poll_output() {
            match output {
                Output::Event(Event::Estimate(_)) => caused.sweeps += 1,
                Output::Event(_) | Output::Transmit(_) => caused.said = true,
            }
        }
    });
    (caused.allocations, caused.bytes) = (info.count_total, info.bytes_total);
    caused
}

/// Tiles of the map and walls, as far as the method remembers them.
fn kept(pipeline: &Pipeline) -> [usize; 2] {
    pipeline.saved_state().map_or([0; 2], |memory| [memory.map.tiles.len(), memory.walls.len() + memory.inactive.len()])
}

/// Replays a committed capture; gives the sweeps after the warm-up and complaints about those that allocated without a reason.
fn allocating(capture: &str) -> (u64, Vec<String>) {
    let path = slamd_testkit::root().join("replay").join(capture);
    let mut capture = CaptureReader::open(&path).unwrap();
    let config = Config::from_toml(&capture.info().config_toml).unwrap();
    let mut pipeline = slamd_paper::pipeline(&config, slamd_core::Start::Fresh).unwrap();
    let (mut sweeps, mut complaints, mut before) = (0, Vec::new(), [0; 2]);
    let mut look = |pipeline: &mut Pipeline, at: Timestamp, input: Input<'_>| {
        let caused = cause(pipeline, input);
        if at.seconds() > WARM_UP_S {
            sweeps += caused.sweeps;
        }
        if caused.allocations == 0 {
            return;
        }
        let now = kept(pipeline);
        if at.seconds() > WARM_UP_S && !caused.said && now == before {
            let Caused { allocations, bytes, .. } = caused;
            complaints.push(format!("{:.3} s: {allocations} allocations, {bytes} bytes", at.seconds()));
        }
        before = now;
    };
    for record in &mut capture {
        let record = record.unwrap();
        while pipeline.next_deadline() <= record.at() {
            let at = pipeline.next_deadline();
            look(&mut pipeline, at, Input::Tick { at });
        }
        if let Some(input) = record.input() {
            look(&mut pipeline, record.at(), input);
        }
    }
    (sweeps, complaints)
}

#[test]
fn no_sweep_allocates_with_the_walls_method() {
    let (sweeps, complaints) = allocating("flat-paper-faults.mcap");
    assert!(sweeps >= 1_700, "only {sweeps} sweeps");
    let count = complaints.len();
    assert!(complaints.is_empty(), "{count} inputs of {sweeps} sweeps allocate:\n{}", complaints.join("\n"));
}
