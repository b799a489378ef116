//! What is wrong with the board's counts, stamps and groups, in words with a remedy.

use crate::event::Wheel;
use crate::time::DeviceTime;
use std::fmt;

/// What is wrong with the counts of an encoder. `Display` gives the observation, [`WheelTrouble::remedy`] what to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WheelTrouble {
    /// When the counts were latched.
    pub at: DeviceTime,
    /// The wheel that shows it.
    pub wheel: Wheel,
    /// What it is.
    pub what: What,
    /// The step that was, or would have been, rolled, metres.
    pub rolled_m: f64,
    /// The time of that step, seconds.
    pub within_s: f64,
    /// The robot's highest speed where the step exceeds it, metres per second.
    pub bound: f64,
}

/// Kind of [`WheelTrouble`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum What {
    /// The counter has 16 bits; its wraps are undone.
    SixteenBits,
    /// The counters started again near zero.
    StartAgain,
    /// One value was wrong; it is not used.
    WrongValue,
    /// The counts jumped; the step is not used.
    Jumped,
    /// The wheels are steadily faster than the robot can be; their steps are used.
    TooFast {
        /// Their speed, metres per second.
        speed_m_s: f64,
    },
}

impl What {
    /// The number of kinds.
    pub(crate) const COUNT: usize = 5;

    /// The kind's index.
    pub(crate) const fn index(self) -> usize {
        match self {
            Self::SixteenBits => 0,
            Self::StartAgain => 1,
            Self::WrongValue => 2,
            Self::Jumped => 3,
            Self::TooFast { .. } => 4,
        }
    }

    /// How often the kind is said in a session.
    pub(crate) const fn max_said(self) -> u32 {
        match self {
            Self::SixteenBits | Self::TooFast { .. } => 1,
            Self::StartAgain | Self::WrongValue | Self::Jumped => 5,
        }
    }
}

impl fmt::Display for WheelTrouble {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { what, rolled_m, within_s, bound, .. } = self;
        let wheel = self.wheel.word();
        match what {
            What::SixteenBits => write!(f, "the {wheel} wheel's counter wraps at 16 bits; its wraps are undone"),
            What::TooFast { speed_m_s } => {
                write!(f, "the wheels report {speed_m_s:.2} m/s, above robot.max_speed_m_s ({bound:.2})")
            }
            What::StartAgain | What::WrongValue | What::Jumped => {
                let within_s = (1e3 * within_s).round() / 1e3;
                write!(f, "the {wheel} wheel would have rolled {rolled_m:.2} m in {within_s} s")?;
                f.write_str(match what {
                    What::StartAgain => "; the counters start anew",
                    What::WrongValue => " and back; this value is not used",
                    _ => "; this step is not used",
                })
            }
        }
    }
}

impl WheelTrouble {
    /// What to do about it.
    #[must_use]
    pub const fn remedy(&self) -> &'static str {
        match self.what {
            What::SixteenBits => "send the counts with 32 bits, as protocol/README.md says",
            What::StartAgain => {
                "look for what resets the encoders' counters alone; a board that restarts sends a new boot_id"
            }
            What::WrongValue | What::Jumped => "check the encoders' wires and how the firmware reads its counters",
            What::TooFast { .. } => "is robot.ticks_per_turn, robot.wheel_radius_m or robot.max_speed_m_s wrong?",
        }
    }
}

/// What is wrong with the board's data.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Trouble {
    /// An encoder's counts.
    Wheel(WheelTrouble),
    /// Stamps are behind earlier ones by this many seconds.
    ClockRunsBack(f64),
    /// Stamps count milliseconds.
    ClockCountsMilliseconds,
    /// Stamps count this many units per second.
    ClockRate(f64),
    /// The air temperature is out of range, degrees Celsius; the other one is used.
    Temperature(f64, f64),
    /// The air temperature jumped, degrees Celsius; the other one is used.
    TemperatureJump(f64, f64),
    /// This sensor is not in the ring of so many.
    UnknownSensor(u8, usize),
    /// This sensor comes twice in a message.
    Twice(u8),
    /// This sensor fires in two groups.
    Overlap(u8, u8, u8),
    /// Two sensors of one group always answer alike.
    Crosstalk(u8, u8),
    /// Times of flight are ranges in centimetres.
    FlightsInCentimetres,
    /// The ranges are ten times too short or too long: true over reported range, and the `ring.range_scale` that mends it.
    RangesOff {
        /// True over reported range; 1 if an earlier factor was wrong.
        factor: f64,
        /// The configured scale times this factor.
        scale: f64,
    },
}

/// What a trouble of the board is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Topic {
    /// Identity, ring or a setting of the board.
    Settings,
    /// The board does not say who it is.
    Identity,
    /// The encoders' counts.
    Wheels,
    /// The board's stamps.
    Clock,
    /// The air temperature.
    Temperature,
    /// Sensors that the ring does not have.
    SensorIds,
    /// Firing groups that do not match the ring.
    Groups,
    /// Sensors that hear each other.
    Crosstalk,
    /// The unit of the times of flight.
    FlightUnit,
    /// Text between the frames.
    Text,
    /// Messages with invalid content.
    Content,
}

impl Trouble {
    /// What it is about.
    pub(crate) const fn topic(&self) -> Topic {
        match self {
            Self::Wheel(_) => Topic::Wheels,
            Self::ClockRunsBack(_) | Self::ClockCountsMilliseconds | Self::ClockRate(_) => Topic::Clock,
            Self::Temperature(..) | Self::TemperatureJump(..) => Topic::Temperature,
            Self::UnknownSensor(..) => Topic::SensorIds,
            Self::Twice(_) | Self::Overlap(..) => Topic::Groups,
            Self::Crosstalk(..) => Topic::Crosstalk,
            Self::FlightsInCentimetres | Self::RangesOff { .. } => Topic::FlightUnit,
        }
    }
}

impl fmt::Display for Trouble {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Wheel(trouble) => write!(f, "{trouble}: {}", trouble.remedy()),
            Self::ClockRunsBack(seconds) => write!(
                f,
                "the board's clock runs backwards by {seconds:.1} s; messages with such stamps are not used: stamp with a \
                 counter of microseconds that nothing sets back"
            ),
            Self::ClockCountsMilliseconds => f.write_str(
                "the board's clock counts milliseconds; its stamps are taken times 1000: stamp with microseconds \
                 (micros() on an Arduino, not millis())",
            ),
            Self::ClockRate(hz) => write!(
                f,
                "the board's clock counts {hz:.0} per second, not 1000000: stamp with microseconds, as protocol/README.md \
                 says"
            ),
            Self::Temperature(celsius, used) => write!(
                f,
                "the board reports air of {celsius:.1} degrees, which is implausible; {used:.1} is used: check the \
                 sensor, or report 0x7FFF (unknown) and set ring.temperature_c"
            ),
            Self::TemperatureJump(celsius, used) => write!(
                f,
                "the board's air temperature jumps to {celsius:.1} degrees, which is implausible; {used:.1} is used: \
                 check the sensor, or report 0x7FFF (unknown) and set ring.temperature_c"
            ),
            Self::UnknownSensor(sensor, count) => write!(
                f,
                "the board reports echoes of sensor {sensor}, but the ring has {count} sensors, 0 to {}: number the \
                 sensors in SONAR as GEOMETRY does",
                count.saturating_sub(1)
            ),
            Self::Twice(sensor) => write!(
                f,
                "the board reports sensor {sensor} twice in one message; the last echo is used: name each sensor of the \
                 group once"
            ),
            Self::Overlap(sensor, one, other) => write!(
                f,
                "groups overlap, sensor {sensor} fires in group {one} and in group {other}: fire each sensor once per \
                 cycle, in the group that GEOMETRY names; pings of one slot disturb each other"
            ),
            Self::FlightsInCentimetres => f.write_str(
                "the board's times of flight are so short that they must be ranges in centimetres; they are taken times \
                 58: send microseconds from trigger to echo (pulseIn() without a division), as protocol/README.md says",
            ),
            Self::RangesOff { factor, .. } if (*factor - 1.0).abs() < 0.5 => f.write_str(
                "the ranges are not too short, as was said before; they are taken as they are from here on, and the map \
                 begins anew: drive the robot where walls are farther than half a metre away",
            ),
            Self::RangesOff { factor, scale } if *factor > 1.0 => write!(
                f,
                "all ranges are a tenth of what the way of the robot shows: the board takes millimetres for centimetres, \
                 or reports a tenth of the time of flight; they are taken times 10, and the map begins anew: correct the \
                 unit in the firmware, or set ring.range_scale = {scale}"
            ),
            Self::RangesOff { scale, .. } => write!(
                f,
                "the ranges lie as far as 8 to 11 m, where no such sensor measures: the board takes centimetres for \
                 millimetres, or reports ten times the time of flight; they are divided by 10, and the map begins anew: \
                 correct the unit in the firmware, or set ring.range_scale = {scale}"
            ),
            Self::Crosstalk(a, b) => write!(
                f,
                "crosstalk, sensors {a} and {b} always measure the same echo: they hear each other's pings or share an \
                 echo wire; put them into different groups"
            ),
        }
    }
}
