//! HELLO: the board's identity.

use super::wire::{Reader, Writer};
use super::{MessageError, Text};
use crate::version::{self, VersionError};

/// The board's identity. The layout never changes, so any host can read the HELLO of any board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Hello {
    /// The board's major version of the protocol.
    pub major: u8,
    /// The board's minor version of the protocol.
    pub minor: u8,
    /// A different number after each start of the board.
    pub boot_id: u32,
    /// Nominal frequency of the board's clock in hertz: the granularity of its microseconds.
    pub tick_hz: u32,
    /// The number of sensors of the ring.
    pub sensors: u8,
    /// Encoder ticks per turn of a wheel.
    pub ticks_per_turn: u32,
    /// What the board can do, as bits: see [`Hello::drives`].
    pub capabilities: u32,
    /// Checksum of the board's configuration: it changes when the configuration changes.
    pub config_crc: u32,
    /// Distinguishes boards of one kind.
    pub uid: [u8; 8],
    /// The board's name.
    pub board: Text<16>,
    /// The version of the board's firmware.
    pub firmware: Text<16>,
}

/// Bit 0 of the capabilities.
const DRIVES: u32 = 1;

impl Hello {
    /// The capabilities of a board that drives.
    pub const CAPABILITY_DRIVES: u32 = DRIVES;

    /// True if the board obeys DRIVE. Version 1.0 gave the bits no meaning, so its boards never do.
    #[must_use]
    pub const fn drives(&self) -> bool {
        self.major == version::VERSION_MAJOR && self.minor >= 1 && self.capabilities & DRIVES != 0
    }

    /// Checks that this version can read the board's messages.
    ///
    /// # Errors
    /// The board speaks another major version; the message says which side to update.
    pub fn check_version(&self) -> Result<(), VersionError> {
        version::check(self.major)
    }

    pub(super) fn parse(payload: &[u8]) -> Result<Self, MessageError> {
        let mut fields = Reader::new("HELLO", "at least 63", payload);
        Ok(Self {
            major: fields.u8()?,
            minor: fields.u8()?,
            boot_id: fields.u32()?,
            tick_hz: fields.u32()?,
            sensors: fields.u8()?,
            ticks_per_turn: fields.u32()?,
            capabilities: fields.u32()?,
            config_crc: fields.u32()?,
            uid: fields.bytes()?,
            board: fields.text()?,
            firmware: fields.text()?,
        })
    }

    pub(super) fn emit(&self, out: &mut Writer<'_>) {
        out.u8(self.major).u8(self.minor).u32(self.boot_id).u32(self.tick_hz).u8(self.sensors);
        out.u32(self.ticks_per_turn).u32(self.capabilities).u32(self.config_crc).bytes(&self.uid);
        out.text(&self.board).text(&self.firmware);
    }
}
