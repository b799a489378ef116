//! Are the ranges metres? Readings that the ring cannot have had are those of another unit.

use super::ImportError;
use slamd_core::Config;

/// What a range may be given in instead, and how many metres it is.
const UNITS: [(&str, f64); 6] = [
    ("feet", 0.3048),
    ("decimetres", 0.1),
    ("inches", 0.0254),
    ("centimetres", 0.01),
    ("millimetres", 0.001),
    ("microseconds of flight, there and back", 1.715e-4),
];
/// With a smaller share of readings within the ring's range a recording is refused.
const MIN_WITHIN: f64 = 0.01;
/// From this share of readings beyond the ring's range on, a recording is doubtful.
const MAX_BEYOND: f64 = 0.1;
/// Echoes may be this much farther than configured.
const TOLERANCE: f64 = 1.05;

/// All readings of a recording, counted.
#[derive(Clone, Copy, Debug)]
pub(super) struct Readings {
    min_range_m: f64,
    max_range_m: f64,
    all: u64,
    within: u64,
    beyond: u64,
    smallest: f64,
    greatest: f64,
}

impl Readings {
    pub(super) fn new(config: &Config) -> Self {
        let (min_range_m, max_range_m) = (config.ring.min_range_m, config.ring.max_range_m);
        Self { min_range_m, max_range_m, all: 0, within: 0, beyond: 0, smallest: f64::INFINITY, greatest: 0.0 }
    }

    /// Takes a reading. Zero and infinity stand for no echo, NaN for no measurement.
    pub(super) fn add(&mut self, reading: f64) {
        if !reading.is_finite() || reading <= 0.0 {
            return;
        }
        self.all += 1;
        self.within += u64::from((self.min_range_m..=self.max_range_m).contains(&reading));
        self.beyond += u64::from(reading > self.max_range_m);
        (self.smallest, self.greatest) = (self.smallest.min(reading), self.greatest.max(reading));
    }

    /// What is doubtful of the readings; none if nothing is.
    ///
    /// # Errors
    /// If hardly any reading lies within the ring's range.
    pub(super) fn check(&self, file: &str) -> Result<Option<String>, ImportError> {
        let Self { all, within, beyond, smallest, greatest, min_range_m, max_range_m } = *self;
        if all == 0 {
            return Ok(Some("no sensor has measured a range: every cell is empty, `inf` or 0".into()));
        }
        let guess = self.guess();
        let question = guess.map_or_else(|| "another unit?".into(), |(unit, _)| format!("{unit}?"));
        if (within as f64) < MIN_WITHIN * all as f64 {
            let few = if within == 0 { "no reading".into() } else { format!("only {within} readings") };
            let limits = if beyond > 0 {
                format!("ring.max_range_m = {max_range_m}; smallest is {smallest}")
            } else {
                format!("ring.min_range_m = {min_range_m}; greatest is {greatest}")
            };
            let problem = format!("{few} of {all} lies within {limits}: {question} The ring CSV has metres");
            return Err(ImportError::Unit { file: file.into(), problem });
        }
        if (beyond as f64) < MAX_BEYOND * all as f64 {
            return Ok(None);
        }
        let hint = guess
            .filter(|(_, greatest_m)| *greatest_m > 0.9 * max_range_m)
            .map_or_else(|| "is ring.max_range_m right?".into(), |(unit, _)| format!("{unit}?"));
        Ok(Some(format!(
            "{beyond} of {all} readings are beyond ring.max_range_m = {max_range_m} and count as no echo; greatest is {greatest}: {hint}"
        )))
    }

    /// The unit in which the greatest reading is nearest to the ring's range, and how many metres it then is.
    fn guess(&self) -> Option<(&'static str, f64)> {
        let metres = UNITS.into_iter().map(|(unit, factor)| (unit, factor * self.greatest));
        metres
            .filter(|(_, greatest_m)| *greatest_m <= TOLERANCE * self.max_range_m && self.greatest > self.max_range_m)
            .max_by(|a, b| a.1.total_cmp(&b.1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The verdict on ranges from 0.6 m to 2.95 m, of which each is so many of a unit.
    fn verdict(per_m: f64) -> Result<Option<String>, String> {
        let mut readings = Readings::new(&Config::default());
        (0..400u32).for_each(|k| readings.add((0.6 + 2.35 * f64::from(k) / 399.0) * per_m));
        [0.0, f64::INFINITY, f64::NAN].into_iter().for_each(|reading| readings.add(reading));
        readings.check("a.csv").map_err(|error| error.to_string())
    }

    #[test]
    fn other_units_are_refused_or_doubted() {
        assert_eq!(verdict(1.0), Ok(None));
        for (per_m, unit) in [(10.0, "decimetres"), (39.37, "inches"), (100.0, "centimetres"), (1000.0, "millimetres")]
        {
            let error = verdict(per_m).unwrap_err();
            assert!(error.contains("no reading of 400 lies within ring.max_range_m = 3; smallest is"), "{error}");
            assert!(error.contains(&format!(": {unit}?")), "{error}");
        }
        assert!(verdict(5831.0).unwrap_err().contains("microseconds"));
        assert!(verdict(0.001).unwrap_err().contains("ring.min_range_m"));
        assert!(verdict(3.281).unwrap().unwrap().contains("feet?"));
        assert!(verdict(1.5).unwrap().unwrap().contains("is ring.max_range_m right?"));
    }

    #[test]
    fn readings_without_a_range_are_doubtful() {
        let readings = Readings::new(&Config::default());
        assert!(readings.check("a.csv").unwrap().unwrap().contains("no sensor has measured"));
    }
}
