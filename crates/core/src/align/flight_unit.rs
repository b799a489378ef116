//! The unit of the times of flight: microseconds, or the centimetres that many examples for Arduino compute from them; and millimetres
//! where centimetres are meant, or the reverse.

use super::decade::Decade;
use super::params::Params;
use super::trouble::Trouble;
use slamd_protocol::{Echo, Sonar};

/// Finds the unit: a ring of microseconds soon reports more than the `max_cm_flight` that no centimetre exceeds.
#[derive(Clone, Debug)]
pub(crate) struct FlightUnit {
    unit: Unit,
    /// The configured true over reported range.
    scale: f64,
    decade: Decade,
    params: Params,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Unit {
    /// So many flights, all of them small, and the least of them.
    Unknown {
        flights: u32,
        least: u16,
    },
    Microseconds,
    Centimetres,
}

/// Microseconds of flight per centimetre of range, there and back, at 20 degrees.
const US_PER_CM: f64 = 2e4 / 343.4;

impl FlightUnit {
    /// The unit of a ring with this true over reported range, whose sensors measure up to `max_range_m`.
    pub(crate) fn new(scale: f64, max_range_m: f64, params: Params) -> Self {
        Self {
            unit: Unit::Unknown { flights: 0, least: u16::MAX },
            scale,
            decade: Decade::new(max_range_m, params),
            params,
        }
    }

    /// The wheels have rolled so far in a sweep, metres.
    pub(crate) fn rolled(&mut self, left_m: f64, right_m: f64) {
        self.decade.rolled(left_m, right_m);
    }

    /// True while the readings do not tell whether they are ten times too short.
    pub(crate) const fn is_open(&self) -> bool {
        self.decade.is_open()
    }

    /// Takes a group. Says once that the unit is another one.
    pub(crate) fn take(&mut self, sonar: &Sonar) -> Option<Trouble> {
        for answer in &sonar.echoes {
            let Echo::Flight { us } = answer.echo else { continue };
            if us > self.params.max_cm_flight {
                self.unit = Unit::Microseconds;
            } else if let Unit::Unknown { flights, least } = self.unit {
                let least = least.min(us);
                // Readings of which none is near may be centimetres, or microseconds beside a box.
                let needed = self.params.unit_flights * if least > self.params.near_cm_flight { 5 } else { 1 };
                if flights >= needed {
                    self.unit = Unit::Centimetres;
                    return Some(Trouble::FlightsInCentimetres);
                }
                self.unit = Unit::Unknown { flights: flights + 1, least };
            }
        }
        let has_changed = self.decade.take(sonar, self.scale * self.us_per_number());
        has_changed
            .then(|| Trouble::RangesOff { factor: self.decade.factor(), scale: self.scale * self.decade.factor() })
    }

    /// True over reported range where all are ten times too short or too long.
    pub(crate) const fn range_factor(&self) -> f64 {
        self.decade.factor()
    }

    /// Microseconds of flight per number that the board sends.
    pub(crate) fn factor(&self) -> f64 {
        self.us_per_number() * self.decade.factor()
    }

    /// The same where no range is ten times too short or too long.
    fn us_per_number(&self) -> f64 {
        if self.unit == Unit::Centimetres { US_PER_CM } else { 1.0 }
    }

    /// A time of flight in microseconds, whatever the board counts; none while the unit is unknown.
    pub(crate) fn microseconds(&self, us: u16) -> Option<u16> {
        let factor = self.factor();
        match self.unit {
            Unit::Unknown { .. } => None,
            Unit::Microseconds if (factor - 1.0).abs() < 0.5 => Some(us),
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a cast from f64 saturates, and no time is negative"
            )]
            Unit::Microseconds | Unit::Centimetres => Some((factor * f64::from(us)) as u16),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use slamd_protocol::SensorEcho;

    fn group(flights: [u16; 2]) -> Sonar {
        let echoes = flights.into_iter().enumerate();
        let echoes = echoes.map(|(sensor, us)| SensorEcho { sensor: u8::from(sensor > 0), echo: Echo::Flight { us } });
        Sonar { t_us: 0, group: 0, last_of_cycle: true, left_ticks: 0, right_ticks: 0, echoes: echoes.collect() }
    }

    #[test]
    fn centimetres_are_said_once_and_converted() {
        let mut unit = FlightUnit::new(1.0, 3.0, Params::default());
        let said = (0..500_u16).filter_map(|k| unit.take(&group([80 + k % 7, 250]))).collect::<Vec<_>>();
        assert_eq!(said, [Trouble::FlightsInCentimetres]);
        assert!((5_800..5_850).contains(&unit.microseconds(100).unwrap()));
    }

    #[test]
    fn microseconds_stay_so_beside_a_wall() {
        let mut unit = FlightUnit::new(1.0, 3.0, Params::default());
        assert_eq!(unit.microseconds(300), None, "it may be either");
        assert_eq!(unit.take(&group([300, 8_000])), None);
        assert!((0..500).all(|_| unit.take(&group([300, 310])).is_none()));
        assert_eq!(unit.microseconds(300), Some(300));
    }
}
