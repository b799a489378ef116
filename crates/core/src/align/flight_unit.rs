//! The unit of the times of flight: microseconds, or the centimetres that many examples for Arduino compute from them.

use super::params::Params;
use super::trouble::Trouble;
use slamd_protocol::{Echo, Sonar};

/// Finds the unit: a ring of microseconds soon reports more than the `max_cm_flight` that no centimetre exceeds.
#[derive(Clone, Debug)]
pub(crate) struct FlightUnit {
    unit: Unit,
    params: Params,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Unit {
    /// So many flights, all of them small.
    Unknown(u32),
    Microseconds,
    Centimetres,
}

/// Microseconds of flight per centimetre of range, there and back, at 20 degrees.
const US_PER_CM: f64 = 2e4 / 343.4;

impl FlightUnit {
    pub(crate) const fn new(params: Params) -> Self {
        Self { unit: Unit::Unknown(0), params }
    }

    /// Takes a group. Says once that the unit is another one.
    pub(crate) fn take(&mut self, sonar: &Sonar) -> Option<Trouble> {
        for answer in &sonar.echoes {
            let Echo::Flight { us } = answer.echo else { continue };
            if us > self.params.max_cm_flight {
                self.unit = Unit::Microseconds;
            } else if let Unit::Unknown(flights) = self.unit {
                if flights >= self.params.unit_flights {
                    self.unit = Unit::Centimetres;
                    return Some(Trouble::FlightsInCentimetres);
                }
                self.unit = Unit::Unknown(flights + 1);
            }
        }
        None
    }

    /// A time of flight in microseconds, whatever the board counts; none while the unit is unknown.
    pub(crate) fn microseconds(&self, us: u16) -> Option<u16> {
        match self.unit {
            Unit::Unknown(_) => None,
            Unit::Microseconds => Some(us),
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a cast from f64 saturates, and no time is negative"
            )]
            Unit::Centimetres => Some((US_PER_CM * f64::from(us)) as u16),
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
        let mut unit = FlightUnit::new(Params::default());
        let said = (0..500_u16).filter_map(|k| unit.take(&group([80 + k % 7, 250]))).collect::<Vec<_>>();
        assert_eq!(said, [Trouble::FlightsInCentimetres]);
        assert!((5_800..5_850).contains(&unit.microseconds(100).unwrap()));
    }

    #[test]
    fn microseconds_stay_so_beside_a_wall() {
        let mut unit = FlightUnit::new(Params::default());
        assert_eq!(unit.microseconds(300), None, "it may be either");
        assert_eq!(unit.take(&group([300, 8_000])), None);
        assert!((0..500).all(|_| unit.take(&group([300, 310])).is_none()));
        assert_eq!(unit.microseconds(300), Some(300));
    }
}
