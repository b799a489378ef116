//! Two clocks, two types: the host's and the board's. Only `align::clock` converts.

#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing, clippy::string_slice)]
#![deny(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)]
#![deny(clippy::allow_attributes, clippy::allow_attributes_without_reason)]

use std::time::Duration;

/// Host time in microseconds since the session began; it never decreases.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Timestamp(u64);

/// Board time in microseconds since the board's boot, widened beyond the wire's 32 bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct DeviceTime(u64);

macro_rules! clock {
    ($clock:ident) => {
        impl $clock {
            /// The instant `us` microseconds after this clock's zero.
            #[must_use]
            pub const fn from_us(us: u64) -> Self {
                Self(us)
            }

            /// Microseconds since this clock's zero.
            #[must_use]
            pub const fn us(self) -> u64 {
                self.0
            }

            /// Seconds since this clock's zero.
            #[must_use]
            pub fn seconds(self) -> f64 {
                self.0 as f64 * 1e-6
            }

            /// Seconds from `earlier` to here, negative if `earlier` is later.
            #[must_use]
            pub fn seconds_since(self, earlier: Self) -> f64 {
                self.0.wrapping_sub(earlier.0).cast_signed() as f64 * 1e-6
            }
        }

        impl std::ops::Add<Duration> for $clock {
            type Output = Self;
            fn add(self, span: Duration) -> Self {
                Self(self.0.saturating_add(u64::try_from(span.as_micros()).unwrap_or(u64::MAX)))
            }
        }
    };
}

clock!(Timestamp);
clock!(DeviceTime);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_have_a_sign() {
        let (a, b) = (Timestamp::from_us(1_000_000), Timestamp::from_us(1_500_000));
        assert!((b.seconds_since(a) - 0.5).abs() < 1e-12);
        assert!((a.seconds_since(b) + 0.5).abs() < 1e-12);
        assert_eq!(a + Duration::from_millis(500), b);
    }
}
