//! Readings that pile up at one value: a driver's way to say "no echo".

use std::collections::{BTreeMap, BTreeSet};

/// A value is a pile if so many readings have it, of so many sensors.
const MIN_SHARE: f64 = 0.01;
const MIN_READINGS: u64 = 20;
const MIN_SENSORS: f64 = 0.25;
/// So many times as many readings as any other value near it.
const MIN_RATIO: u64 = 5;
/// Values within this share of a value are near it.
const NEAR: f64 = 0.2;
/// Of a driver that clips, the value is among the greatest: at most this share of the readings lies beyond.
const MAX_BEYOND: f64 = 0.3;
/// As in whole tenths of a millimetre.
const RESOLUTION: f64 = 1e4;

/// A value at which readings pile up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pile {
    pub(super) value: f64,
    pub(super) count: u64,
    pub(super) sensors: usize,
}

/// The values of a recording with the number of their readings.
#[derive(Clone, Debug, Default)]
pub(super) struct Values(BTreeMap<i64, (u64, BTreeSet<usize>)>);

impl Values {
    /// Takes a finite reading above zero, metres.
    #[expect(clippy::cast_possible_truncation, reason = "a float's cast stops at the limits")]
    pub(super) fn add(&mut self, sensor: usize, reading: f64) {
        let (count, sensors) = self.0.entry((reading * RESOLUTION).round() as i64).or_default();
        *count += 1;
        sensors.insert(sensor);
    }

    /// The pile of a recording, of so many sensors; none if the readings are spread.
    pub(super) fn pile(&self, sensors: usize) -> Option<Pile> {
        let all: u64 = self.0.values().map(|(count, _)| count).sum();
        let (key, (count, by)) = self.0.iter().max_by_key(|(_, (count, _))| *count)?;
        let value = *key as f64;
        let near = |other: &i64| other != key && (*other as f64 - value).abs() <= NEAR * value;
        let next =
            self.0.iter().filter(|(other, _)| near(other)).map(|(_, (count, _))| *count).max().unwrap_or_default();
        let beyond: u64 = self.0.iter().filter(|(other, _)| *other > key).map(|(_, (count, _))| count).sum();
        let is_pile = *count >= MIN_READINGS
            && *count as f64 >= MIN_SHARE * all as f64
            && by.len() as f64 >= (MIN_SENSORS * sensors as f64).max(2.0)
            && *count >= MIN_RATIO * next.max(1)
            && beyond as f64 <= MAX_BEYOND * all as f64
            && self.0.len() > 1;
        is_pile.then_some(Pile { value: value / RESOLUTION, count: *count, sensors: by.len() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Readings from 0.6 m to 3.6 m of eight sensors, and so many more of one value.
    fn pile(value: f64, count: usize, sensors: usize) -> Option<Pile> {
        let mut values = Values::default();
        (0..3_000).for_each(|k| values.add(k % 8, 0.6 + 0.001 * k as f64));
        (0..count).for_each(|k| values.add(k % sensors, value));
        values.pile(8)
    }

    #[test]
    fn one_value_of_many_sensors_is_a_pile() {
        let found = pile(2.99, 300, 6).unwrap();
        assert!((found.value - 2.99).abs() < 1e-9, "{found:?}");
        assert_eq!((found.count, found.sensors), (301, 7));
        assert_eq!(pile(2.99, 300, 1).map(|pile| pile.sensors), Some(2), "one more by chance");
        assert_eq!(pile(2.99, 15, 6), None);
        assert_eq!(pile(1.0, 300, 6), None, "not among the greatest");
    }

    #[test]
    fn a_robot_that_stands_has_no_pile() {
        let mut values = Values::default();
        (0..4_000).for_each(|k| values.add(k % 8, 0.5 + 0.25 * (k % 8) as f64));
        assert_eq!(values.pile(8), None);
    }
}
