//! The doors through which strangers' bytes come in: each takes any bytes, and what may not be is an assertion. Shared by the tests, which make
//! sound inputs worse, and by the fuzz targets, which find inputs by coverage.

use slamd::api::{Client, Snapshot, Token};
use slamd::session_file;
use slamd_capture::{CaptureReader, Record};
use slamd_core::{Config, Event, Input, Output, Pipeline, SavedState, Start, Timestamp, saved_state::MapState};
use slamd_protocol::{MAX_PAYLOAD, PayloadBuf, encode_frame};
use std::path::Path;

/// What came of an input.
#[derive(Clone, Copy, Debug, Default)]
pub struct Outcome {
    pub bytes: u64,
    pub frames: u64,
    pub sweeps: u64,
    pub outputs: u64,
    pub accepted: bool,
}

/// A pipeline at a serial line.
pub struct Line {
    pipeline: Pipeline,
    at: Timestamp,
    last: Timestamp,
    pub outcome: Outcome,
}

impl Line {
    pub fn new(config: &Config) -> Self {
        let (at, last) = (Timestamp::default(), Timestamp::default());
        Self {
            pipeline: slamd_paper::pipeline(config, slamd_core::Start::Fresh)
                .expect("a fresh start holds nothing that could be refused"),
            at,
            last,
            outcome: Outcome::default(),
        }
    }

    /// Bytes arrive, as fast as the line is.
    pub fn give(&mut self, bytes: &[u8]) {
        self.at = self.at + std::time::Duration::from_micros(87 * bytes.len() as u64);
        self.outcome.bytes += bytes.len() as u64;
        if self.pipeline.next_deadline() <= self.at {
            self.pipeline.handle(Input::Tick { at: self.at });
        }
        self.pipeline.handle(Input::Received { at: self.at, bytes });
        while let Some(output) = self.pipeline.poll_output() {
            self.outcome.outputs += 1;
            if let Output::Event(Event::Estimate(estimate)) = output {
                assert!(estimate.at >= self.last, "time ran back");
                assert!(estimate.pose.x_m.is_finite() && estimate.pose.theta_rad.is_finite());
                self.last = estimate.at;
            }
        }
    }

    /// What came of it.
    pub fn end(mut self) -> Outcome {
        let counters = self.pipeline.counters();
        (self.outcome.frames, self.outcome.sweeps) = (counters.frames, counters.sweeps);
        let _ = (self.pipeline.saved_state(), self.pipeline.raster());
        self.outcome
    }
}

/// Pieces of a line, each behind its first two bytes: the type of a frame that holds its checksum, or [`NOISE`]; and its length.
pub fn line(mut pieces: &[u8], config: &Config) -> Outcome {
    let mut line = Line::new(config);
    let mut number = 0_usize;
    while let [kind, length, rest @ ..] = pieces {
        let (piece, rest) = rest.split_at(rest.len().min(usize::from(*length)));
        if *kind == NOISE {
            line.give(piece);
        } else {
            line.give(&framed(*kind, number, piece));
            number += 1;
        }
        pieces = rest;
    }
    line.end()
}

/// No message has this type.
pub const NOISE: u8 = 0xFF;

/// A frame as a piece for `line`.
pub fn piece(kind: u8, payload: &[u8]) -> Vec<u8> {
    let length = u8::try_from(payload.len()).expect("a payload's length");
    [&[kind, length][..], payload].concat()
}

pub fn received(record: &Record) -> &[u8] {
    match record {
        Record::Received { bytes, .. } => bytes,
        _ => &[],
    }
}

pub fn framed(kind: u8, number: usize, payload: &[u8]) -> Vec<u8> {
    let mut buffer = PayloadBuf::default();
    buffer.extend(payload.iter().copied().take(MAX_PAYLOAD));
    encode_frame(kind, number.to_le_bytes()[0], &buffer).to_vec()
}

pub fn feed(pipeline: &mut Pipeline, record: &Record) {
    if let Some(input) = record.input() {
        pipeline.handle(input);
    }
    while pipeline.poll_output().is_some() {}
}

/// Reads a capture and replays what it holds. True where it opens.
pub fn read_capture(bytes: &[u8]) -> bool {
    let Ok(mut reader) = CaptureReader::begin(bytes, Path::new("fuzz.mcap")) else { return false };
    let mut pipeline = slamd_paper::pipeline(
        &Config::from_toml(&reader.info().config_toml).unwrap_or_default(),
        slamd_core::Start::Fresh,
    )
    .expect("a fresh start holds nothing that could be refused");
    let (mut last, mut given) = (Timestamp::default(), 0);
    for record in reader.by_ref().map_while(Result::ok) {
        assert!(record.at() >= last, "time ran back");
        last = record.at();
        given += received(&record).len();
        feed(&mut pipeline, &record);
    }
    assert!(given <= bytes.len(), "more came out than there is");
    true
}

/// Reads a session file and resumes from it. True if it can be read.
pub fn read_session(bytes: &[u8]) -> bool {
    let Ok(memory) = session_file::decode(bytes) else { return false };
    for start in [Start::Resume(Box::new(memory.clone())), Start::Localize(Box::new(memory))] {
        if let Ok(mut pipeline) = slamd_paper::pipeline(&Config::default(), start) {
            let _ = (pipeline.saved_state(), pipeline.raster(), pipeline.poll_output());
        }
    }
    true
}

/// A session whose checksum holds, whatever its payload is.
pub fn read_sealed_session(payload: &[u8]) -> bool {
    let mut bytes = [&session_file::MAGIC[..], &session_file::VERSION.to_le_bytes(), &[0; 12], payload].concat();
    reseal(&mut bytes);
    read_session(&bytes)
}

/// Reads the map of a session file, localizes a robot in it and continues. True if the map is valid.
pub fn read_map(map: &[u8], mut session: SavedState) -> bool {
    let Ok(map) = postcard::from_bytes::<MapState>(map) else { return false };
    session.map = map;
    let config = ring_config();
    let begun = [Start::Resume(Box::new(session.clone())), Start::Localize(Box::new(session))]
        .map(|start| slamd_paper::pipeline(&config, start).map(|pipeline| pipeline.raster()));
    begun.iter().all(Result::is_ok)
}

/// A robot whose ring and wheels are known before the board sends anything.
pub fn ring_config() -> Config {
    let text = "[robot]\nticks_per_turn = 1440\n[ring.circle]\ncount = 16\nradius_m = 0.15\nhalf_angle_deg = 12.5\n";
    Config::from_toml(text).expect("sound")
}

/// Reads a configuration and drives with it. True where it can be read.
pub fn read_config(text: &str, drive: &[Record]) -> bool {
    let Ok(config) = Config::from_toml(text) else { return false };
    let mut pipeline = slamd_paper::pipeline(&config, slamd_core::Start::Fresh)
        .expect("a fresh start holds nothing that could be refused");
    drive.iter().for_each(|record| feed(&mut pipeline, record));
    assert_eq!(Config::from_toml(&config.to_toml()), Ok(config), "what is written is read");
    true
}

/// Reads what a client of the API sends, `step` bytes at a time, while there is news and it takes as much of the answers. True where
/// every line can be understood.
pub fn read_requests_of_a_client(bytes: &[u8], needs_token: bool, step: usize) -> bool {
    let token = needs_token.then(|| Token::new("correct-horse-battery-staple"));
    let mut client = Client::new(Timestamp::default(), token);
    let (snapshot, map) = (Snapshot::default(), bytes::Bytes::from_static(b"{}\n"));
    let mut at = Timestamp::default();
    for piece in bytes.chunks(step) {
        client.received(at, piece);
        client.update(at, &snapshot, 1);
        client.map(at, Some(&map));
        let count = step.min(client.outgoing().len());
        client.wrote(at, count);
        at = client.deadline().max(at);
        client.tick(at);
    }
    bytes.split(|byte| *byte == b'\n').all(|line| slamd::api::parse(line).is_ok())
}

pub fn reseal(bytes: &mut [u8]) {
    let length = (bytes.len() - session_file::HEADER) as u64;
    bytes[12..20].copy_from_slice(&length.to_le_bytes());
    let crc = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);
    let crc = crc.checksum(&[&bytes[8..20], &bytes[session_file::HEADER..]].concat());
    bytes[20..24].copy_from_slice(&crc.to_le_bytes());
}
