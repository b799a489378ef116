//! Ranges as recordings have them: their unit, and their values for "no echo". Readings that the ring cannot have had are doubted.

use super::ImportError;
use super::pile::Values;
use super::rows::Row;
use slamd_core::Config;
use std::collections::BTreeMap;
use std::str::FromStr;

/// The unit of a recording's ranges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RangeUnit {
    /// Metres.
    Metres,
    /// Feet of 0.3048 m.
    Feet,
    /// Decimetres.
    Decimetres,
    /// Inches of 25.4 mm.
    Inches,
    /// Centimetres.
    Centimetres,
    /// Millimetres.
    Millimetres,
    /// Microseconds of flight, there and back.
    Microseconds,
}

use RangeUnit::{Centimetres, Decimetres, Feet, Inches, Metres, Microseconds, Millimetres};

impl RangeUnit {
    /// Without metres, the greatest first.
    const OTHERS: [Self; 6] = [Feet, Decimetres, Inches, Centimetres, Millimetres, Microseconds];

    /// Its name and its word on the command line.
    const fn words(self) -> [&'static str; 2] {
        match self {
            Metres => ["metres", "m"],
            Feet => ["feet", "ft"],
            Decimetres => ["decimetres", "dm"],
            Inches => ["inches", "in"],
            Centimetres => ["centimetres", "cm"],
            Millimetres => ["millimetres", "mm"],
            Microseconds => ["microseconds of flight, there and back", "us"],
        }
    }

    /// Its word on the command line.
    pub(super) const fn word(self) -> &'static str {
        let [_, word] = self.words();
        word
    }

    /// How many metres it is.
    pub(super) fn metres(self, sound_m_s: f64) -> f64 {
        match self {
            Metres => 1.0,
            Feet => 0.3048,
            Decimetres => 0.1,
            Inches => 0.0254,
            Centimetres => 0.01,
            Millimetres => 0.001,
            Microseconds => 0.5e-6 * sound_m_s,
        }
    }
}

impl FromStr for RangeUnit {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let all = std::iter::once(Metres).chain(Self::OTHERS);
        let mut named = all.filter(|unit| unit.words().get(1) == Some(&text));
        named.next().ok_or_else(|| "it must be m, ft, dm, in, cm, mm, or us for microseconds of flight".into())
    }
}

/// Makes metres of the readings, and infinity of what stands for "no echo".
pub(super) fn convert(rows: &mut [Row], unit: Option<RangeUnit>, no_echo: &[f64], sound_m_s: f64) {
    let factor = unit.unwrap_or(Metres).metres(sound_m_s);
    for reading in rows.iter_mut().flat_map(|row| &mut row.readings) {
        let is_none = no_echo.iter().any(|value| (value - *reading).abs() <= 1e-9 * value.abs().max(1.0));
        *reading = if is_none { f64::INFINITY } else { *reading * factor };
    }
}

/// With a smaller share of readings within the ring's range a recording is refused.
const MIN_WITHIN: f64 = 0.01;
/// The same where another unit fits nearly all readings.
const MIN_WITHIN_OTHER: f64 = 0.05;
/// A unit fits if so many readings are within the ring's range in it.
const FITS: f64 = 0.9;
/// From this share of readings beyond the ring's range on, a recording is doubtful.
const MAX_BEYOND: f64 = 0.1;
/// From this share on it is refused, where another unit fits.
const MAX_BEYOND_OTHER: f64 = 0.2;
/// In a unit that fits, the greatest reading is at least this share of the ring's greatest range.
const LIKELY: f64 = 0.6;
/// From this share of zeros on it is asked what they mean.
const MAX_ZEROS: f64 = 0.01;
/// Echoes may be this much farther than configured.
const TOLERANCE: f64 = 1.05;
/// The greatest reading stands for "no echo" where so many readings have it, of so many sensors, and it is near the ring's greatest range.
const MIN_AT_GREATEST: f64 = 0.03;
const MIN_SENSORS: f64 = 0.25;
const NEAR_MAX: f64 = 0.8;

/// All readings of a recording.
#[derive(Clone, Debug)]
pub(super) struct Readings {
    min_range_m: f64,
    max_range_m: f64,
    sound_m_s: f64,
    /// The unit that the user has named, in which the readings were.
    unit: RangeUnit,
    /// Finite readings above zero.
    values: Vec<f64>,
    zeros: u64,
    /// By sensor, how often it has the greatest reading so far.
    at_greatest: BTreeMap<usize, u64>,
    greatest: f64,
    by_value: Values,
}

impl Readings {
    pub(super) fn new(config: &Config, unit: RangeUnit, sound_m_s: f64) -> Self {
        let (min_range_m, max_range_m) = (config.ring.min_range_m, config.ring.max_range_m);
        let (values, at_greatest) = (Vec::new(), BTreeMap::new());
        let by_value = Values::default();
        Self { min_range_m, max_range_m, sound_m_s, unit, values, zeros: 0, at_greatest, greatest: 0.0, by_value }
    }

    /// Takes a reading. Infinity is no echo, NaN no measurement.
    pub(super) fn add(&mut self, sensor: usize, reading: f64) {
        self.zeros += u64::from(reading == 0.0);
        if !reading.is_finite() || reading <= 0.0 {
            return;
        }
        self.values.push(reading);
        self.by_value.add(sensor, reading);
        if reading > self.greatest {
            self.at_greatest.clear();
            self.greatest = reading;
        }
        if reading >= self.greatest {
            *self.at_greatest.entry(sensor).or_default() += 1;
        }
    }

    /// The reading from which on nothing is in range, where a driver writes the greatest range for "no echo"; `sensors` is the ring's
    /// number. It comes with a sentence.
    pub(super) fn clipped(&self, sensors: usize) -> Option<(f64, String)> {
        let count: u64 = self.at_greatest.values().sum();
        let is_near = (NEAR_MAX * self.max_range_m..self.max_range_m).contains(&self.greatest);
        let is_many = count as f64 >= MIN_AT_GREATEST * self.values.len() as f64;
        let is_shared = self.at_greatest.len() as f64 >= (MIN_SENSORS * sensors as f64).max(2.0);
        (is_near && is_many && is_shared).then(|| {
            let greatest = self.greatest;
            (
                greatest,
                format!(
                    "{count} readings of {} sensors are {greatest} m, the greatest: taken as nothing in range",
                    self.at_greatest.len()
                ),
            )
        })
    }

    /// Asks about a value at which readings pile up, below the one from which on nothing is in range.
    pub(super) fn pile(&self, nothing_from_m: f64, sensors: usize) -> Option<String> {
        let pile = self.by_value.pile(sensors).filter(|pile| pile.value < nothing_from_m)?;
        // As it stands in the recording.
        let shown = (pile.value / self.unit.metres(self.sound_m_s) * 1e4).round() / 1e4;
        let percent = 100.0 * pile.count as f64 / self.values.len() as f64;
        Some(format!(
            "{} readings ({percent:.0} %) of {} sensors are {shown}, many more than of any value near it, and are taken as ranges; where {shown} \
             means no echo: --no-echo {shown}",
            pile.count, pile.sensors
        ))
    }

    /// What is doubtful of the readings, one sentence each. `is_unit_told` where the user has named the unit.
    ///
    /// # Errors
    /// If hardly any reading lies within the ring's range.
    pub(super) fn check(&self, file: &str, is_unit_told: bool) -> Result<Vec<String>, ImportError> {
        let (min_range_m, max_range_m, all) = (self.min_range_m, self.max_range_m, self.values.len());
        let mut doubts = Vec::new();
        let (every, zeros) = (all as u64 + self.zeros, self.zeros);
        if zeros as f64 >= MAX_ZEROS * every as f64 && zeros > 0 {
            let percent = 100.0 * zeros as f64 / every as f64;
            doubts.push(format!(
                "{zeros} readings ({percent:.0} %) are 0, taken as too close; where 0 means no echo: --no-echo 0"
            ));
        }
        if all == 0 {
            doubts.push("no sensor has measured a range: every cell is empty, `inf` or 0".into());
            return Ok(doubts);
        }
        let within = self.values.iter().filter(|value| (min_range_m..=max_range_m).contains(*value)).count();
        let beyond = self.values.iter().filter(|value| **value > max_range_m).count();
        let guess = self.guess();
        let question = guess.map_or_else(
            || "another unit? The ring CSV has metres; --range-unit names another".into(),
            |(unit, _)| {
                let [name, word] = unit.words();
                format!("{name}? --range-unit {word}")
            },
        );
        let share = within as f64 / all as f64;
        if share < MIN_WITHIN || (share < MIN_WITHIN_OTHER && guess.is_some()) {
            let few = match within {
                0 => format!("no reading of {all} lies"),
                1 => format!("only 1 reading of {all} lies"),
                _ => format!("only {within} readings of {all} lie"),
            };
            let limits = if beyond > 0 {
                let smallest = self.values.iter().copied().fold(f64::INFINITY, f64::min);
                format!("ring.max_range_m = {max_range_m}; smallest is {smallest}")
            } else {
                format!("ring.min_range_m = {min_range_m}; greatest is {}", (self.greatest * 1e6).round() / 1e6)
            };
            let problem = format!("{few} within {limits}: {question}");
            return Err(ImportError::Problem { file: file.into(), problem });
        }
        // A value far beyond the range, always the same, is a driver's word for "no echo".
        let is_word = self.at_greatest.values().sum::<u64>() as f64 >= 0.9 * beyond as f64;
        if beyond as f64 >= MAX_BEYOND * all as f64 && !is_word {
            let is_likely = guess.is_some_and(|(_, greatest_m)| greatest_m > LIKELY * max_range_m);
            if is_likely && !is_unit_told && beyond as f64 >= MAX_BEYOND_OTHER * all as f64 {
                let percent = 100.0 * beyond as f64 / all as f64;
                let problem = format!(
                    "{beyond} of {all} readings ({percent:.0} %) lie beyond ring.max_range_m = {max_range_m}; greatest is {}: {question}; where they \
                     are metres: --range-unit m",
                    self.greatest
                );
                return Err(ImportError::Problem { file: file.into(), problem });
            }
            let hint = if is_likely { question } else { "is ring.max_range_m right?".into() };
            doubts.push(format!(
                "{beyond} of {all} readings are beyond ring.max_range_m = {max_range_m} and count as no echo; greatest is {}: {hint}",
                self.greatest
            ));
        }
        Ok(doubts)
    }

    /// The greatest unit in which nearly all readings are within the ring's range, and the greatest of them in metres.
    fn guess(&self) -> Option<(RangeUnit, f64)> {
        let named_m = self.unit.metres(self.sound_m_s);
        // Readings that were too small in the named unit are of a greater one, and too great ones of a smaller one.
        let is_small = self.greatest < self.max_range_m;
        let all = std::iter::once(Metres).chain(RangeUnit::OTHERS).filter(|unit| *unit != self.unit);
        all.into_iter().find_map(|unit| {
            let factor = unit.metres(self.sound_m_s) / named_m;
            let fits = |value: &&f64| {
                let metres = factor * **value;
                metres <= TOLERANCE * self.max_range_m
            };
            let fitting: Vec<&f64> = self.values.iter().filter(fits).collect();
            let far = fitting.iter().filter(|value| factor * ***value >= self.min_range_m).count();
            let greatest = fitting.iter().map(|value| **value).fold(0.0, f64::max);
            let are_fitting = fitting.len().min(far) as f64 >= FITS * self.values.len() as f64;
            let is_other = if is_small {
                self.unit != Metres && factor > 1.0
            } else {
                factor < 1.0 && self.greatest > self.max_range_m
            };
            (are_fitting && is_other).then_some((unit, factor * greatest))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOUND_M_S: f64 = 343.42;

    /// The verdict on ranges from 0.6 m to 2.95 m, of which each is so many of a unit, and on further ones.
    fn verdict_with(per_m: f64, further: &[f64]) -> Result<Vec<String>, String> {
        let mut readings = Readings::new(&Config::default(), Metres, SOUND_M_S);
        (0..400u32).for_each(|k| readings.add(3, (0.6 + 2.35 * f64::from(k) / 399.0) * per_m));
        [f64::INFINITY, f64::NAN].iter().chain(further).for_each(|reading| readings.add(4, *reading));
        readings.check("a.csv", false).map_err(|error| error.to_string())
    }

    fn verdict(per_m: f64) -> Result<Vec<String>, String> {
        verdict_with(per_m, &[])
    }

    #[test]
    fn other_units_are_refused_or_doubted() {
        assert_eq!(verdict(1.0), Ok(vec![]));
        for (per_m, unit) in [
            (10.0, "decimetres? --range-unit dm"),
            (39.37, "inches? --range-unit in"),
            (100.0, "centimetres? --range-unit cm"),
            (1000.0, "millimetres? --range-unit mm"),
        ] {
            let error = verdict(per_m).unwrap_err();
            assert!(error.contains("no reading of 400 lies within ring.max_range_m = 3; smallest is"), "{error}");
            assert!(error.contains(&format!(": {unit}")), "{error}");
            assert!(verdict_with(per_m, &[65_535.0, 65_535.0]).unwrap_err().contains(unit));
        }
        assert!(verdict(5831.0).unwrap_err().contains("microseconds"));
        assert!(verdict(0.001).unwrap_err().contains("ring.min_range_m"));
        let feet = verdict(3.281).unwrap_err();
        assert!(feet.contains("feet? --range-unit ft; where they are metres: --range-unit m"), "{feet}");
        assert!(verdict(1.5).unwrap()[0].contains("is ring.max_range_m right?"));
        assert_eq!(verdict_with(1.0, &[9.99; 300]), Ok(vec![]), "a word for no echo");
    }

    #[test]
    fn zeros_are_asked_about() {
        let doubts = verdict_with(1.0, &[0.0; 400]).unwrap();
        assert_eq!(doubts, ["400 readings (50 %) are 0, taken as too close; where 0 means no echo: --no-echo 0"]);
        assert_eq!(verdict_with(1.0, &[0.0; 3]), Ok(vec![]));
        let readings = Readings::new(&Config::default(), Metres, SOUND_M_S);
        assert!(readings.check("a.csv", false).unwrap()[0].contains("no sensor has measured"));
    }

    #[test]
    fn readings_clipped_below_the_greatest_range_are_no_echo() {
        let mut readings = Readings::new(&Config::default(), Metres, SOUND_M_S);
        for k in 0..400u32 {
            readings.add(3, 0.6 + 2.0 * f64::from(k) / 399.0);
            readings.add(k as usize % 6, if k % 4 == 0 { 2.95 } else { 1.0 });
        }
        let (from_m, sentence) = readings.clipped(12).unwrap();
        assert!(
            (from_m - 2.95).abs() < 1e-12 && sentence.contains("100 readings of 3 sensors are 2.95 m"),
            "{sentence}"
        );
        readings.add(0, 2.96);
        assert!(readings.clipped(12).is_none());
    }

    #[test]
    fn values_for_no_echo_and_units_are_converted() {
        let row = Row { line: 2, t_s: 0.0, ticks: [None; 2], readings: vec![0.0, 150.0, -1.0, f64::NAN] };
        let mut rows = vec![row];
        convert(&mut rows, Some(Centimetres), &[0.0, -1.0], SOUND_M_S);
        let readings = &rows[0].readings;
        assert!(readings[0].is_infinite() && readings[2].is_infinite() && readings[3].is_nan());
        assert!((readings[1] - 1.5).abs() < 1e-12);
        assert_eq!("cm".parse(), Ok(Centimetres));
        assert!("yd".parse::<RangeUnit>().is_err());
    }
}
