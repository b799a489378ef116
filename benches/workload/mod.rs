//! What the benches of the stages run: a committed capture, taken apart once, and each stage fed with what it gets in the pipeline.

#![allow(dead_code, unreachable_pub, reason = "each bench associations its part")]

use slamd_capture::{CaptureReader, Record};
use slamd_core::{
    Config, Estimate, Event, Input, Method, Output, Pipeline, Ring, Sweep, Timestamp,
    stages::{
        Aligner, Detector, DominantDirections, EkfSlam, OccupancyGrid, PcaBlock, ReturnKind, Wheels, integrate_beam,
    },
};
use slamd_protocol::{FrameDecoder, Message};
use slamd_publish::Outputs;
use std::path::{Path, PathBuf};

/// The committed captures.
pub const CAPTURES: [&str; 2] = ["flat-paper-faults", "flat-emulated-mega"];

/// One capture, as every stage sees it.
pub struct Drive {
    config: Config,
    records: Vec<Record>,
    messages: Vec<(Timestamp, Message)>,
    ring: Ring,
    /// Those that an estimate followed, with it.
    sweeps: Vec<(Sweep, Estimate)>,
    events: Vec<Event>,
    out: tempfile::TempDir,
}

/// Sweeps whose returns are searched for an axis together, as the walls method does while the heading is in doubt.
const AXIS_SWEEPS: usize = 25;
/// Wheels cost the same whatever their size.
const WHEELS: Wheels = Wheels { metres_per_tick: [1e-4; 2], base_m: 0.26 };

fn path(capture: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("replay").join(capture).with_extension("mcap")
}

impl Drive {
    /// Reads a committed capture and runs it once.
    pub fn load(capture: &str, method: Method) -> Self {
        let mut reader = CaptureReader::open(&path(capture)).expect("a committed capture");
        let mut config = Config::from_toml(&reader.info().config_toml).expect("its configuration");
        config.method = method;
        let records: Vec<Record> = reader.by_ref().map(|record| record.expect("it is whole")).collect();
        let mut pipeline = slamd_paper::pipeline(&config, slamd_core::Start::Fresh)
            .expect("a fresh start holds nothing that could be refused");
        pipeline.keep_sweeps();
        let mut events = Vec::new();
        run(&mut pipeline, &records, |output| {
            if let Output::Event(event) = output {
                events.push(event);
            }
        });
        let mut sweeps = pipeline.take_sweeps().into_iter();
        let pair = |estimate: Estimate| Some((sweeps.find(|sweep| sweep.index == estimate.sweep)?, estimate));
        let estimates = events.iter().filter_map(|event| match event {
            Event::Estimate(estimate) => Some(*estimate),
            _ => None,
        });
        let sweeps = estimates.filter_map(pair).collect();
        let mut messages = Vec::new();
        decode(&records, |at, message| messages.push((at, message)));
        let ring = pipeline.ring().expect("the capture tells it").clone();
        let out = tempfile::tempdir().expect("a folder");
        Self { config, records, messages, ring, sweeps, events, out }
    }

    /// Sweeps that were used.
    pub fn sweeps(&self) -> u64 {
        self.sweeps.len() as u64
    }

    /// How long it was in the recording, seconds.
    pub fn duration_s(&self) -> f64 {
        self.records.last().map_or(0.0, |record| record.at().seconds())
    }

    /// Opens and reads the capture.
    pub fn read(&self, capture: &str) -> usize {
        CaptureReader::open(&path(capture)).expect("a committed capture").count()
    }

    /// Bytes → frames → messages.
    pub fn decode(&self) -> usize {
        let mut messages = 0;
        decode(&self.records, |_, _| messages += 1);
        messages
    }

    /// Messages → sweeps.
    pub fn align(&self) -> usize {
        let mut aligner = Aligner::new(&self.config.ring);
        aligner.set_ring(self.ring.clone());
        aligner.set_wheels(WHEELS);
        let mut sweeps = 0;
        for (at, message) in &self.messages {
            // A board that restarts within the capture begins again; the cost is the same.
            let aligned = match message {
                Message::Sonar(sonar) => aligner.sonar(sonar, *at, |_| sweeps += 1),
                Message::Encoder(encoder) => aligner.encoder(encoder, *at),
                _ => Ok(()),
            };
            if aligned.is_err() {
                aligner.restart();
            }
        }
        sweeps
    }

    /// Principal components of three instants.
    pub fn pca(&self) -> f64 {
        let mut block = PcaBlock::new(self.ring.len(), self.config.ring.max_range_m);
        let analyses =
            self.sweeps.iter().map(|(sweep, _)| if block.push(sweep) { block.analyse(|_, _| 1.0) } else { 0.0 });
        analyses.sum()
    }

    /// The whole fault detector, with PCA in it, without a map.
    pub fn faults(&self) -> usize {
        let mut detector = Detector::new(&self.ring, self.config.ring.max_range_m);
        let mut events = Vec::new();
        for (sweep, _) in &self.sweeps {
            detector.inspect(sweep, |_| None, &mut events);
        }
        events.len()
    }

    /// Returns → the building's axis.
    pub fn hough(&self) -> f64 {
        let mut finder = DominantDirections::default();
        let windows = self.sweeps.chunks(AXIS_SWEEPS).map(|window| {
            finder.clear();
            for (sweep, estimate) in window {
                sweep.beams.iter().for_each(|beam| finder.add(estimate.pose, beam));
            }
            finder.find().map_or(0.0, |axis| axis.angle_rad)
        });
        windows.sum()
    }

    /// Wheels and returns → pose and walls.
    pub fn ekf(&self) -> usize {
        let (_, first) = self.sweeps.first().expect("sweeps");
        let mut tracker = EkfSlam::new(first.pose, first.covariance[(2, 2)].sqrt(), self.config.robot.wheels());
        for (sweep, _) in &self.sweeps {
            tracker.predict(sweep.left_m, sweep.right_m);
            tracker.predict_ranges(sweep);
            tracker.correct(sweep, true, |_| true);
        }
        tracker.walls().len()
    }

    /// Every beam's cone into the grid.
    pub fn grid(&self) -> u64 {
        let mut grid = OccupancyGrid::new(self.config.map.cell_m);
        for (sweep, estimate) in &self.sweeps {
            grid.revise();
            for beam in &sweep.beams {
                let (range_m, kind) = match beam.range_m {
                    range_m if range_m.is_finite() => (range_m, ReturnKind::Something),
                    _ if beam.is_clear() => (self.config.ring.max_range_m, ReturnKind::Nothing),
                    _ => continue,
                };
                integrate_beam(&mut grid, estimate.pose * beam.robot_from_sensor, beam.half_angle_rad, range_m, kind);
            }
        }
        grid.refused()
    }

    /// Events → files, but for the map at the end.
    pub fn publish(&self) -> usize {
        let mut outputs = Outputs::create(self.out.path()).expect("an output folder");
        for event in &self.events {
            outputs.event(event);
        }
        self.events.len()
    }

    /// All of it but the files.
    pub fn pipeline(&self) -> u64 {
        let mut pipeline = slamd_paper::pipeline(&self.config, slamd_core::Start::Fresh)
            .expect("a fresh start holds nothing that could be refused");
        run(&mut pipeline, &self.records, drop);
        pipeline.counters().sweeps
    }
}

fn decode(records: &[Record], mut each: impl FnMut(Timestamp, Message)) {
    let mut decoder = FrameDecoder::new();
    for record in records {
        let Record::Received { at, bytes } = record else { continue };
        for &byte in bytes {
            let Some(frame) = decoder.push(byte) else { continue };
            if let Ok(message) = Message::parse(frame.kind, frame.payload) {
                each(*at, message);
            }
        }
    }
}

/// Feeds a capture to a pipeline as a session does.
fn run(pipeline: &mut Pipeline, records: &[Record], mut each: impl FnMut(Output)) {
    let mut handle = |input| {
        pipeline.handle(input);
        std::iter::from_fn(|| pipeline.poll_output()).for_each(&mut each);
        pipeline.next_deadline()
    };
    let mut deadline = Timestamp::default();
    for record in records {
        while deadline <= record.at() {
            deadline = handle(Input::Tick { at: deadline });
        }
        deadline = record.input().map_or(deadline, &mut handle);
    }
}
