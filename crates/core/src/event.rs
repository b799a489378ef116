//! What goes into the pipeline and what comes out.

use crate::geometry::Pose2;
use crate::robot_model::ModelEvent;
use crate::time::Timestamp;
use bytes::Bytes;
use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};
use slamd_protocol::MotionState;
use std::str::FromStr;

/// One input. Times never decrease.
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
    /// The port was opened again: later bytes come over a new connection, perhaps from a restarted board.
    Opened {
        /// When it was opened.
        at: Timestamp,
    },
    /// The deadline of `Pipeline::next_deadline` has passed.
    Tick {
        /// That deadline.
        at: Timestamp,
    },
    /// No more input follows: the pipeline uses what it holds back.
    End,
}

/// One output.
#[derive(Clone, Debug, PartialEq)]
pub enum Output {
    /// A frame for the board. After writing it, pass it back as [`Input::Sent`].
    Transmit(Bytes),
    /// An event.
    Event(Event),
}

/// An event. The pipeline emits events in the order in which they happen.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// The board identified itself.
    Board {
        /// When its message arrived.
        at: Timestamp,
        /// Name, firmware and protocol version, for people.
        description: String,
        /// False if the board speaks another major version: its messages are not used.
        compatible: bool,
    },
    /// The ring's geometry is known; sweeps can start.
    Ring {
        /// When it became known.
        at: Timestamp,
        /// The number of sensors n.
        sensors: usize,
    },
    /// The robot's new pose, from one sweep.
    Estimate(Estimate),
    /// The map was begun anew with another robot: these are the poses of the drive so far, and the earlier ones are discarded.
    Revised {
        /// The sweep with which it began anew.
        at: Timestamp,
        /// Poses in the new map, up to the sweep before; without those of a standing robot.
        poses: Vec<Estimate>,
    },
    /// A sensor changed its state.
    Fault(FaultEvent),
    /// A wheel encoder changed its state.
    Encoder(EncoderEvent),
    /// The robot's pose in the map became known or unknown.
    Localization(LocalizationEvent),
    /// The robot is not what its configuration says, or a finding of that kind has changed.
    Model(ModelEvent),
    /// A line of text from the board, control characters removed.
    BoardLog {
        /// When it arrived.
        at: Timestamp,
        /// The text.
        text: String,
    },
    /// The board's motors drive, or stand for another reason than before.
    Motion {
        /// When its message arrived.
        at: Timestamp,
        /// What they do.
        state: MotionState,
    },
    /// The board restarted: its counters start again.
    BoardReset {
        /// When it was noticed.
        at: Timestamp,
    },
    /// The board reports impossible values, or does not accept a setting. Each trouble is told once.
    BoardTrouble {
        /// When its message arrived.
        at: Timestamp,
        /// The problem, and what to do.
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
    /// Normalised innovation squared of this sweep, mean over its measurements; 1 if the filter knows its errors. NaN without a
    /// measurement, or if the method has none.
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
            LocalizationChange::Lost | LocalizationChange::Doubted { .. } => true,
            LocalizationChange::Regained { .. } | LocalizationChange::Trusted => false,
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
    /// The pose cannot be relied on, though the echoes may agree with the map: the robot itself is in doubt.
    Doubted {
        /// Explanation for people.
        reason: String,
    },
    /// What made the pose doubtful is over.
    Trusted,
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

/// Whether a sensor's readings are used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum SensorState {
    /// Readings are used.
    #[default]
    Healthy,
    /// Readings are ignored.
    Faulty(FaultKind),
}

/// Kind of sensor fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum FaultKind {
    /// Always reports no echo within range.
    Saturated,
    /// Never measures.
    Missing,
    /// Readings scatter.
    Noisy,
    /// Always reads the same value.
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

/// Use of a sensor's beam in one sweep.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Verdict {
    /// The echo matched the map and corrected the pose.
    Used,
    /// The echo matched nothing in the map.
    Unexplained,
    /// No echo, or no map yet.
    #[default]
    Silent,
    /// The sensor is faulty.
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
    /// Why, for people.
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

/// How a wheel encoder's counts are used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EncoderState {
    /// Counts are used unchanged.
    #[default]
    Healthy,
    /// Counts stand still while the wheel turns: the robot's motion is unknown.
    Dead,
    /// Counts run backwards and are used with the opposite sign.
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
    /// Why, for people.
    pub reason: String,
}

/// Wheel calibration as the estimator learned it, each value with one standard deviation.
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

/// Counters of the pipeline since its start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Frames with a correct checksum.
    pub frames: u64,
    /// Frames with a wrong checksum.
    pub crc_errors: u64,
    /// Other frames that could not be decoded: bad stuffing, too long, too short.
    pub malformed: u64,
    /// Bytes that belong to no valid frame.
    pub dropped_bytes: u64,
    /// Frames missing by their sequence numbers.
    pub lost_frames: u64,
    /// Valid frames of a type that this version does not know.
    pub unknown: u64,
    /// Valid frames with refused content.
    pub refused: u64,
    /// The host's own messages, received back.
    pub echoed: u64,
    /// Sensor groups used.
    pub groups: u64,
    /// Restarts of the board.
    pub restarts: u64,
    /// Sweeps used.
    pub sweeps: u64,
    /// Sweeps dropped because too much of them was missing.
    pub dropped_sweeps: u64,
    /// Wheel steps across a wrap at 16 bits; they are unwrapped and used.
    pub unwrapped_steps: u64,
    /// Wheel steps that no wheel can roll; they are not used.
    pub refused_steps: u64,
    /// Messages not used because the board's clock ran backwards.
    pub refused_stamps: u64,
    /// Damaged frames that hold readable text.
    pub stray_texts: u64,
}
