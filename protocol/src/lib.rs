#![doc = include_str!("../README.md")]
#![no_std]

mod decoder;
mod frame;
mod message;
mod setting;
mod version;

pub use decoder::{DecoderCounters, FrameDecoder};
pub use frame::{DELIMITER, Frame, FrameBuf, FrameEncoder, MAX_FRAME, MAX_PAYLOAD, PayloadBuf, encode_frame};
pub use message::{
    AckResult, Echo, Encoder, Fault, FaultCode, Geometry, Hello, Log, MAX_ECHOES, MAX_PLACEMENTS, Message,
    MessageError, Placement, SensorEcho, Sonar, Status, Text, kind,
};
pub use setting::Setting;
pub use version::{VERSION_MAJOR, VERSION_MINOR, VersionError};
