//! Fuzzing: random bytes and damaged files, from one seed, against the code that reads them.
//!
//! Nothing may panic, nor take memory or work out of proportion to what was given.

mod doors;
mod found;
mod mutation;

pub use doors::*;
pub use found::{found, keep};
use mutation::Mutator;
use slamd::session_file;
use slamd_capture::{CaptureInfo, CaptureWriter, Record};
use slamd_core::{Config, Method, Pipeline, SavedState};
use slamd_eval::import::{Options, carmen, ring};
use slamd_files::OutputGuard;
use slamd_protocol::FrameDecoder;
use slamd_sim::simulation::{SimConfig, Simulation, session};
use slamd_sim::world::World;
use std::path::Path;

/// The kinds of files that slamd reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Capture,
    Session,
    Config,
    World,
    Ring,
    Carmen,
    /// Lines of a client of the API.
    ApiLine,
}

impl Kind {
    pub const ALL: [Self; 7] =
        [Self::Capture, Self::Session, Self::Config, Self::World, Self::Ring, Self::Carmen, Self::ApiLine];
}

/// What is mutated: sound inputs of every kind.
pub struct Corpus {
    drive: Vec<Record>,
    /// Kind and payload of the frames of a drive.
    frames: Vec<(u8, Vec<u8>)>,
    captures: Vec<Vec<u8>>,
    session: Vec<u8>,
    configs: Vec<String>,
    world: String,
    ring: String,
    carmen: String,
}

const SENSORS: u8 = 16;
const DRIVE_S: f64 = 45.0;
/// A file is at most this long: enough for every structure, short enough for a million of them.
const FILE_RECORDS: usize = 60;

impl Corpus {
    pub fn build() -> Self {
        let simulation =
            Simulation::new(SimConfig::usual(World::named("flat").expect("built in"), 7, DRIVE_S, SENSORS));
        let drive: Vec<Record> = session(simulation).collect();
        let mut decoder = FrameDecoder::new();
        let mut frames = Vec::new();
        for byte in drive.iter().flat_map(received) {
            if let Some(frame) = decoder.push(*byte) {
                frames.push((frame.kind, frame.payload.to_vec()));
            }
        }
        let captures = vec![capture(&drive[..FILE_RECORDS]), unsealed(&drive[..FILE_RECORDS])];
        let mut pipeline = slamd_paper::pipeline(&Config::default(), slamd_core::Start::Fresh)
            .expect("a fresh start holds nothing that could be refused");
        drive.iter().for_each(|record| feed(&mut pipeline, record));
        let memory = pipeline.saved_state().expect("the drive is long enough for a map");
        Self {
            drive,
            frames,
            captures,
            session: session_file::encode(&memory),
            configs: vec![
                include_str!("../../../configs/corridor8.toml").into(),
                Config::default().to_toml() + "\n[[ring.sensors]]\nbearing_deg = 90\nhalf_angle_deg = 15\n",
            ],
            world: include_str!("../../../configs/worlds/corner.toml").into(),
            ring: ring_csv(),
            carmen: carmen_log(),
        }
    }

    /// What the drive is remembered by.
    pub fn saved_state(&self) -> SavedState {
        session_file::decode(&self.session).expect("sound")
    }

    /// The beginning of the drive.
    pub fn start(&self) -> &[Record] {
        &self.drive[..FILE_RECORDS]
    }

    /// The whole drive, once more.
    pub fn drive(&self, pipeline: &mut Pipeline) {
        self.drive.iter().for_each(|record| feed(pipeline, record));
    }

    /// What each fuzz target begins with.
    pub fn seeds(&self) -> [(&'static str, Vec<Vec<u8>>); 6] {
        let pieces = |frames: &[(u8, Vec<u8>)]| -> Vec<u8> {
            frames.iter().flat_map(|(kind, payload)| piece(*kind, payload)).collect()
        };
        let map = postcard::to_allocvec(&self.saved_state().map).expect("numbers and lists");
        [
            ("line", self.frames.chunks(self.frames.len().div_ceil(8)).map(pieces).collect()),
            ("capture", self.captures.clone()),
            ("session", vec![self.session[session_file::HEADER..].to_vec()]),
            ("config", self.configs.iter().map(|text| text.clone().into_bytes()).collect()),
            ("map", vec![map]),
            ("request", [0, 255].map(|first| [&[first], REQUESTS.as_bytes()].concat()).to_vec()),
        ]
    }

    /// Raw bytes into the pipeline: a drive in which frames are damaged behind their checksums, frames of random content, and noise.
    pub fn bytes(&self, count: u64, seed: u64) -> Outcome {
        let mut mutator = Mutator::new(seed);
        let method = if seed % 4 == 3 { Method::Paper } else { Method::Walls };
        let mut line = Line::new(&Config { method, ..Config::default() });
        for (i, (kind, payload)) in self.frames.iter().enumerate() {
            let (mut kind, mut payload) = (*kind, payload.clone());
            if i > 10 && mutator.chance(0.01) {
                payload = mutator.bytes(payload, 2);
            }
            if i > 10 && mutator.chance(0.001) {
                kind = mutator.noise(1)[0];
            }
            line.give(&framed(kind, i, &payload));
        }
        let wild = line.outcome.bytes + (count - line.outcome.bytes.min(count)) / 16;
        while line.outcome.bytes < wild {
            let (kind, payload) = &self.frames[mutator.below(self.frames.len())];
            let (payload, number) = (mutator.bytes(payload.clone(), 6), mutator.below(256));
            line.give(&framed(*kind, number, &payload));
        }
        while line.outcome.bytes < count {
            line.give(&mutator.noise(1_024));
        }
        line.end()
    }

    /// A file of a kind, made worse and read; where it is accepted it is used.
    pub fn file(&self, kind: Kind, seed: u64, folder: &Path) -> Outcome {
        let mut mutator = Mutator::new(seed);
        let accepted = match kind {
            Kind::Capture => {
                let capture = self.captures[mutator.below(self.captures.len())].clone();
                read_capture(&mutator.bytes(capture, 6))
            }
            Kind::Session => read_session(&session_bytes(&mut mutator, &self.session)),
            Kind::Config => {
                let config = self.configs[mutator.below(self.configs.len())].clone();
                read_config(&mutator.text(&config), self.start())
            }
            Kind::ApiLine => read_requests(&mut mutator),
            Kind::World => World::from_toml("fuzz.toml", &mutator.text(&self.world)).is_ok(),
            Kind::Ring | Kind::Carmen => {
                let config = Config::from_toml(&self.configs[0]).expect("sound");
                let capture = folder.join("imported.mcap");
                let text = if kind == Kind::Ring { &self.ring } else { &self.carmen };
                let text = mutator.text(text);
                let output = OutputGuard::new(true).output(&capture).expect("it can be written");
                let import = if kind == Kind::Ring {
                    ring::read(text.as_bytes(), "fuzz", &config, &Options::default())
                } else {
                    carmen::read(text.as_bytes(), "fuzz", &config, &Options::default())
                };
                import.and_then(|drive| drive.write(output)).is_ok()
                    && read_capture(&std::fs::read(&capture).expect("it was written"))
            }
        };
        Outcome { accepted, ..Outcome::default() }
    }
}

/// A session made worse, in every other case with a checksum that holds.
fn session_bytes(mutator: &mut Mutator, session: &[u8]) -> Vec<u8> {
    let head = mutator.chance(0.7);
    let front = if head { session.len().min(600) } else { session.len() };
    let mut bytes = mutator.bytes(session[..front].to_vec(), 4);
    bytes.extend(&session[front..]);
    if mutator.chance(0.8) && bytes.len() >= session_file::HEADER {
        bytes[..12].copy_from_slice(&session[..12]);
        reseal(&mut bytes);
    }
    bytes
}

/// Sound requests of a client.
const REQUESTS: &str = "?WATCH={\"enable\":true,\"pose_hz\":5,\"sweep_hz\":0,\"map_hz\":0.2,\"stats_hz\":1};\n?POLL;\r\n?MAP;\n?VERSION;\n\
                        ?TOKEN=\"correct-horse-battery-staple\";\n";

/// Requests made worse, in pieces, to a client that takes little. True where all are understood.
fn read_requests(mutator: &mut Mutator) -> bool {
    let bytes = if mutator.chance(0.5) {
        mutator.text(REQUESTS).into_bytes()
    } else {
        mutator.bytes(REQUESTS.as_bytes().to_vec(), 6)
    };
    let step = 1 + mutator.below(64);
    read_requests_of_a_client(&bytes, mutator.chance(0.2), step)
}

fn capture(records: &[Record]) -> Vec<u8> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("sound.mcap");
    let mut writer = CaptureWriter::create(&path, &CaptureInfo::default()).expect("created");
    for record in records {
        writer.record(record).expect("written");
    }
    writer.finish().expect("finished");
    std::fs::read(path).expect("there")
}

/// A capture without checksums, so that what is behind them is reached.
fn unsealed(records: &[Record]) -> Vec<u8> {
    let mut file = std::io::Cursor::new(Vec::new());
    let options = mcap::WriteOptions::new().compression(None).calculate_chunk_crcs(false).chunk_size(Some(256));
    let mut writer = options.create(&mut file).expect("memory");
    let topics = [slamd_capture::RECEIVED_TOPIC, slamd_capture::SENT_TOPIC];
    let ids =
        topics.map(|topic| writer.add_channel(0, topic, "x", &std::collections::BTreeMap::new()).expect("memory"));
    for record in records {
        let (id, bytes) = match record {
            Record::Received { bytes, .. } => (ids[0], bytes),
            Record::Sent { bytes, .. } => (ids[1], bytes),
            Record::Opened { .. } | Record::Truth { .. } => continue,
        };
        let log_time = record.at().us() * 1000;
        let header = mcap::records::MessageHeader { channel_id: id, sequence: 0, log_time, publish_time: log_time };
        writer.write_to_known_channel(&header, bytes).expect("memory");
    }
    writer.finish().expect("memory");
    drop(writer);
    file.into_inner()
}

fn ring_csv() -> String {
    let names: Vec<String> = (0..8).map(|sensor| format!("r{sensor}")).collect();
    let mut text = format!("t_s,left_ticks,right_ticks,{}\n", names.join(","));
    for i in 0..40 {
        text += &format!("{:.2},{},{},1.2,inf,0.5,,2.25,2.9,0.03,1.0\n", 0.1 * f64::from(i), 12 * i, 13 * i);
    }
    text
}

fn carmen_log() -> String {
    let mut text = String::from("# a comment\n");
    for i in 0..20 {
        let t_s = 0.1 * f64::from(i);
        text += &format!("ODOM {t_s} 0.0 0.01 0.2 0.0 0.0 {t_s} host {t_s}\n");
        text += &format!("SONAR 8 1.2 2.0 0.5 3 2.25 2.9 0.03 1.0 {t_s} 0 0.01 {t_s} 0 0.01 {t_s} host {t_s}\n");
        text += &format!("FLASER 5 1.2 2.0 0.5 81 2.25 {t_s} 0 0.01 {t_s} 0 0.01 {t_s} host {t_s}\n");
    }
    text
}

/// Most memory that this process ever had, KiB.
pub fn most_resident_kib() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|line| line.starts_with("VmHWM")).unwrap_or_default().to_owned();
    line.split_whitespace().nth(1).and_then(|number| number.parse().ok()).unwrap_or_default()
}
