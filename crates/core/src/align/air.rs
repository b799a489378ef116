//! The air temperature as the board measures it: implausible values are refused, and the last plausible one stays.

use super::params::Params;
use super::trouble::Trouble;
use crate::time::Timestamp;

/// The air temperature in use.
#[derive(Clone, Debug)]
pub(crate) struct Air {
    celsius: f64,
    /// When the board's last plausible value arrived.
    measured_at: Option<Timestamp>,
    has_said: bool,
    params: Params,
}

impl Air {
    /// Air of the configured temperature, degrees Celsius.
    #[must_use]
    pub(crate) const fn new(celsius: f64, params: Params) -> Self {
        Self { celsius, measured_at: None, has_said: false, params }
    }

    /// The temperature in use, degrees Celsius.
    #[must_use]
    pub(crate) const fn celsius(&self) -> f64 {
        self.celsius
    }

    /// Takes a measurement, degrees Celsius. Returns what is wrong with it, once.
    pub(crate) fn measured(&mut self, celsius: f64, at: Timestamp) -> Option<Trouble> {
        let Params { min_air_c, max_air_c, air_jump_k, air_drift_k_s, .. } = self.params;
        let trouble = if !(min_air_c..=max_air_c).contains(&celsius) {
            Trouble::Temperature(celsius, self.celsius)
        } else if let Some(since) = self.measured_at
            && (celsius - self.celsius).abs() > air_jump_k + air_drift_k_s * at.seconds_since(since)
        {
            Trouble::TemperatureJump(celsius, self.celsius)
        } else {
            (self.celsius, self.measured_at) = (celsius, Some(at));
            return None;
        };
        (!std::mem::replace(&mut self.has_said, true)).then_some(trouble)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(seconds: u64) -> Timestamp {
        Timestamp::from_us(seconds * 1_000_000)
    }

    #[test]
    fn implausible_air_is_refused_and_said_once() {
        let mut air = Air::new(20.0, Params::default());
        assert_eq!(air.measured(12.0, after(0)), None, "the first value may differ from the configured one");
        assert_eq!(air.measured(80.0, after(1)), Some(Trouble::Temperature(80.0, 12.0)));
        assert_eq!((air.measured(80.0, after(2)), air.celsius()), (None, 12.0));
    }

    #[test]
    fn a_jump_is_refused_and_a_slow_change_is_followed() {
        let mut air = Air::new(20.0, Params::default());
        air.measured(20.0, after(0));
        assert_eq!(air.measured(35.0, after(1)), Some(Trouble::TemperatureJump(35.0, 20.0)));
        assert!((air.celsius() - 20.0).abs() < 1e-9);
        for (minute, celsius) in (1_u8..).zip(21_u8..=50) {
            air.measured(f64::from(celsius), after(60 * u64::from(minute)));
        }
        assert!((air.celsius() - 50.0).abs() < 1e-9, "{air:?}");
    }
}
