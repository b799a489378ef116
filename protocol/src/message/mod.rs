//! Messages: the meaning of a frame's payload.
//!
//! Every message that can be constructed can be emitted, and every emitted message can be parsed.
//! `parse` and `emit` of each message stand side by side, and the types bound all lengths.

mod board;
mod drive;
mod error;
mod geometry;
mod hello;
pub mod kind;
mod sonar;
mod text;
mod wire;

pub use board::{AckResult, Encoder, Fault, FaultCode, Log, Status};
pub use drive::{Drive, Motion, MotionState, WheelSpeeds};
pub use error::MessageError;
pub use geometry::{Geometry, MAX_PLACEMENTS, Placement};
pub use hello::Hello;
pub use sonar::{Echo, MAX_ECHOES, SensorEcho, Sonar};
pub use text::Text;

use crate::frame::PayloadBuf;
use wire::{Reader, Writer};

/// Maximum number of sensors of a ring: ids are 0 to 63, the bits of STATUS's `stuck_mask`.
pub const MAX_SENSORS: usize = 64;

/// A message of either direction.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Message {
    /// Board: its identity.
    Hello(Hello),
    /// Board: where the sensors sit.
    Geometry(Geometry),
    /// Board: the echoes of one group.
    Sonar(Sonar),
    /// Board: the wheel encoders.
    Encoder(Encoder),
    /// Board: its health.
    Status(Status),
    /// Board: a sensor failed or recovered.
    Fault(Fault),
    /// Board: what its motors do.
    Motion(Motion),
    /// Board: the answer to a TIME_REQUEST.
    TimeResponse {
        /// The token of the request.
        token: u16,
        /// Board time at which the request's last byte arrived, microseconds.
        rx_us: u32,
        /// Board time at which this frame's first byte leaves, microseconds.
        tx_us: u32,
    },
    /// Board: the result of a command.
    Ack {
        /// The command's type.
        of_type: u8,
        /// The command's frame number.
        of_seq: u8,
        /// Its result.
        result: AckResult,
    },
    /// Board: the value of a configuration key.
    ConfigValue {
        /// The key; the board defines its meaning.
        key: u8,
        /// Its value.
        value: i32,
    },
    /// Board: a line of text for the user.
    Log(Log),
    /// Host: asks for HELLO.
    HelloRequest {
        /// The host's major version of the protocol.
        major: u8,
        /// The host's minor version of the protocol.
        minor: u8,
    },
    /// Host: starts the firing.
    Start,
    /// Host: stops the firing.
    Stop,
    /// Host: sets a configuration key.
    ConfigSet {
        /// The key; the board defines its meaning.
        key: u8,
        /// Its new value.
        value: i32,
    },
    /// Host: asks for the value of a configuration key.
    ConfigGet {
        /// The key; the board defines its meaning.
        key: u8,
    },
    /// Host: asks for GEOMETRY.
    GeometryRequest,
    /// Host: the wheels' speeds, for a short time.
    Drive(Drive),
    /// Host: asks for the board's time.
    TimeRequest {
        /// Any number; the response repeats it.
        token: u16,
    },
    /// Host: says that it is there, so that a board that drives goes on.
    Heartbeat,
}

impl Message {
    /// Parses the `payload` of a frame of type `kind`.
    ///
    /// # Errors
    /// The type is unknown, the payload has the wrong length, or a field has an invalid value.
    /// Never panics.
    pub fn parse(kind: u8, payload: &[u8]) -> Result<Self, MessageError> {
        let fields = |message, expected| Reader::new(message, expected, payload);
        Ok(match kind {
            kind::HELLO => Self::Hello(Hello::parse(payload)?),
            kind::GEOMETRY => Self::Geometry(Geometry::parse(payload)?),
            kind::SONAR => Self::Sonar(Sonar::parse(payload)?),
            kind::ENCODER => Self::Encoder(Encoder::parse(payload)?),
            kind::STATUS => Self::Status(Status::parse(payload)?),
            kind::FAULT => Self::Fault(Fault::parse(payload)?),
            kind::MOTION => Self::Motion(Motion::parse(payload)?),
            kind::TIME_RESPONSE => {
                let mut fields = fields("TIME_RESPONSE", "at least 10");
                Self::TimeResponse { token: fields.u16()?, rx_us: fields.u32()?, tx_us: fields.u32()? }
            }
            kind::ACK => {
                let mut fields = fields("ACK", "at least 3");
                let (of_type, of_seq) = (fields.u8()?, fields.u8()?);
                Self::Ack { of_type, of_seq, result: AckResult::from_code(fields.u8()?)? }
            }
            kind::CONFIG_VALUE => {
                let mut fields = fields("CONFIG_VALUE", "at least 5");
                Self::ConfigValue { key: fields.u8()?, value: fields.i32()? }
            }
            kind::LOG => Self::Log(Log::parse(payload)?),
            kind::HELLO_REQUEST => {
                let mut fields = fields("HELLO_REQUEST", "at least 2");
                Self::HelloRequest { major: fields.u8()?, minor: fields.u8()? }
            }
            kind::START => Self::Start,
            kind::STOP => Self::Stop,
            kind::CONFIG_SET => {
                let mut fields = fields("CONFIG_SET", "at least 5");
                Self::ConfigSet { key: fields.u8()?, value: fields.i32()? }
            }
            kind::CONFIG_GET => Self::ConfigGet { key: fields("CONFIG_GET", "at least 1").u8()? },
            kind::GEOMETRY_REQUEST => Self::GeometryRequest,
            kind::DRIVE => Self::Drive(Drive::parse(payload)?),
            kind::TIME_REQUEST => Self::TimeRequest { token: fields("TIME_REQUEST", "at least 2").u16()? },
            kind::HEARTBEAT => Self::Heartbeat,
            unknown => return Err(MessageError::UnknownType(unknown)),
        })
    }

    /// Writes this message into `payload` and discards its former content.
    pub fn emit(&self, payload: &mut PayloadBuf) {
        payload.clear();
        let mut out = Writer(payload);
        match self {
            Self::Hello(hello) => hello.emit(&mut out),
            Self::Geometry(geometry) => geometry.emit(&mut out),
            Self::Sonar(sonar) => sonar.emit(&mut out),
            Self::Encoder(encoder) => encoder.emit(&mut out),
            Self::Status(status) => status.emit(&mut out),
            Self::Fault(fault) => fault.emit(&mut out),
            Self::Motion(motion) => motion.emit(&mut out),
            Self::Drive(drive) => drive.emit(&mut out),
            Self::TimeResponse { token, rx_us, tx_us } => {
                out.u16(*token).u32(*rx_us).u32(*tx_us);
            }
            Self::Ack { of_type, of_seq, result } => {
                out.u8(*of_type).u8(*of_seq).u8(*result as u8);
            }
            Self::Log(log) => log.emit(&mut out),
            Self::HelloRequest { major, minor } => {
                out.u8(*major).u8(*minor);
            }
            Self::ConfigValue { key, value } | Self::ConfigSet { key, value } => {
                out.u8(*key).i32(*value);
            }
            Self::ConfigGet { key } => {
                out.u8(*key);
            }
            Self::TimeRequest { token } => {
                out.u16(*token);
            }
            Self::Start | Self::Stop | Self::GeometryRequest | Self::Heartbeat => {}
        }
    }

    /// The type byte of this message's frame.
    #[must_use]
    pub const fn kind(&self) -> u8 {
        match self {
            Self::Hello(_) => kind::HELLO,
            Self::Geometry(_) => kind::GEOMETRY,
            Self::Sonar(_) => kind::SONAR,
            Self::Encoder(_) => kind::ENCODER,
            Self::Status(_) => kind::STATUS,
            Self::Fault(_) => kind::FAULT,
            Self::Motion(_) => kind::MOTION,
            Self::TimeResponse { .. } => kind::TIME_RESPONSE,
            Self::Ack { .. } => kind::ACK,
            Self::ConfigValue { .. } => kind::CONFIG_VALUE,
            Self::Log(_) => kind::LOG,
            Self::HelloRequest { .. } => kind::HELLO_REQUEST,
            Self::Start => kind::START,
            Self::Stop => kind::STOP,
            Self::ConfigSet { .. } => kind::CONFIG_SET,
            Self::ConfigGet { .. } => kind::CONFIG_GET,
            Self::GeometryRequest => kind::GEOMETRY_REQUEST,
            Self::Drive(_) => kind::DRIVE,
            Self::TimeRequest { .. } => kind::TIME_REQUEST,
            Self::Heartbeat => kind::HEARTBEAT,
        }
    }
}
