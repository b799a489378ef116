//! What goes into the pipeline and what comes out.

use crate::geometry::Pose2;
use crate::time::Timestamp;
use bytes::Bytes;
use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};
use std::str::FromStr;

/// One input. Times never run back.
#[derive(Clone, Copy, Debug)]
pub enum Input<'a> {
    /// Bytes read from the board, in any chunks.
    Received {
        /// When the read returned.
        at: Timestamp,
        /// The chunk, exactly as read.
        bytes: &'a [u8],
    },
    /// Bytes that were written to the board.
    Sent {
        /// When the write returned.
        at: Timestamp,
        /// The chunk, exactly as written.
        bytes: &'a [u8],
    },
    /// The port has been opened again: what follows comes over a new connection, perhaps from a board that has restarted.
    Opened {
        /// When it was.
        at: Timestamp,
    },
    /// The deadline named by `Pipeline::next_deadline` has come.
    Tick {
        /// That deadline.
        at: Timestamp,
    },
    /// Nothing more will come: what waits is used.
    End,
}

/// One output.
#[derive(Clone, Debug, PartialEq)]
pub enum Output {
    /// A frame for the board. Whoever writes it hands it back as [`Input::Sent`].
    Transmit(Bytes),
    /// Something that happened.
    Event(Event),
}

/// Something that happened, in the order it happened.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// The board said who it is.
    Board {
        /// When it was heard.
        at: Timestamp,
        /// Name, firmware and protocol version in words.
        description: String,
        /// False where the board speaks another major version: nothing it sends is used.
        compatible: bool,
    },
    /// The ring's geometry is known; sweeps can begin.
    Ring {
        /// When it became known.
        at: Timestamp,
        /// The number of sensors n.
        sensors: usize,
    },
    /// A sweep has been used: the robot's new pose.
    Estimate(Estimate),
    /// A sensor changed its state.
    Fault(FaultEvent),
    /// A wheel encoder changed its state.
    Encoder(EncoderEvent),
    /// The robot's pose in the map became known or unknown.
    Localization(LocalizationEvent),
    /// A line of text from the board, control characters removed.
    BoardLog {
        /// When it was heard.
        at: Timestamp,
        /// The text.
        text: String,
    },
    /// The board restarted: its counters began anew.
    BoardReset {
        /// When it was noticed.
        at: Timestamp,
    },
    /// The board says of itself what cannot be, or does not take a setting.
    BoardTrouble {
        /// When it was heard.
        at: Timestamp,
        /// What, and what to do about it.
        text: String,
    },
}

/// The robot's pose at one sweep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The sweep's reference instant.
    pub at: Timestamp,
    /// The sweep's number.
    pub sweep: u64,
    /// `map_from_robot`.
    pub pose: Pose2,
    /// Covariance of x, y (metres) and theta (radians).
    pub covariance: Matrix3<f64>,
    /// `odom_from_robot`: the encoders alone.
    pub odometry: Pose2,
    /// Normalised innovation squared of this sweep, mean over its measurements: 1 where the filter knows its errors. NaN where nothing
    /// was measured, or the method has none.
    pub nis: f64,
}

/// The robot's pose in the map became known or unknown.
#[derive(Clone, Debug, PartialEq)]
pub struct LocalizationEvent {
    /// The sweep's reference instant.
    pub at: Timestamp,
    /// Start of the interval whose poses were, or still are, uncertain.
    pub since: Timestamp,
    /// What changed.
    pub change: LocalizationChange,
}

impl LocalizationEvent {
    /// True if poses from now on are uncertain.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        match &self.change {
            LocalizationChange::Lost => true,
            LocalizationChange::Regained { .. } | LocalizationChange::Abandoned => false,
            LocalizationChange::KnownMap(search) => search.state != SearchState::Found,
        }
    }
}

/// What changed in the localization.
#[derive(Clone, Debug, PartialEq)]
pub enum LocalizationChange {
    /// The echoes contradict the map; relocalization starts.
    Lost,
    /// The pose is known again.
    Regained {
        /// Error of the position estimate until now, metres.
        moved_m: f64,
        /// Error of the heading estimate until now, radians.
        turned_rad: f64,
    },
    /// No other pose fits better: relocalization ended, the estimate stays.
    Abandoned,
    /// Progress of the search for the start pose in a known map. Only the localizer sends it.
    KnownMap(KnownMapSearch),
}

/// Search for the robot's pose in a known map.
#[derive(Clone, Debug, PartialEq)]
pub struct KnownMapSearch {
    /// State from now on.
    pub state: SearchState,
    /// Driving time since the search started, seconds.
    pub driven_s: f64,
    /// Explanation for people.
    pub reason: String,
}

/// State of the search in a known map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SearchState {
    /// The session began with an unknown pose.
    Started,
    /// The pose is known.
    Found,
    /// The pose was known and is not any more; the search starts again.
    Lost,
    /// The robot has driven for a while and the pose is still unknown.
    StillUnknown,
}

/// What a sensor's readings are worth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum SensorState {
    /// Its readings are used.
    #[default]
    Healthy,
    /// Its readings are ignored.
    Faulty(FaultKind),
}

/// In which way a sensor is broken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum FaultKind {
    /// It always hears nothing within range.
    Saturated,
    /// It never measures.
    Missing,
    /// Its readings scatter.
    Noisy,
    /// It always reads the same value.
    Stuck,
}

impl FaultKind {
    /// All kinds, in the order of every table.
    pub const ALL: [Self; 4] = [Self::Saturated, Self::Missing, Self::Noisy, Self::Stuck];

    /// The word used in files and on the command line.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Saturated => "saturated",
            Self::Missing => "missing",
            Self::Noisy => "noisy",
            Self::Stuck => "stuck",
        }
    }
}

/// The word is not a kind of fault.
#[derive(Clone, Debug, thiserror::Error, PartialEq, Eq)]
#[error("unknown fault kind \"{0}\": it is saturated, missing, noisy or stuck")]
pub struct UnknownFaultKind(String);

impl FromStr for FaultKind {
    type Err = UnknownFaultKind;

    fn from_str(word: &str) -> Result<Self, UnknownFaultKind> {
        Self::ALL.into_iter().find(|kind| kind.word() == word).ok_or_else(|| UnknownFaultKind(word.into()))
    }
}

/// What became of a sensor's beam in one sweep.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Verdict {
    /// It heard what the estimator knows, and corrected the pose.
    Used,
    /// It heard something else.
    Unexplained,
    /// It heard nothing, or nothing is known yet.
    #[default]
    Silent,
    /// Its sensor is faulty.
    Ignored,
}

/// A sensor's change of state.
#[derive(Clone, Debug, PartialEq)]
pub struct FaultEvent {
    /// The sweep's reference instant.
    pub at: Timestamp,
    /// The sensor's id.
    pub sensor: usize,
    /// Its new state.
    pub state: SensorState,
    /// Why, in words.
    pub reason: String,
}

/// One of the two wheels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wheel {
    /// The left one.
    Left,
    /// The right one.
    Right,
}

impl Wheel {
    /// Both, in the order of every pair.
    pub const BOTH: [Self; 2] = [Self::Left, Self::Right];

    /// The word used in files and messages.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Left => "left",
            Self::Right => "right",
        }
    }
}

/// What a wheel encoder's counts are worth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EncoderState {
    /// They are used as they come.
    #[default]
    Healthy,
    /// They stand still while the wheel turns: the robot's motion is unknown.
    Dead,
    /// They run backwards, and are used with the sign turned over.
    Reversed,
}

impl EncoderState {
    /// The word used in files.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Healthy => "healthy",
            Self::Dead => "dead",
            Self::Reversed => "reversed",
        }
    }
}

/// A wheel encoder's change of state.
#[derive(Clone, Debug, PartialEq)]
pub struct EncoderEvent {
    /// The sweep's reference instant.
    pub at: Timestamp,
    /// The wheel.
    pub wheel: Wheel,
    /// Its encoder's new state.
    pub state: EncoderState,
    /// Why, in words.
    pub reason: String,
}

/// The drive as the estimator has learnt it, with one standard deviation each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// Right wheel's size over the left's.
    pub wheel_ratio: f64,
    /// Its uncertainty.
    pub wheel_ratio_sigma: f64,
    /// Distance between the wheels, metres.
    pub wheel_base_m: f64,
    /// Its uncertainty, metres.
    pub wheel_base_sigma_m: f64,
}

/// What the pipeline has counted since it began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Frames whose checksum held.
    pub frames: u64,
    /// Frames whose checksum did not hold.
    pub crc_errors: u64,
    /// Other frames that could not be decoded: bad stuffing, too long, too short.
    pub malformed: u64,
    /// Bytes that belong to no good frame.
    pub dropped_bytes: u64,
    /// Good frames that the sequence numbers say are missing.
    pub lost_frames: u64,
    /// Good frames of a type this version does not know.
    pub unknown: u64,
    /// Good frames whose content was refused.
    pub refused: u64,
    /// The host's own messages, come back.
    pub echoed: u64,
    /// Fired groups of the ring that were used.
    pub groups: u64,
    /// Restarts of the board.
    pub restarts: u64,
    /// Sweeps used.
    pub sweeps: u64,
    /// Sweeps that were given up because too much of them was missing.
    pub dropped_sweeps: u64,
}
