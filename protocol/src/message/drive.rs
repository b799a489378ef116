//! DRIVE and MOTION: what the host commands the wheels to do, and what they do.

use super::MessageError;
use super::wire::{Reader, Writer};
use core::ops::RangeInclusive;

/// Wheel speeds that may be commanded, millimetres per second, forward positive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WheelSpeeds {
    left_mm_s: i16,
    right_mm_s: i16,
}

impl WheelSpeeds {
    /// The highest speed of a wheel, millimetres per second.
    pub const MAX_MM_S: i16 = 2_000;

    /// Standing still.
    pub const ZERO: Self = Self { left_mm_s: 0, right_mm_s: 0 };

    /// These speeds.
    ///
    /// # Errors
    /// One of them is beyond [`Self::MAX_MM_S`] forward or backward.
    pub fn new(left_mm_s: i16, right_mm_s: i16) -> Result<Self, MessageError> {
        for got in [left_mm_s, right_mm_s] {
            if !(-Self::MAX_MM_S..=Self::MAX_MM_S).contains(&got) {
                let field = "a commanded speed of DRIVE or MOTION";
                return Err(MessageError::Value { field, got: got.into(), expected: "-2000 to 2000" });
            }
        }
        Ok(Self { left_mm_s, right_mm_s })
    }

    /// The left wheel's speed.
    #[must_use]
    pub const fn left_mm_s(self) -> i16 {
        self.left_mm_s
    }

    /// The right wheel's speed.
    #[must_use]
    pub const fn right_mm_s(self) -> i16 {
        self.right_mm_s
    }

    fn parse(fields: &mut Reader<'_>) -> Result<Self, MessageError> {
        Self::new(fields.i16()?, fields.i16()?)
    }

    fn emit(self, out: &mut Writer<'_>) {
        out.i16(self.left_mm_s).i16(self.right_mm_s);
    }
}

/// The speeds that the wheels shall have, for a short time. A board whose last DRIVE has expired stops.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Drive {
    speeds: WheelSpeeds,
    valid_ms: u16,
    source: u8,
}

impl Drive {
    /// How long a DRIVE may be valid, milliseconds.
    pub const VALID_MS: RangeInclusive<u16> = 50..=1_000;

    /// The source of a command that a person or program gives at the owner's socket.
    pub const FROM_SOCKET: u8 = 1;
    /// The source of a command that comes over the network with a token that permits to drive.
    pub const FROM_TOKEN: u8 = 2;

    /// Commands `speeds` for `valid_ms` milliseconds from its arrival; `source` is who commands, for the record.
    ///
    /// # Errors
    /// `valid_ms` is outside [`Self::VALID_MS`].
    pub fn new(speeds: WheelSpeeds, valid_ms: u16, source: u8) -> Result<Self, MessageError> {
        if !Self::VALID_MS.contains(&valid_ms) {
            let got = valid_ms.into();
            return Err(MessageError::Value { field: "valid_ms of DRIVE", got, expected: "50 to 1000" });
        }
        Ok(Self { speeds, valid_ms, source })
    }

    /// The wheels' speeds.
    #[must_use]
    pub const fn speeds(&self) -> WheelSpeeds {
        self.speeds
    }

    /// How long they are valid, milliseconds from the arrival.
    #[must_use]
    pub const fn valid_ms(&self) -> u16 {
        self.valid_ms
    }

    /// Who commands: 0 if that is not said, or one of the constants. A board does not look at it.
    #[must_use]
    pub const fn source(&self) -> u8 {
        self.source
    }

    pub(super) fn parse(payload: &[u8]) -> Result<Self, MessageError> {
        let mut fields = Reader::new("DRIVE", "at least 7", payload);
        Self::new(WheelSpeeds::parse(&mut fields)?, fields.u16()?, fields.u8()?)
    }

    pub(super) fn emit(&self, out: &mut Writer<'_>) {
        self.speeds.emit(out);
        out.u16(self.valid_ms).u8(self.source);
    }
}

super::board::codes! {
    /// What the board's motors do, or why they stand still.
    MotionState, "state of MOTION", "0 to 6", {
        /// Nothing is commanded.
        Idle = 0,
        /// The last DRIVE is valid, and the wheels follow it.
        Driving = 1,
        /// Stopped: the last DRIVE has expired, or the line was silent.
        TimeOut = 2,
        /// Stopped: an echo where the robot drives is nearer than the stop distance.
        Obstacle = 3,
        /// Stopped: a wheel was driven and did not turn.
        Stall = 4,
        /// Stopped: the emergency pin is open.
        EmergencyPin = 5,
        /// The board has no motors, or none are configured.
        NoMotors = 6,
    }
}

impl MotionState {
    /// The state in a word or two, for people.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Idle => "idle",
            Self::Driving => "driving",
            Self::TimeOut => "time-out",
            Self::Obstacle => "obstacle",
            Self::Stall => "stall",
            Self::EmergencyPin => "emergency pin",
            Self::NoMotors => "no motors",
        }
    }
}

/// What the wheels do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Motion {
    /// Board time in microseconds.
    pub t_us: u32,
    /// Driving, or why not.
    pub state: MotionState,
    /// The speeds that the board steers to now, within its limits and ramps.
    pub commanded: WheelSpeeds,
    /// The left wheel's speed by its encoder, millimetres per second.
    pub left_mm_s: i16,
    /// The right wheel's speed by its encoder, millimetres per second.
    pub right_mm_s: i16,
}

impl Motion {
    pub(super) fn parse(payload: &[u8]) -> Result<Self, MessageError> {
        let mut fields = Reader::new("MOTION", "at least 13", payload);
        Ok(Self {
            t_us: fields.u32()?,
            state: MotionState::from_code(fields.u8()?)?,
            commanded: WheelSpeeds::parse(&mut fields)?,
            left_mm_s: fields.i16()?,
            right_mm_s: fields.i16()?,
        })
    }

    pub(super) fn emit(&self, out: &mut Writer<'_>) {
        out.u32(self.t_us).u8(self.state as u8);
        self.commanded.emit(out);
        out.i16(self.left_mm_s).i16(self.right_mm_s);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_out_of_range_cannot_be_made() {
        assert!(WheelSpeeds::new(-2_000, 2_000).is_ok());
        assert!(WheelSpeeds::new(2_001, 0).is_err() && WheelSpeeds::new(0, i16::MIN).is_err());
        let drive = |valid_ms| Drive::new(WheelSpeeds::ZERO, valid_ms, Drive::FROM_SOCKET);
        assert!(drive(50).is_ok() && drive(1_000).is_ok());
        assert!(drive(49).is_err() && drive(1_001).is_err() && drive(u16::MAX).is_err());
    }
}
