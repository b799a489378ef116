//! What the board reports besides echoes: ENCODER, STATUS, FAULT, LOG and the results of commands.

use super::wire::{Reader, Writer};
use super::{MessageError, Text};
use crate::frame::MAX_PAYLOAD;
use core::num::NonZeroU16;

/// The wheels' encoders at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Encoder {
    /// Board time of the reading in microseconds.
    pub t_us: u32,
    /// The left wheel, counted from the board's start, forward positive.
    pub left_ticks: i32,
    /// The right wheel, counted from the board's start, forward positive.
    pub right_ticks: i32,
    /// Reserved, 0: no bit has a meaning yet.
    pub flags: u8,
}

impl Encoder {
    pub(super) fn parse(payload: &[u8]) -> Result<Self, MessageError> {
        let mut fields = Reader::new("ENCODER", "at least 13", payload);
        Ok(Self { t_us: fields.u32()?, left_ticks: fields.i32()?, right_ticks: fields.i32()?, flags: fields.u8()? })
    }

    pub(super) fn emit(&self, out: &mut Writer<'_>) {
        out.u32(self.t_us).i32(self.left_ticks).i32(self.right_ticks).u8(self.flags);
    }
}

/// The board's health, once a second. The counters start at 0 when the board starts, and wrap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Status {
    /// Board time in microseconds.
    pub t_us: u32,
    /// Frames sent.
    pub frames: u32,
    /// Frames not sent because the line was busy.
    pub overruns: u32,
    /// Frames received with a wrong checksum.
    pub crc_errors: u32,
    /// Air temperature in hundredths of a degree Celsius; 0x7FFF means unknown and cannot be sent
    /// as a temperature.
    pub temperature_cdeg: Option<i16>,
    /// Supply voltage in millivolts.
    pub supply_mv: Option<NonZeroU16>,
    /// Bit i is set while the echo pin of sensor i is stuck.
    pub stuck_mask: u64,
}

impl Status {
    pub(super) fn parse(payload: &[u8]) -> Result<Self, MessageError> {
        let mut fields = Reader::new("STATUS", "at least 28", payload);
        Ok(Self {
            t_us: fields.u32()?,
            frames: fields.u32()?,
            overruns: fields.u32()?,
            crc_errors: fields.u32()?,
            temperature_cdeg: Some(fields.i16()?).filter(|&cdeg| cdeg != UNKNOWN_TEMPERATURE),
            supply_mv: NonZeroU16::new(fields.u16()?),
            stuck_mask: fields.u64()?,
        })
    }

    pub(super) fn emit(&self, out: &mut Writer<'_>) {
        out.u32(self.t_us).u32(self.frames).u32(self.overruns).u32(self.crc_errors);
        out.i16(self.temperature_cdeg.unwrap_or(UNKNOWN_TEMPERATURE));
        out.u16(self.supply_mv.map_or(0, NonZeroU16::get)).u64(self.stuck_mask);
    }
}

const UNKNOWN_TEMPERATURE: i16 = 0x7FFF;

/// Defines an enum that is one byte on the wire, and the error for all other bytes.
macro_rules! codes {
    ($(#[$doc:meta])* $name:ident, $field:literal, $expected:literal, { $($(#[$item_doc:meta])* $item:ident = $code:literal,)* }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(u8)]
        pub enum $name {
            $($(#[$item_doc])* $item = $code,)*
        }

        impl $name {
            pub(in crate::message) fn from_code(code: u8) -> Result<Self, MessageError> {
                match code {
                    $($code => Ok(Self::$item),)*
                    _ => Err(MessageError::Value { field: $field, got: code.into(), expected: $expected }),
                }
            }
        }
    };
}
pub(super) use codes;

codes! {
    /// A sensor fault that the board detects.
    FaultCode, "code of FAULT", "0 to 3", {
        /// The fault has ended.
        Cleared = 0,
        /// The echo pin stays high.
        PinStuck = 1,
        /// The echo pin is high before the trigger.
        HighAtTrigger = 2,
        /// The sensor never answers.
        NeverAnswers = 3,
    }
}

codes! {
    /// The result of a command.
    AckResult, "result of ACK", "0 to 3", {
        /// The board executed it.
        Done = 0,
        /// The board does not know the message type or the configuration key.
        Unknown = 1,
        /// The board rejects the value.
        Refused = 2,
        /// The board cannot do it now.
        Busy = 3,
    }
}

/// A sensor's fault began, changed or ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fault {
    /// Board time in microseconds.
    pub t_us: u32,
    /// The sensor's id.
    pub sensor: u8,
    /// The fault.
    pub code: FaultCode,
}

impl Fault {
    pub(super) fn parse(payload: &[u8]) -> Result<Self, MessageError> {
        let mut fields = Reader::new("FAULT", "at least 6", payload);
        Ok(Self { t_us: fields.u32()?, sensor: fields.u8()?, code: FaultCode::from_code(fields.u8()?)? })
    }

    pub(super) fn emit(&self, out: &mut Writer<'_>) {
        out.u32(self.t_us).u8(self.sensor).u8(self.code as u8);
    }
}

/// A line of text for the user.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Log {
    /// 0 error, 1 warning, 2 information, 3 and above debugging.
    pub level: u8,
    /// The text.
    pub text: Text<{ MAX_PAYLOAD - 1 }>,
}

impl Log {
    pub(super) fn parse(payload: &[u8]) -> Result<Self, MessageError> {
        let mut fields = Reader::new("LOG", "at least 1", payload);
        Ok(Self { level: fields.u8()?, text: Text::from_bytes(fields.rest()) })
    }

    pub(super) fn emit(&self, out: &mut Writer<'_>) {
        out.u8(self.level).bytes(self.text.as_bytes());
    }
}
