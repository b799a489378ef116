//! Why the link is in its state.

use std::fmt;
use std::time::Duration;

/// Why the link is in its state. `Display` gives the words for people, with what to do.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum LinkCause {
    /// No port was opened yet; no words.
    #[default]
    NotOpened,
    /// The port could not be opened, or is gone: the error.
    Closed(String),
    /// The port is open.
    Opened {
        /// Name of the port.
        port: String,
        /// Bits per second.
        baud: u32,
    },
    /// Bytes arrive without a valid frame; other rates follow.
    Noise {
        /// Bits per second.
        baud: u32,
    },
    /// Nothing arrives; other rates follow.
    Silence {
        /// Bits per second.
        baud: u32,
    },
    /// Bytes arrived without a valid frame, and no usual rate gave one.
    NoiseAtAllRates,
    /// Nothing valid arrived at any usual rate.
    SilenceAtAllRates,
    /// The board prints text instead of frames.
    WrongFirmware {
        /// Start of the text.
        text: String,
    },
    /// The host's own frames come back.
    Echo,
    /// The board speaks another protocol version: the refusal.
    Refused(String),
    /// The first valid frame arrived at the configured rate.
    BoardSpeaks {
        /// Bits per second.
        baud: u32,
    },
    /// The first valid frame arrived at another rate than the configured one.
    OtherBaud {
        /// Rate of the board.
        found: u32,
        /// Configured rate.
        wanted: u32,
    },
    /// The board answers but fires no sensor.
    NoPings,
    /// Sensor groups arrive.
    EchoesArrive {
        /// Name of the port.
        port: String,
        /// Bits per second.
        baud: u32,
    },
    /// Frames arrive, but something is wrong with the line or with what the board says of itself.
    Trouble(String),
    /// Sensor groups arrive; the map begins when the robot drives.
    WaitsForMovement,
    /// Sensor groups stopped arriving.
    NoEchoes {
        /// Time without them.
        elapsed: Duration,
        /// True if other bytes still arrive.
        do_bytes_arrive: bool,
    },
    /// The board restarts repeatedly.
    Restarts,
}

impl fmt::Display for LinkCause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotOpened => Ok(()),
            Self::Closed(text) | Self::Refused(text) | Self::Trouble(text) => f.write_str(text),
            Self::WaitsForMovement => f.write_str("waiting for movement: the map begins when the robot drives"),
            Self::Opened { port, baud } => write!(f, "{port} is open at {baud} baud"),
            Self::Noise { baud } => {
                write!(f, "noise: bytes arrive but no valid frame at {baud} baud; trying other rates")
            }
            Self::Silence { baud } => write!(f, "silence: nothing arrives at {baud} baud; trying other rates"),
            Self::NoiseAtAllRates => f.write_str(
                "noise: bytes arrive but no valid frame at any usual rate: is another firmware on the board, or its \
                 ground wire loose?",
            ),
            Self::SilenceAtAllRates => f.write_str(
                "silence: the board says nothing at any usual rate: is it powered, flashed with protocol/firmware, \
                 and is this its port (`slamd ports`)?",
            ),
            Self::WrongFirmware { text } => write!(
                f,
                "wrong firmware: the board prints \"{text}\" and no slamd frames: flash protocol/firmware, or name \
                 the board's port"
            ),
            Self::Echo => f.write_str("the line echoes what slamd sends: the board's receive and transmit wires touch"),
            Self::BoardSpeaks { baud } => write!(f, "the board speaks at {baud} baud"),
            Self::OtherBaud { found, wanted } => {
                write!(f, "the board speaks at {found} baud, not at {wanted}: start slamd with --baud {found}")
            }
            Self::NoPings => f.write_str("the board answers but fires no sensor; `slamd doctor` looks closer"),
            Self::EchoesArrive { port, baud } => write!(f, "{port} at {baud} baud"),
            Self::NoEchoes { elapsed, do_bytes_arrive } => {
                let rest = if *do_bytes_arrive {
                    "bytes still arrive: noise on the line, or the board has ceased to fire"
                } else {
                    "silence: check the cable and the board's supply"
                };
                write!(f, "no echoes for {} s; {rest}", elapsed.as_secs_f64())
            }
            Self::Restarts => f.write_str(
                "the board restarts again and again: its supply breaks down; feed sensors and motors from their own",
            ),
        }
    }
}
