//! Rows in the order of their times, and at times of their own.

use super::rows::Row;

/// Brings rows of several sources into the order of their times, where they are late by less than a second.
pub(super) fn sort(rows: &mut [Row]) {
    for index in 1..rows.len() {
        let mut at = index;
        while let Some([before, row]) = at.checked_sub(1).and_then(|before| rows.get_mut(before..=at)) {
            if index - at >= MAX_BACK {
                break;
            }
            if !(0.0..MAX_LATE_S).contains(&(before.t_s - row.t_s)) || before.t_s.total_cmp(&row.t_s).is_eq() {
                break;
            }
            std::mem::swap(before, row);
            at -= 1;
        }
    }
}

/// Puts rows that are late by less than a second 1 ms behind their predecessor: a log's lines are in the order of acquisition. Returns
/// how many.
pub(super) fn clamp(rows: &mut [Row]) -> u64 {
    let (mut clamped, mut last_s) = (0, f64::NEG_INFINITY);
    for row in rows {
        if (0.0..MAX_LATE_S).contains(&(last_s - row.t_s)) && row.t_s < last_s {
            row.t_s = last_s + 1e-3;
            clamped += 1;
        }
        last_s = row.t_s;
    }
    clamped
}

const MAX_LATE_S: f64 = 1.0;
/// A row moves forward by at most so many rows: more than a second of any bag has, and the work stays in proportion to the rows.
const MAX_BACK: usize = 10_000;

/// Stamps of a clock that counts whole seconds: rows of one stamp are spread to the next. Returns what was done.
pub(super) fn spread_equal(rows: &mut [Row]) -> Option<String> {
    let times: Vec<f64> = rows.iter().map(|row| row.t_s).collect();
    let equal = times.windows(2).filter(|pair| matches!(pair, [a, b] if a.total_cmp(b).is_eq())).count();
    if rows.len() < 4 || 2 * equal < rows.len() {
        return None;
    }
    let mut begin = 0;
    while let Some(&at_s) = times.get(begin) {
        let count = times.iter().skip(begin).take_while(|time| time.total_cmp(&at_s).is_eq()).count();
        let next_s =
            times.get(begin + count).copied().filter(|next_s| *next_s > at_s && *next_s - at_s <= MAX_SPREAD_S);
        if let Some(next_s) = next_s {
            for (place, row) in (0u32..).zip(rows.iter_mut().skip(begin).take(count)) {
                row.t_s = at_s + (next_s - at_s) * f64::from(place) / count as f64;
            }
        }
        begin += count.max(1);
    }
    Some(format!("{equal} rows have the time of the row before; rows of one stamp are spread evenly to the next"))
}

/// Rows of one stamp are not spread over more.
const MAX_SPREAD_S: f64 = 4.0;

/// Half of the steps between rows are shorter, seconds.
pub(super) fn typical_step_s(rows: &[Row]) -> f64 {
    let steps = rows.windows(2).filter_map(|pair| Some(pair.last()?.t_s - pair.first()?.t_s));
    let mut steps: Vec<f64> = steps.filter(|step_s| *step_s > 0.0 && step_s.is_finite()).collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied().unwrap_or(0.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drive(stamp: impl Fn(u32) -> f64) -> Vec<Row> {
        (0..100).map(|k| Row { line: k as usize + 2, t_s: stamp(k), ticks: [None; 2], readings: Vec::new() }).collect()
    }

    fn right(k: u32) -> f64 {
        0.1 * f64::from(k)
    }

    #[test]
    fn whole_seconds_are_spread() {
        let mut rows = drive(|k| (right(k) + 1e-9).floor());
        assert!(spread_equal(&mut rows).unwrap().contains("spread evenly"));
        for (k, row) in (0..90).zip(&rows) {
            assert!((row.t_s - right(k)).abs() < 1e-9, "{k}: {}", row.t_s);
        }
        assert_eq!(spread_equal(&mut drive(right)), None);
    }

    #[test]
    fn rows_that_are_late_are_sorted() {
        let mut rows =
            drive(|k| right(if k % 7 == 0 && k > 0 { k - 2 } else { k }) + if k >= 50 { -20.0 } else { 0.0 });
        sort(&mut rows);
        let back = rows.windows(2).filter(|pair| pair[1].t_s < pair[0].t_s).count();
        assert_eq!(back, 1, "a step of the clock stays");
    }
}
