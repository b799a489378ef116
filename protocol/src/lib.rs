#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]
#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing, clippy::string_slice)]
#![deny(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)]
#![deny(clippy::allow_attributes, clippy::allow_attributes_without_reason)]

mod decoder;
mod frame;
mod message;
mod setting;
mod version;

pub use decoder::{DecoderCounters, FrameDecoder};
pub use frame::{DELIMITER, Frame, FrameBuf, FrameEncoder, MAX_FRAME, MAX_PAYLOAD, PayloadBuf, encode_frame};
pub use message::{
    AckResult, Drive, Echo, Encoder, Fault, FaultCode, Geometry, Hello, Log, MAX_ECHOES, MAX_PLACEMENTS, MAX_SENSORS,
    Message, MessageError, Motion, MotionState, Placement, SensorEcho, Sonar, Status, Text, WheelSpeeds, kind,
};
pub use setting::Setting;
pub use version::{VERSION_MAJOR, VERSION_MINOR, VersionError};
