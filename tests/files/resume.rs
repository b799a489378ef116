//! A session file between two halves of a real drive: the resumed run is the same to the bit as one that resumes in memory.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd::session_file::{HEADER, decode, encode};
use slamd_capture::CaptureReader;
use slamd_core::{Config, Driver, Event, Method, Raster, Record, SavedState, SensorState, Start, Update};

const HALF_S: f64 = 60.0;
/// The board's greeting, from which a pipeline learns ring and encoder ticks, is before this.
const GREETING_S: f64 = 0.34;

/// The committed capture of a drive with the paper's eight faults.
fn capture() -> (Config, Vec<Record>) {
    let mut reader = CaptureReader::open(&slamd_testkit::root().join("replay/flat-paper-faults.mcap")).unwrap();
    let config = Config { method: Method::Walls, ..Config::from_toml(&reader.info().config_toml).unwrap() };
    let records = reader.by_ref().map(Result::unwrap).collect();
    assert_eq!(reader.damage(), None);
    (config, records)
}

fn driver(config: &Config, start: Start) -> Driver {
    Driver::new(slamd_paper::pipeline(config, start).unwrap())
}

/// What a run has reported, and its end.
#[derive(Debug, PartialEq)]
struct Run {
    /// Poses, changes of sensors, losses of the pose: text of floats is exact.
    events: Vec<String>,
    states: Vec<SensorState>,
    raster: Raster,
    saved: SavedState,
}

/// Feeds the greeting and the second half to a run that resumes from `state`. Its map after the greeting comes first.
fn second_half(config: &Config, records: &[Record], state: SavedState) -> (Raster, Run) {
    let mut driver = driver(config, Start::Resume(Box::new(state)));
    let mut events = Vec::new();
    let mut take = |driver: &mut Driver, record: &Record| {
        driver.feed(record, |_, update| {
            if let Update::Event(event @ (Event::Estimate(_) | Event::Fault(_) | Event::Localization(_))) = update {
                events.push(format!("{event:?}"));
            }
        });
    };
    let at_s = |record: &&Record| record.at().seconds();
    records.iter().filter(|record| at_s(record) < GREETING_S).for_each(|record| take(&mut driver, record));
    let resumed = driver.pipeline().raster();
    records.iter().filter(|record| at_s(record) > HALF_S).for_each(|record| take(&mut driver, record));
    driver.end(|_, _| {});
    let pipeline = driver.pipeline();
    let (states, raster) = (pipeline.states().to_vec(), pipeline.raster());
    (resumed, Run { events, states, raster, saved: pipeline.saved_state().unwrap() })
}

#[test]
fn a_drive_resumes_from_its_session_file_to_the_bit() {
    let (config, records) = capture();
    let mut first = driver(&config, Start::Fresh);
    for record in records.iter().take_while(|record| record.at().seconds() <= HALF_S) {
        first.feed(record, |_, _| {});
    }
    let saved = first.pipeline().saved_state().unwrap();
    assert!(!saved.walls.is_empty() && !saved.map.tiles.is_empty(), "the drive has learnt nothing");
    assert!(saved.sensors.iter().any(|sensor| sensor.state != SensorState::Healthy), "no fault was found");

    let bytes = encode(&saved);
    let read = decode(&bytes).unwrap();
    assert_eq!(read, saved);
    assert_eq!(encode(&read), bytes, "a round trip changes no bit");
    for index in [0, 8, 12, HEADER - 1, HEADER, bytes.len() - 1] {
        let mut damaged = bytes.clone();
        damaged[index] ^= 1;
        assert!(decode(&damaged).is_err(), "header or checksum does not notice a flipped bit in byte {index}");
    }

    let (resumed, from_file) = second_half(&config, &records, read);
    assert!(resumed == first.pipeline().raster(), "the map is the same to the bit");
    let (_, from_memory) = second_half(&config, &records, saved);
    assert!(from_file.events.len() > 500, "{} events", from_file.events.len());
    assert!(from_file.states.contains(&SensorState::Healthy));
    assert!(from_file == from_memory, "the second halves differ");
}
