//! Units that change within a recording: one sensor counts centimetres where the others have metres, or all do from a row on.

use super::ImportError;
use super::rows::Row;

/// Factors between units that a driver mixes up, greater than any difference between rooms: decimetres or millimetres and centimetres,
/// inches, centimetres, millimetres.
const FACTORS: [f64; 4] = [10.0, 39.37, 100.0, 1000.0];
/// So many readings tell the unit of a sensor or of a block of rows.
const MIN_READINGS: usize = 50;
/// Share of readings within the ring's range in the right unit, and in a wrong one.
const RIGHT: f64 = 0.9;
const WRONG: f64 = 0.05;
/// Share of readings within the ring's range that makes the others the right ones.
const OTHERS: f64 = 0.5;
/// A sensor that always reads about the same value has a word for "nothing", not a unit.
const MIN_SPREAD: f64 = 1.1;
/// Echoes may be this much farther than configured.
const TOLERANCE: f64 = 1.05;

/// The range of the ring, metres.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    pub(super) min_m: f64,
    pub(super) max_m: f64,
}

impl Limits {
    fn hold(self, range_m: f64) -> bool {
        (self.min_m..=TOLERANCE * self.max_m).contains(&range_m)
    }

    /// Share of the values that lie within, times a factor.
    fn share(self, values: &[f64], factor: f64) -> f64 {
        values.iter().filter(|value| self.hold(factor * **value)).count() as f64 / values.len().max(1) as f64
    }

    /// How many times the right values these are, where they are in another unit than metres; right values are about `typical_m`.
    fn factor(self, values: &[f64], typical_m: f64) -> Option<f64> {
        let (least, most) =
            values.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), value| (a.min(*value), b.max(*value)));
        if values.len() < MIN_READINGS || self.share(values, 1.0) > WRONG || most < MIN_SPREAD * least {
            return None;
        }
        let all = FACTORS.into_iter().chain(FACTORS.map(f64::recip));
        let fits = all.filter(|factor| self.share(values, factor.recip()) >= RIGHT);
        let off = |factor: &f64| libm::log(median(values) / typical_m / factor).abs();
        fits.min_by(|a, b| off(a).total_cmp(&off(b)))
    }
}

/// The middle value.
fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
}

fn finite(rows: &[Row], sensor: Option<usize>) -> Vec<f64> {
    let of_row = |row: &Row| -> Vec<f64> {
        let readings = row.readings.iter().enumerate();
        let wanted = readings.filter(|(index, _)| sensor.is_none_or(|sensor| sensor == *index));
        wanted.map(|(_, reading)| *reading).filter(|reading| reading.is_finite() && *reading > 0.0).collect()
    };
    rows.iter().flat_map(of_row).collect()
}

/// Leaves the readings of sensors out that are in another unit than the others'. What was left out, one sentence each.
///
/// # Errors
/// Where all readings are in another unit from a row on.
pub(super) fn check(rows: &mut [Row], limits: Limits, file: &str) -> Result<Vec<String>, ImportError> {
    let mut doubts = Vec::new();
    let all = finite(rows, None);
    if limits.share(&all, 1.0) < OTHERS / 2.0 {
        // The whole recording is in another unit, which is said elsewhere.
        return Ok(doubts);
    }
    let within: Vec<f64> = all.into_iter().filter(|value| limits.hold(*value)).collect();
    let typical_m = median(&within);
    let sensors = rows.first().map_or(0, |row| row.readings.len());
    for sensor in 0..sensors {
        if let Some(factor) = limits.factor(&finite(rows, Some(sensor)), typical_m) {
            rows.iter_mut().filter_map(|row| row.readings.get_mut(sensor)).for_each(|reading| *reading = f64::NAN);
            doubts.push(format!(
                "sensor {sensor} reads about {} the others: another unit; its readings are left out: correct its column",
                times(factor)
            ));
        }
    }
    if let Some((line, factor, is_end)) = change(rows, limits, typical_m) {
        let part = if is_end { "from here on" } else { "up to here" };
        let problem = format!(
            "line {line}: {part} the ranges are about {} the other ones: the unit changes; split the recording there, and import each part \
             with its --range-unit",
            times(factor)
        );
        return Err(ImportError::Problem { file: file.into(), problem });
    }
    Ok(doubts)
}

fn times(factor: f64) -> String {
    if factor > 1.0 { format!("{factor:.0} times") } else { format!("1/{:.0} of", factor.recip()) }
}

/// The row at which the unit changes: its line, the factor, and whether the end, or the beginning, is in another unit than metres.
fn change(rows: &[Row], limits: Limits, typical_m: f64) -> Option<(usize, f64, bool)> {
    let per_row = rows.first()?.readings.len().max(1);
    let size = (4 * MIN_READINGS).div_ceil(per_row).max(2);
    let factors: Vec<Option<f64>> =
        rows.chunks(size).map(|rows| limits.factor(&finite(rows, None), typical_m)).collect();
    let foreign = factors.iter().position(Option::is_some)?;
    let factor = factors.get(foreign).copied().flatten()?;
    let is_right = |rows: &[Row]| limits.share(&finite(rows, None), 1.0) > OTHERS;
    if !rows.chunks(size).any(is_right) {
        return None;
    }
    let is_wrong = |row: &&Row| {
        let values = finite(std::slice::from_ref(*row), None);
        !values.is_empty() && limits.share(&values, 1.0) < OTHERS
    };
    let is_end = foreign > 0;
    let row = if is_end {
        // The block before may hold the first of them.
        let before =
            rows.get((foreign - 1) * size..(foreign + 1) * size).or_else(|| rows.get((foreign - 1) * size..))?;
        let wrong =
            before.iter().rev().take_while(|row| is_wrong(row) || finite(std::slice::from_ref(*row), None).is_empty());
        wrong.last()?
    } else {
        rows.iter().take_while(is_wrong).last()?
    };
    Some((row.line, factor, is_end))
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits { min_m: 0.02, max_m: 3.0 };

    fn rows(unit: impl Fn(usize, usize) -> f64) -> Vec<Row> {
        let row = |index: usize| {
            let range = |sensor: usize| unit(index, sensor) * (0.5 + 0.2 * sensor as f64 + 0.002 * index as f64);
            Row { line: index + 2, t_s: 0.1 * index as f64, ticks: [Some(0); 2], readings: (0..8).map(range).collect() }
        };
        (0..400).map(row).collect()
    }

    #[test]
    fn one_sensor_in_another_unit_is_left_out_and_named() {
        let mut mixed = rows(|_, sensor| if sensor == 3 { 100.0 } else { 1.0 });
        let doubts = check(&mut mixed, LIMITS, "a.csv").unwrap();
        assert!(doubts[0].starts_with("sensor 3 reads about 100 times the others"), "{doubts:?}");
        assert!(mixed.iter().all(|row| row.readings[3].is_nan() && row.readings[2].is_finite()));
        assert_eq!(check(&mut rows(|_, _| 1.0), LIMITS, "a.csv").unwrap(), [""; 0]);
        // A driver's word for nothing is no unit.
        let mut word = rows(|_, _| 1.0);
        word.iter_mut().for_each(|row| row.readings[5] = 65.535);
        assert_eq!(check(&mut word, LIMITS, "a.csv").unwrap(), [""; 0]);
    }

    #[test]
    fn a_unit_that_changes_names_its_row() {
        let error =
            |unit: fn(usize) -> f64| check(&mut rows(|row, _| unit(row)), LIMITS, "a.csv").unwrap_err().to_string();
        let text = error(|row| if row < 250 { 1.0 } else { 100.0 });
        assert!(text.starts_with("a.csv: line 252: from here on the ranges are about 100 times"), "{text}");
        let text = error(|row| if row < 250 { 0.001 } else { 1.0 });
        assert!(text.contains("up to here the ranges are about 1/"), "{text}");
    }
}
