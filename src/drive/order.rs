//! What clients order, and what they are answered.

use slamd_protocol::Drive;
use std::time::Duration;

/// A velocity.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Twist {
    /// Forward, metres per second.
    pub forward_m_s: f64,
    /// Counter-clockwise, radians per second.
    pub turn_rad_s: f64,
}

/// A velocity for a short time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wish {
    /// The velocity, before the limits.
    pub twist: Twist,
    /// How long it holds, milliseconds, within [`Drive::VALID_MS`].
    pub for_ms: u16,
    /// The client drives by slamd's pose: refused while that is uncertain.
    pub is_autonomous: bool,
}

/// An order of a client.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Order {
    /// Drive so.
    Drive(Wish),
    /// Stop at once, whoever drives; the helm is free then.
    Stop,
    /// The client has gone.
    Leave,
}

/// A client that may drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Driver {
    /// Its number, which no other client has.
    pub number: u64,
    /// How it came in: [`Drive::FROM_SOCKET`] or [`Drive::FROM_TOKEN`].
    pub source: u8,
}

impl Driver {
    /// How it came in, for people.
    #[must_use]
    pub const fn word(self) -> &'static str {
        if self.source == Drive::FROM_SOCKET { "a client of the socket" } else { "a client with the drive token" }
    }
}

/// The answer to an order that is obeyed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Granted {
    /// The velocity within the limits.
    pub twist: Twist,
    /// How long it holds, milliseconds; 0 for a stop.
    pub for_ms: u16,
    /// What the motors did by the board's last MOTION.
    pub motors: Option<&'static str>,
}

/// Why an order is not obeyed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// The link is not streaming.
    #[error("the link is not streaming: the robot can be driven once sweeps arrive")]
    NotStreaming,
    /// The board has no motors or is too old.
    #[error("the board does not drive: it needs protocol 1.1, motors and board.top_speed_mm_s (protocol/README.md)")]
    NoMotors,
    /// Another client holds the lease.
    #[error("{by} drives: wait {} ms, or take the helm with ?STOP;", left.as_millis())]
    Taken {
        /// The other client.
        by: &'static str,
        /// How long its lease lasts unless it commands again.
        left: Duration,
    },
    /// The pose is uncertain.
    #[error("autonomous driving is refused: the pose is uncertain")]
    Lost,
    /// The robot differs from its configuration.
    #[error("autonomous driving is refused: the robot differs from its configuration; `slamd doctor` says how")]
    Doubted,
    /// An encoder is faulty.
    #[error("autonomous driving is refused: a wheel encoder is faulty")]
    Wheels,
}
