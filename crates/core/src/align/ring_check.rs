//! Whether the groups fit the ring: sensors that it has, each in one group, none that repeats another's echo.

use super::params::Params;
use super::trouble::Trouble;
use slamd_protocol::{Echo, Sonar};

/// Watches the groups of one ring.
#[derive(Clone, Debug)]
pub(crate) struct RingCheck {
    sensors: Vec<Watched>,
    said: Said,
    params: Params,
}

/// One sensor, and how it compares with the sensor before it in the message.
#[derive(Clone, Copy, Debug, Default)]
struct Watched {
    group: Option<u8>,
    flight_us: Option<u16>,
    /// Echoes that differed from the one before, and how many of them equalled the other sensor's.
    changed: u32,
    equal: u32,
}

#[derive(Clone, Copy, Debug, Default)]
struct Said {
    unknown: bool,
    twice: bool,
    overlap: bool,
    crosstalk: bool,
    /// Messages with a sensor in another group than before: a board may change its groups once.
    overlaps: u32,
}

/// Sensors in two groups are reported from this number of them on.
const MIN_OVERLAPS: u32 = 4;

impl RingCheck {
    /// A check of a ring of so many sensors.
    #[must_use]
    pub(crate) fn new(sensors: usize, params: Params) -> Self {
        Self { sensors: vec![Watched::default(); sensors], said: Said::default(), params }
    }

    /// Takes a group. Returns what is wrong with it, each kind once.
    pub(crate) fn take(&mut self, sonar: &Sonar) -> Option<Trouble> {
        let count = self.sensors.len();
        let (mut trouble, mut before) = (None, None);
        let mut is_elsewhere = None;
        let mut named = 0_u64;
        for answer in &sonar.echoes {
            let bit = 1_u64.checked_shl(answer.sensor.into()).unwrap_or(0);
            if named & bit != 0 && !std::mem::replace(&mut self.said.twice, true) {
                trouble = Some(Trouble::Twice(answer.sensor));
            }
            named |= bit;
            let Some(sensor) = self.sensors.get_mut(usize::from(answer.sensor)) else {
                if !std::mem::replace(&mut self.said.unknown, true) {
                    trouble = Some(Trouble::UnknownSensor(answer.sensor, count));
                }
                continue;
            };
            if let Some(other) = sensor.group.replace(sonar.group).filter(|group| *group != sonar.group) {
                is_elsewhere = Some(Trouble::Overlap(answer.sensor, sonar.group.min(other), sonar.group.max(other)));
            }
            let Echo::Flight { us } = answer.echo else {
                before = None;
                continue;
            };
            let has_changed = sensor.flight_us.replace(us).is_none_or(|last| last != us);
            if let (Some((other, other_us)), true) = (before, has_changed) {
                sensor.changed += 1;
                sensor.equal += u32::from(us == other_us);
                if sensor.changed >= self.params.crosstalk_pings {
                    let share = f64::from(sensor.equal) / f64::from(sensor.changed);
                    (sensor.changed, sensor.equal) = (0, 0);
                    if share >= self.params.crosstalk_share && !std::mem::replace(&mut self.said.crosstalk, true) {
                        trouble = Some(Trouble::Crosstalk(other, answer.sensor));
                    }
                }
            }
            before = Some((answer.sensor, us));
        }
        if is_elsewhere.is_some() {
            self.said.overlaps += 1;
            if self.said.overlaps >= MIN_OVERLAPS && !std::mem::replace(&mut self.said.overlap, true) {
                return is_elsewhere;
            }
        }
        trouble
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use slamd_protocol::SensorEcho;

    fn group(group: u8, echoes: &[(u8, u16)]) -> Sonar {
        let echoes = echoes.iter().map(|&(sensor, us)| SensorEcho { sensor, echo: Echo::Flight { us } }).collect();
        Sonar { t_us: 0, group, last_of_cycle: false, left_ticks: 0, right_ticks: 0, echoes }
    }

    /// What is said of 200 cycles of a ring of 8 sensors in 4 groups.
    fn said(sonar: impl Fn(u8, u16) -> Sonar) -> Vec<Trouble> {
        let mut check = RingCheck::new(8, Params::default());
        let groups = (0..200_u16).flat_map(|cycle| (0..4).map(move |group| (group, cycle)));
        groups.filter_map(|(group, cycle)| check.take(&sonar(group, cycle))).collect()
    }

    /// Times of flight that differ.
    fn us(sensor: u8, cycle: u16) -> u16 {
        5_000 + 300 * u16::from(sensor) + cycle * 37 % 211
    }

    #[test]
    fn a_ring_as_it_should_be_is_silent() {
        assert_eq!(said(|g, cycle| group(g, &[(g, us(g, cycle)), (g + 4, us(g + 4, cycle))])), []);
        // A robot that stands between two walls, on a board that rounds.
        assert_eq!(said(|g, _| group(g, &[(g, 5_000), (g + 4, 5_000)])), []);
    }

    #[test]
    fn sensors_that_the_ring_does_not_have_are_said_once() {
        let troubles = said(|g, cycle| group(g, &[(g + 100, us(g, cycle))]));
        assert_eq!(troubles, [Trouble::UnknownSensor(100, 8)]);
    }

    #[test]
    fn a_sensor_that_comes_twice_in_a_message_is_said_once() {
        let troubles = said(|g, cycle| group(g, &[(g, us(g, cycle)), (g + 4, us(g, cycle)), (g, us(g + 1, cycle))]));
        assert_eq!(troubles.first(), Some(&Trouble::Twice(0)), "{troubles:?}");
        assert_eq!(troubles.iter().filter(|trouble| matches!(trouble, Trouble::Twice(_))).count(), 1);
    }

    #[test]
    fn groups_that_overlap_are_said_once() {
        let troubles = said(|g, cycle| group(g, &[(g, us(g, cycle)), ((g + 1) % 4, us(g + 1, cycle))]));
        assert!(matches!(troubles[..], [Trouble::Overlap(..)]), "{troubles:?}");
    }

    #[test]
    fn crosstalk_is_said_once() {
        let troubles = said(|g, cycle| group(g, &[(g, us(g, cycle)), (g + 4, us(g, cycle))]));
        assert_eq!(troubles, [Trouble::Crosstalk(0, 4)]);
    }
}
