//! `summary.json`: a run in a few numbers, keys always in the same order.

use super::{ModelReport, Source};
use hdrhistogram::Histogram;
use serde::Serialize;
use slamd_core::{Calibration, Counters, EncoderEvent, KnownMapSearch, SearchState};
use slamd_metrics::{Accuracy, FaultScore};
use std::fmt;
use std::time::Duration;

/// A run in a few numbers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Why there is no map; none if there is one. Then `map.png` shows this sentence.
    pub nothing_mapped: Option<String>,
    /// What of the run is doubtful, one sentence each; empty if nothing is.
    pub doubtful: Vec<String>,
    /// Length of the session, seconds.
    pub duration_s: f64,
    /// Length of the path, metres.
    pub path_m: f64,
    /// The sensors that were ignored at the end, by id.
    pub ignored_sensors: Vec<usize>,
    /// Sweeps used.
    pub sweeps: u64,
    /// Sweeps given up because too much of them was missing.
    pub dropped: u64,
    /// Frames with a correct checksum.
    pub frames: u64,
    /// Frames whose checksum did not hold.
    pub crc_errors: u64,
    /// Frames that the sequence numbers say are missing.
    pub lost_frames: u64,
    /// Wheel steps across a wrap at 16 bits; they are used.
    pub unwrapped_steps: u64,
    /// Wheel steps that no wheel can roll; they are not used.
    pub refused_steps: u64,
    /// How often the robot lost its pose on the map.
    pub lock_losses: u64,
    /// Seconds of poses that `lock.csv` calls uncertain, to the last pose if they were uncertain then.
    pub uncertain_s: f64,
    /// Mean microseconds of computing per sweep; none where nothing was timed.
    pub mean_us_per_sweep: Option<f64>,
    /// 99th percentile of the same.
    pub p99_us_per_sweep: Option<f64>,
    /// From the last byte read to the pose written and shown; none where nothing was live.
    pub latency: Option<Latency>,
    /// In 19 of 20 cases the true position is within this distance, metres: at the last pose, and the greatest of all certain poses. None
    /// without a certain pose.
    pub position_within_m: Option<[f64; 2]>,
    /// Square metres of the map of which something is known: floor, walls and furniture, and what was seen from afar.
    pub map_m2: f64,
    /// Free square metres of each room, the largest first: areas that walls close and that the robot was in.
    pub rooms_m2: Vec<f64>,
    /// SHA-256 of `trajectory.tum`.
    pub trajectory_sha256: String,
    /// SHA-256 of `map.pgm`.
    pub map_sha256: String,
    /// The wheels as the run found them; none where the method does not estimate them.
    pub calibration: Option<Calibration>,
    /// The wheel encoders that were broken at the end.
    pub encoder_faults: Vec<EncoderFault>,
    /// In what the robot differed from its configuration.
    pub model: Vec<ModelReport>,
    /// Result of the search for the pose in a known map; none if there was no search.
    pub position: Option<KnownMapPosition>,
    /// What the results were made from.
    pub source: Source,
    /// What became of the folder's earlier results, a sentence for people.
    #[serde(skip)]
    pub remark: Option<String>,
    /// Errors against the true path, where it is known.
    #[serde(flatten)]
    pub accuracy: Option<Accuracy>,
    /// The fault detector against the true faults, where they are known.
    #[serde(flatten)]
    pub faults: Option<FaultScore>,
}

/// Result of the search for the robot's pose in a known map.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct KnownMapPosition {
    /// True if the pose is known.
    pub is_known: bool,
    /// Driving time since the search started, seconds.
    pub driven_s: f64,
    /// Explanation for people.
    pub reason: String,
}

impl From<&KnownMapSearch> for KnownMapPosition {
    fn from(search: &KnownMapSearch) -> Self {
        Self { is_known: search.state == SearchState::Found, driven_s: search.driven_s, reason: search.reason.clone() }
    }
}

/// A broken wheel encoder.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EncoderFault {
    /// `left` or `right`.
    pub wheel: &'static str,
    /// `dead` or `reversed`.
    pub state: &'static str,
    /// Seconds of the session at which it was found.
    pub found_s: f64,
    /// In words.
    pub reason: String,
}

impl EncoderFault {
    pub(super) fn new(event: &EncoderEvent) -> Self {
        Self {
            wheel: event.wheel.word(),
            state: event.state.word(),
            found_s: event.at.seconds(),
            reason: event.reason.clone(),
        }
    }
}

/// How late poses were, milliseconds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Latency {
    /// Half of them at most.
    pub p50_ms: f64,
    /// All but one in a hundred.
    pub p99_ms: f64,
    /// All but one in a thousand.
    pub p999_ms: f64,
    /// The latest.
    pub max_ms: f64,
}

impl fmt::Display for Latency {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { p50_ms, p99_ms, p999_ms, max_ms } = self;
        write!(f, "byte to pose {p50_ms:.2} ms, p99 {p99_ms:.2}, p99.9 {p999_ms:.2}, greatest {max_ms:.2}")
    }
}

impl Summary {
    pub(super) fn new(counters: Counters) -> Self {
        Self {
            nothing_mapped: None,
            doubtful: Vec::new(),
            duration_s: 0.0,
            path_m: 0.0,
            ignored_sensors: Vec::new(),
            sweeps: counters.sweeps,
            dropped: counters.dropped_sweeps,
            frames: counters.frames,
            crc_errors: counters.crc_errors,
            lost_frames: counters.lost_frames,
            unwrapped_steps: counters.unwrapped_steps,
            refused_steps: counters.refused_steps,
            lock_losses: 0,
            uncertain_s: 0.0,
            mean_us_per_sweep: None,
            p99_us_per_sweep: None,
            latency: None,
            position_within_m: None,
            map_m2: 0.0,
            rooms_m2: Vec::new(),
            trajectory_sha256: String::new(),
            map_sha256: String::new(),
            calibration: None,
            encoder_faults: Vec::new(),
            model: Vec::new(),
            position: None,
            source: Source::default(),
            remark: None,
            accuracy: None,
            faults: None,
        }
    }

    /// The JSON text of `summary.json`.
    ///
    /// # Panics
    /// Never: numbers and strings have a JSON form.
    #[must_use]
    pub fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).expect("numbers and strings") + "\n"
    }
}

/// Times of sweeps in constant memory, to three digits.
pub(super) struct Timings {
    nanoseconds: Histogram<u64>,
}

impl Timings {
    pub(super) fn new() -> Self {
        let nanoseconds = Histogram::new_with_bounds(1, MAX_NS, 3).expect("bounds and digits are in the crate's range");
        Self { nanoseconds }
    }

    pub(super) fn add(&mut self, elapsed: Duration) {
        self.nanoseconds.saturating_record(u64::try_from(elapsed.as_nanos()).unwrap_or(MAX_NS));
    }

    /// The same as how late poses were.
    pub(super) fn latency(&self) -> Option<Latency> {
        let ms = |ns: u64| 1e-6 * ns as f64;
        let quantile = |share| ms(self.nanoseconds.value_at_quantile(share));
        (!self.nanoseconds.is_empty()).then(|| Latency {
            p50_ms: quantile(0.5),
            p99_ms: quantile(0.99),
            p999_ms: quantile(0.999),
            max_ms: ms(self.nanoseconds.max()),
        })
    }

    /// Mean and 99th percentile, microseconds.
    pub(super) fn mean_and_p99_us(&self) -> Option<(f64, f64)> {
        let p99_ns = self.nanoseconds.value_at_quantile(0.99) as f64;
        (!self.nanoseconds.is_empty()).then(|| (self.nanoseconds.mean() / 1000.0, p99_ns / 1000.0))
    }
}

/// Longer times count as a minute.
const MAX_NS: u64 = 60_000_000_000;
