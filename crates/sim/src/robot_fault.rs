//! Faults of the robot against its configuration, and hands that move it.
//!
//! How each kind is simulated:
//!
//! - `wheel-radius`, `ticks`, `base`: the true value is this factor times the configured one. The driver
//!   knows the true value, so the drive stays the same and the encoder counts differ;
//! - `wheels-swapped`, `wheels-reversed`: the left count is reported as the right one; both run backwards;
//! - `ring-mirrored`, `ring-rotated`: the sensors are numbered clockwise; the ring is mounted turned by
//!   so many degrees, counter-clockwise;
//! - `range-unit`: each range is reported as this factor times the true one;
//! - `range-noise`: each range has a further error with this standard deviation, metres;
//! - `kidnap`: the robot stops, is carried to another free pose and drives on; with `lifted` its sensors read
//!   nonsense for [`LIFT_S`] before;
//! - `push`: the robot stops and is pushed sideways by so many metres, as soon as there is room;
//! - `spin`: the wheels turn and the robot does not move with them.

mod hands;

pub(super) use hands::{Act, Hands};

use super::random::Random;
use super::sonar::{MAX_RANGE_M, MIN_RANGE_M};
use slamd_core::Pose2;
use std::str::FromStr;

/// For how long a robot is in the air, seconds.
pub const LIFT_S: f64 = 3.0;
/// Default time of a kidnap or a push, seconds.
const LATE_S: f64 = 60.0;
/// Default length of a spin, seconds.
const SPIN_S: f64 = 1.0;

/// One way in which the robot differs from its configuration, or is moved by hands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RobotFault {
    /// True over configured radius of both wheels.
    WheelRadius(f64),
    /// True over configured ticks per turn.
    Ticks(f64),
    /// True over configured wheel base; a skid-steered robot has 1.5 to 2.
    Base(f64),
    /// Left and right encoder are swapped.
    WheelsSwapped,
    /// Both encoders count backwards.
    WheelsReversed,
    /// The sensors are numbered clockwise.
    RingMirrored,
    /// The ring is turned against the configuration, degrees counter-clockwise.
    RingRotated(f64),
    /// Reported over true range.
    RangeUnit(f64),
    /// Standard deviation of a further error of each range, metres.
    RangeNoise(f64),
    /// The robot is carried to another place.
    Kidnap {
        /// Time, seconds from the session's start.
        at_s: f64,
        /// Its sensors read nonsense while it is in the air.
        is_lifted: bool,
    },
    /// The robot is pushed sideways.
    Push {
        /// Time, seconds from the session's start.
        at_s: f64,
        /// Distance, metres.
        metres: f64,
    },
    /// Wheels spin in place.
    Spin {
        /// Start, seconds from the session's start.
        from_s: f64,
        /// End, seconds from the session's start.
        until_s: f64,
        /// Which wheels: left and right.
        wheels: [bool; 2],
    },
}

impl FromStr for RobotFault {
    type Err = String;

    /// Parses `KIND`, `KIND=VALUE`, `KIND@SECONDS` or `KIND=VALUE@SECONDS[-SECONDS]`, for example `base=1.6` or
    /// `push=0.3@60s`. The `s` is optional.
    fn from_str(text: &str) -> Result<Self, String> {
        let (what, span) = text.split_once('@').map_or((text, None), |(what, span)| (what, Some(span)));
        let (kind, value) = what.split_once('=').map_or((what, None), |(kind, value)| (kind, Some(value)));
        let fault = Text { text, value, span };
        if !matches!(kind, "kidnap" | "push" | "spin") && span.is_some() {
            return Err(format!("robot fault \"{text}\": {kind} has no time, it is there from the start"));
        }
        match kind {
            "wheel-radius" => fault.number(0.1, 10.0).map(Self::WheelRadius),
            "ticks" => fault.number(0.1, 10.0).map(Self::Ticks),
            "base" => fault.number(0.1, 10.0).map(Self::Base),
            "wheels-swapped" => fault.bare(Self::WheelsSwapped),
            "wheels-reversed" => fault.bare(Self::WheelsReversed),
            "ring-mirrored" => fault.bare(Self::RingMirrored),
            "ring-rotated" => fault.number(-360.0, 360.0).map(Self::RingRotated),
            "range-unit" => match value {
                Some("one-way") => Ok(Self::RangeUnit(0.5)),
                Some("cm") => Ok(Self::RangeUnit(0.1)),
                _ => fault.number(0.01, 100.0).map(Self::RangeUnit),
            },
            "range-noise" => fault.number(0.0, 10.0).map(Self::RangeNoise),
            "kidnap" => match value {
                None | Some("lifted") => Ok(Self::Kidnap {
                    at_s: fault.times()?.map_or(LATE_S, |(at_s, _)| at_s),
                    is_lifted: value.is_some(),
                }),
                Some(value) => Err(format!(
                    "robot fault \"{text}\": \"{value}\" is not lifted; leave it away or say kidnap=lifted"
                )),
            },
            "push" => {
                let metres = fault.number(0.01, 2.0)?;
                Ok(Self::Push { at_s: fault.times()?.map_or(LATE_S, |(at_s, _)| at_s), metres })
            }
            "spin" => {
                let wheels = match value {
                    None | Some("both") => [true, true],
                    Some("left") => [true, false],
                    Some("right") => [false, true],
                    Some(value) => {
                        return Err(format!("robot fault \"{text}\": \"{value}\" is neither left, right nor both"));
                    }
                };
                let (from_s, until_s) = fault.times()?.unwrap_or((LATE_S, None));
                Ok(Self::Spin { from_s, until_s: until_s.unwrap_or(from_s + SPIN_S), wheels })
            }
            _ => Err(format!("unknown robot fault \"{kind}\": it is {}", Self::KINDS.join(", "))),
        }
    }
}

/// The parts of a robot fault as text.
struct Text<'a> {
    text: &'a str,
    value: Option<&'a str>,
    span: Option<&'a str>,
}

impl Text<'_> {
    fn number(&self, from: f64, to: f64) -> Result<f64, String> {
        let parsed = self.value.and_then(|value| value.parse().ok()).filter(|value| (from..=to).contains(value));
        parsed.ok_or_else(|| format!("robot fault \"{}\": a number from {from} to {to} is wanted after =", self.text))
    }

    fn bare(&self, fault: RobotFault) -> Result<RobotFault, String> {
        match self.value {
            None => Ok(fault),
            Some(_) => Err(format!("robot fault \"{}\" takes no value", self.text)),
        }
    }

    /// Start and end, if given, seconds.
    fn times(&self) -> Result<Option<(f64, Option<f64>)>, String> {
        let Some(span) = self.span else { return Ok(None) };
        let (from, until) = span.split_once('-').map_or((span, None), |(from, until)| (from, Some(until)));
        let seconds = |time: &str| {
            let parsed = time.strip_suffix('s').unwrap_or(time).parse().ok();
            parsed.filter(|s: &f64| s.is_finite() && *s >= 0.0).ok_or_else(|| {
                format!("robot fault \"{}\": \"{time}\" is not a time in seconds, for example 60s", self.text)
            })
        };
        Ok(Some((seconds(from)?, until.map(seconds).transpose()?)))
    }
}

/// Writes the form that [`RobotFault::from_str`] parses.
impl std::fmt::Display for RobotFault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::WheelRadius(factor) => write!(f, "wheel-radius={factor}"),
            Self::Ticks(factor) => write!(f, "ticks={factor}"),
            Self::Base(factor) => write!(f, "base={factor}"),
            Self::WheelsSwapped => f.write_str("wheels-swapped"),
            Self::WheelsReversed => f.write_str("wheels-reversed"),
            Self::RingMirrored => f.write_str("ring-mirrored"),
            Self::RingRotated(degrees) => write!(f, "ring-rotated={degrees}"),
            Self::RangeUnit(factor) => write!(f, "range-unit={factor}"),
            Self::RangeNoise(sigma_m) => write!(f, "range-noise={sigma_m}"),
            Self::Kidnap { at_s, is_lifted: false } => write!(f, "kidnap@{at_s}s"),
            Self::Kidnap { at_s, is_lifted: true } => write!(f, "kidnap=lifted@{at_s}s"),
            Self::Push { at_s, metres } => write!(f, "push={metres}@{at_s}s"),
            Self::Spin { from_s, until_s, wheels } => {
                let word = match wheels {
                    [true, false] => "left",
                    [false, true] => "right",
                    _ => "both",
                };
                write!(f, "spin={word}@{from_s}s-{until_s}s")
            }
        }
    }
}

impl RobotFault {
    /// The kinds, as on the command line.
    pub const KINDS: [&'static str; 12] = [
        "wheel-radius=FACTOR",
        "ticks=FACTOR",
        "base=FACTOR",
        "wheels-swapped",
        "wheels-reversed",
        "ring-mirrored",
        "ring-rotated=DEGREES",
        "range-unit=FACTOR|one-way|cm",
        "range-noise=METRES",
        "kidnap[=lifted][@TIME]",
        "push=METRES[@TIME]",
        "spin[=left|right|both][@TIME[-TIME]]",
    ];
}

/// What differs from the configuration all the time.
#[derive(Clone, Debug)]
pub(super) struct Misbuilt {
    pub(super) radius: f64,
    pub(super) ticks: f64,
    pub(super) base: f64,
    is_swapped: bool,
    is_reversed: bool,
    is_mirrored: bool,
    rotated_rad: f64,
    range_factor: f64,
    noise_m: f64,
    spins: Vec<(f64, f64, [bool; 2])>,
    random: Random,
}

impl Misbuilt {
    pub(super) fn new(faults: &[RobotFault], random: Random) -> Self {
        let mut built = Self {
            radius: 1.0,
            ticks: 1.0,
            base: 1.0,
            is_swapped: false,
            is_reversed: false,
            is_mirrored: false,
            rotated_rad: 0.0,
            range_factor: 1.0,
            noise_m: 0.0,
            spins: Vec::new(),
            random,
        };
        for fault in faults {
            match *fault {
                RobotFault::WheelRadius(factor) => built.radius = factor,
                RobotFault::Ticks(factor) => built.ticks = factor,
                RobotFault::Base(factor) => built.base = factor,
                RobotFault::WheelsSwapped => built.is_swapped = true,
                RobotFault::WheelsReversed => built.is_reversed = true,
                RobotFault::RingMirrored => built.is_mirrored = true,
                RobotFault::RingRotated(degrees) => built.rotated_rad = degrees.to_radians(),
                RobotFault::RangeUnit(factor) => built.range_factor = factor,
                RobotFault::RangeNoise(sigma_m) => built.noise_m = sigma_m,
                RobotFault::Spin { from_s, until_s, wheels } => built.spins.push((from_s, until_s, wheels)),
                RobotFault::Kidnap { .. } | RobotFault::Push { .. } => {}
            }
        }
        built
    }

    /// The counts that reach the board.
    pub(super) fn counts(&self, ticks: [i32; 2]) -> [i32; 2] {
        let [left, right] = if self.is_reversed { ticks.map(i32::wrapping_neg) } else { ticks };
        if self.is_swapped { [right, left] } else { [left, right] }
    }

    /// The true pose of a sensor that the configuration has at `robot_from_sensor`.
    pub(super) fn mounted(&self, robot_from_sensor: Pose2) -> Pose2 {
        let Pose2 { x_m, y_m, theta_rad } = robot_from_sensor;
        let mirrored = if self.is_mirrored { Pose2::new(x_m, -y_m, -theta_rad) } else { robot_from_sensor };
        if self.rotated_rad.abs() > 0.0 { Pose2::new(0.0, 0.0, self.rotated_rad) * mirrored } else { mirrored }
    }

    /// The range that is reported for one that the sensor measured, metres.
    pub(super) fn reported(&mut self, range_m: Option<f64>) -> Option<f64> {
        if self.noise_m <= 0.0 {
            return range_m.map(|range_m| range_m * self.range_factor);
        }
        let noisy_m = (self.noise_m * self.random.normal() + range_m?).max(MIN_RANGE_M);
        (noisy_m <= MAX_RANGE_M).then_some(noisy_m * self.range_factor)
    }

    /// Which wheels spin at `now_s` seconds.
    pub(super) fn spins(&self, now_s: f64) -> Option<[bool; 2]> {
        let spin = self.spins.iter().find(|(from_s, until_s, _)| (*from_s..*until_s).contains(&now_s));
        spin.map(|(.., wheels)| *wheels)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    #[test]
    fn what_is_written_is_parsed() {
        for text in [
            "wheel-radius=0.5",
            "ticks=4",
            "base=1.6",
            "wheels-swapped",
            "wheels-reversed",
            "ring-mirrored",
            "ring-rotated=-30",
            "range-unit=0.5",
            "range-noise=0.08",
            "kidnap@60s",
            "kidnap=lifted@45.5s",
            "push=0.3@60s",
            "spin=left@60s-61s",
        ] {
            assert_eq!(text.parse::<RobotFault>().unwrap().to_string(), text);
        }
        assert_eq!("range-unit=one-way".parse(), Ok(RobotFault::RangeUnit(0.5)));
        assert_eq!("spin@10".parse::<RobotFault>().unwrap().to_string(), "spin=both@10s-11s");
    }

    #[test]
    fn errors_say_what_is_wrong() {
        let error = |text: &str| text.parse::<RobotFault>().unwrap_err();
        assert!(error("wings").contains("unknown robot fault \"wings\": it is wheel-radius=FACTOR, ticks"));
        assert!(error("base=big").contains("a number from 0.1 to 10 is wanted"));
        assert!(error("base").contains("is wanted after ="));
        assert!(error("base=2@60").contains("base has no time"));
        assert!(error("wheels-swapped=1").contains("takes no value"));
        assert!(error("push=0.3@soon").contains("\"soon\" is not a time in seconds"));
        assert!(error("spin=front").contains("neither left, right nor both"));
    }

    #[test]
    fn each_fault_changes_what_it_says() {
        let built = |faults: &[RobotFault]| Misbuilt::new(faults, Random::new(1, Stream::RobotFault));
        assert_eq!(built(&[]).counts([3, 5]), [3, 5]);
        assert_eq!(built(&[RobotFault::WheelsSwapped, RobotFault::WheelsReversed]).counts([3, 5]), [-5, -3]);
        let left = Pose2::new(0.0, 0.15, std::f64::consts::FRAC_PI_2);
        let right = built(&[RobotFault::RingMirrored]).mounted(left);
        assert!((right.y_m + 0.15).abs() < 1e-12 && (right.theta_rad + left.theta_rad).abs() < 1e-12);
        let back = built(&[RobotFault::RingRotated(90.0)]).mounted(left);
        assert!((back.x_m + 0.15).abs() < 1e-12);
        assert_eq!(built(&[RobotFault::RangeUnit(0.5)]).reported(Some(2.0)), Some(1.0));
        assert_eq!(built(&[]).reported(None), None);
        let mut noisy = built(&[RobotFault::RangeNoise(0.1)]);
        let off_m: Vec<f64> = (0..2000).filter_map(|_| noisy.reported(Some(1.5))).map(|m| m - 1.5).collect();
        let sigma_m = (off_m.iter().map(|m| m * m).sum::<f64>() / off_m.len() as f64).sqrt();
        assert!((sigma_m - 0.1).abs() < 0.01, "{sigma_m}");
    }
}
