//! SONAR: the echoes of one group of sensors that fired together.

use super::wire::{Reader, Writer};
use super::{MAX_SENSORS, MessageError};
use arrayvec::ArrayVec;

/// Maximum number of echoes in one SONAR: each sensor once.
pub const MAX_ECHOES: usize = MAX_SENSORS;

/// The echoes of one group of sensors that fired together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sonar {
    /// Board time of the trigger in microseconds.
    pub t_us: u32,
    /// The group that fired.
    pub group: u8,
    /// This is the last group of its cycle.
    pub last_of_cycle: bool,
    /// The left wheel's encoder at the trigger.
    pub left_ticks: i32,
    /// The right wheel's encoder at the trigger.
    pub right_ticks: i32,
    /// One echo per sensor of the group, without the sensors that did not answer at all.
    pub echoes: ArrayVec<SensorEcho, MAX_ECHOES>,
}

/// The echo of one sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SensorEcho {
    /// The sensor's id.
    pub sensor: u8,
    /// Its echo.
    pub echo: Echo,
}

/// The result of one ping.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Echo {
    /// The first echo, within range.
    Flight {
        /// Round-trip time of flight in microseconds, at most [`Echo::MAX_FLIGHT_US`]. A longer one
        /// is emitted as that maximum; [`Echo::from_flight_us`] never makes one.
        us: u16,
    },
    /// No echo within range.
    NoEcho,
    /// The echo pin stayed high.
    PinStuck,
    /// The echo pin was high before the trigger.
    HighAtTrigger,
    /// The sensor is switched off by configuration.
    Disabled,
    /// The echo came during the blanking time, while the sensor's own ping still rings.
    Blanked,
}

impl Echo {
    /// The longest time of flight that is not a code, in microseconds (11 m one way).
    pub const MAX_FLIGHT_US: u16 = 0xFFFA;

    /// The echo of a time of flight in microseconds; beyond [`Self::MAX_FLIGHT_US`] that is
    /// [`Self::NoEcho`].
    #[must_use]
    pub fn from_flight_us(us: u32) -> Self {
        match u16::try_from(us) {
            Ok(us @ ..=Self::MAX_FLIGHT_US) => Self::Flight { us },
            _ => Self::NoEcho,
        }
    }

    const fn from_code(code: u16) -> Self {
        match code {
            0xFFFF => Self::NoEcho,
            0xFFFE => Self::PinStuck,
            0xFFFD => Self::HighAtTrigger,
            0xFFFC => Self::Disabled,
            0xFFFB => Self::Blanked,
            us @ ..=Self::MAX_FLIGHT_US => Self::Flight { us },
        }
    }

    fn code(self) -> u16 {
        match self {
            Self::NoEcho => 0xFFFF,
            Self::PinStuck => 0xFFFE,
            Self::HighAtTrigger => 0xFFFD,
            Self::Disabled => 0xFFFC,
            Self::Blanked => 0xFFFB,
            Self::Flight { us } => us.min(Self::MAX_FLIGHT_US),
        }
    }
}

impl Sonar {
    pub(super) fn parse(payload: &[u8]) -> Result<Self, MessageError> {
        let mut fields = Reader::new("SONAR", "14 + 3n (n <= 64)", payload);
        Ok(Self {
            t_us: fields.u32()?,
            group: fields.u8()?,
            last_of_cycle: fields.u8()? & LAST_OF_CYCLE != 0,
            left_ticks: fields.i32()?,
            right_ticks: fields.i32()?,
            echoes: fields.items::<3>(MAX_ECHOES)?.iter().map(SensorEcho::parse).collect(),
        })
    }

    pub(super) fn emit(&self, out: &mut Writer<'_>) {
        let flags = if self.last_of_cycle { LAST_OF_CYCLE } else { 0 };
        out.u32(self.t_us).u8(self.group).u8(flags).i32(self.left_ticks).i32(self.right_ticks);
        for heard in &self.echoes {
            out.u8(heard.sensor).u16(heard.echo.code());
        }
    }
}

impl SensorEcho {
    fn parse(&[sensor, low, high]: &[u8; 3]) -> Self {
        Self { sensor, echo: Echo::from_code(u16::from_le_bytes([low, high])) }
    }
}

/// Bit 0 of the flags.
const LAST_OF_CYCLE: u8 = 1;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flight_beyond_the_codes_is_no_echo() {
        assert_eq!(Echo::from_flight_us(65_530), Echo::Flight { us: 65_530 });
        assert_eq!(Echo::from_flight_us(65_531), Echo::NoEcho);
        assert_eq!(Echo::from_flight_us(u32::MAX), Echo::NoEcho);
    }
}
