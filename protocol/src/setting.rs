//! The board's settings: keys of CONFIG_SET and CONFIG_GET.

use core::ops::RangeInclusive;

macro_rules! settings {
    ($($(#[$doc:meta])* $item:ident = $key:literal, $name:literal, $range:expr, $default:literal;)*) => {
        /// A setting that the board keeps while it is switched off.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[repr(u8)]
        pub enum Setting {
            $($(#[$doc])* $item = $key,)*
        }

        impl Setting {
            /// All settings in the order of their keys, which are 1, 2, 3 and so on.
            pub const ALL: [Self; [$($key),*].len()] = [$(Self::$item),*];

            /// Its name in the specification and in the robot's configuration.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$item => $name,)*
                }
            }

            /// The values it may have.
            #[must_use]
            pub const fn range(self) -> RangeInclusive<i32> {
                match self {
                    $(Self::$item => $range,)*
                }
            }

            /// Its value on a board where it was never set.
            #[must_use]
            pub const fn default(self) -> i32 {
                match self {
                    $(Self::$item => $default,)*
                }
            }
        }
    };
}

settings! {
    /// Sensors of the ring.
    Sensors = 1, "sensors", 1..=64, 32;
    /// Firing groups; sensor i belongs to group i mod groups.
    Groups = 2, "groups", 1..=8, 4;
    /// Microseconds from one group's trigger to the next.
    SlotUs = 3, "slot_us", 10_000..=60_000, 25_000;
    /// Milliseconds between two ENCODER messages.
    EncoderPeriodMs = 4, "encoder_period_ms", 5..=1_000, 20;
    /// Encoder ticks per turn of a wheel: all edges of both channels.
    TicksPerTurn = 5, "ticks_per_turn", 1..=10_000_000, 1_440;
    /// 1 if the left encoder counts backwards.
    LeftReversed = 6, "left_reversed", 0..=1, 0;
    /// 1 if the right encoder counts backwards.
    RightReversed = 7, "right_reversed", 0..=1, 0;
    /// 1 if the two encoders are connected to each other's pins.
    WheelsSwapped = 8, "wheels_swapped", 0..=1, 0;
    /// Radius of the circle on which the sensors sit, millimetres.
    RingRadiusMm = 9, "ring_radius_mm", 0..=2_000, 150;
    /// Half the beam's opening angle, hundredths of degrees.
    HalfAngleCdeg = 10, "half_angle_cdeg", 0..=6_000, 1_250;
    /// 1 if the sensors are numbered clockwise.
    Clockwise = 11, "clockwise", 0..=1, 0;
    /// Maximum range, millimetres; an echo from farther away is reported as no echo.
    MaxRangeMm = 12, "max_range_mm", 100..=6_000, 3_000;
    /// Highest speed of a wheel, millimetres per second; 0 on a board without motors.
    TopSpeedMmS = 13, "top_speed_mm_s", 0..=2_000, 0;
    /// Ramp of the wheels' speeds, millimetres per second squared. Stops do not wait for it.
    AccelerationMmS2 = 14, "acceleration_mm_s2", 50..=5_000, 500;
    /// The board stops if an echo where it drives is nearer than this, millimetres from the sensor.
    StopDistanceMm = 15, "stop_distance_mm", 0..=2_000, 250;
    /// Radius of the wheels, micrometres: it makes speeds of encoder ticks.
    WheelRadiusUm = 16, "wheel_radius_um", 5_000..=500_000, 35_000;
    /// Feed-forward gain: thousandths of the full motor voltage per 100 mm/s of commanded speed.
    GainForward = 17, "gain_forward", 0..=1_000, 100;
    /// Proportional gain: thousandths of the full motor voltage per 100 mm/s of error.
    GainProportional = 18, "gain_proportional", 0..=1_000, 100;
    /// Integral gain: thousandths of the full motor voltage per 100 mm/s of error, each second.
    GainIntegral = 19, "gain_integral", 0..=2_000, 300;
    /// 1 if the left motor runs backwards.
    LeftMotorReversed = 20, "left_motor_reversed", 0..=1, 0;
    /// 1 if the right motor runs backwards.
    RightMotorReversed = 21, "right_motor_reversed", 0..=1, 0;
}

impl Setting {
    /// Its key on the wire.
    #[must_use]
    pub const fn key(self) -> u8 {
        self as u8
    }

    /// The setting with this key, if this version knows it.
    #[must_use]
    pub fn from_key(key: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|setting| setting.key() == key)
    }

    /// The setting with this name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|setting| setting.name() == name)
    }

    /// True if the setting changes the firing or the motors: the board accepts it only while the ring is stopped.
    #[must_use]
    pub const fn needs_stop(self) -> bool {
        matches!(self, Self::Sensors | Self::Groups | Self::SlotUs) || self.key() >= Self::MaxRangeMm.key()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_count_up_and_names_and_defaults_fit() {
        for (key, setting) in (1u8..).zip(Setting::ALL) {
            assert_eq!(setting.key(), key);
            assert_eq!(Setting::from_key(key), Some(setting));
            assert_eq!(Setting::from_name(setting.name()), Some(setting));
            assert!(setting.range().contains(&setting.default()), "{}", setting.name());
        }
        assert_eq!(Setting::from_key(0), None);
        assert_eq!(Setting::from_name("baud"), None);
    }
}
