//! The order of the rows of a table: by time, reversed, or none.

use super::ImportError;
use super::rows::Row;

/// Fewer rows show no order.
const MIN_ROWS: usize = 8;
/// Share of the steps between rows that lead back in time, from which on the rows are not in order, or are reversed.
const MIXED: f64 = 0.1;
const REVERSED: f64 = 0.9;
/// Share of different times among all. A clock that starts anew again and again has the same times again.
const MIN_DIFFERENT: f64 = 0.9;

/// Refuses rows that are not in the order of their times: neither path nor counts would be right.
///
/// # Errors
/// If they are not.
pub(super) fn check(rows: &[Row], unit_s: f64, file: &str) -> Result<(), ImportError> {
    let times: Vec<(usize, f64)> =
        rows.iter().map(|row| (row.line, row.t_s)).filter(|(_, t_s)| t_s.is_finite()).collect();
    let back: Vec<(usize, f64)> = times
        .windows(2)
        .filter_map(|pair| match pair {
            [(_, before_s), (line, t_s)] if t_s < before_s => Some((*line, before_s - t_s)),
            _ => None,
        })
        .collect();
    let steps = times.len().saturating_sub(1) as f64;
    let mut sorted: Vec<f64> = times.iter().map(|(_, t_s)| *t_s).collect();
    sorted.sort_by(f64::total_cmp);
    let (Some((first_line, first_s)), Some((last_line, last_s))) = (times.first(), times.last()) else { return Ok(()) };
    let all = sorted.len();
    sorted.dedup();
    if all < MIN_ROWS || (back.len() as f64) < MIXED * steps {
        return Ok(());
    }
    let error = |problem: String| Err(ImportError::Problem { file: file.into(), problem });
    let [first, last] = [first_s / unit_s, last_s / unit_s];
    if back.len() as f64 >= REVERSED * steps && last_s < first_s {
        return error(format!(
            "the times run backwards, from {first} in line {first_line} to {last} in line {last_line}: the rows are in reverse order; sort them by \
             their time, the least first ({SORT})"
        ));
    }
    if (sorted.len() as f64) < MIN_DIFFERENT * all as f64 {
        return Ok(());
    }
    let line = back.first().map_or(0, |(line, _)| *line);
    error(format!(
        "line {line}: {} of {all} rows have an earlier time than the row before: the rows are not in the order of their times; sort them by time, \
         the least first ({SORT})",
        back.len()
    ))
}

/// Fewer stamps may be whole seconds by chance.
const MIN_NUMBERS: usize = 20;

/// Asks about stamps that are 0, 1, 2, ...: they may number the rows.
pub(super) fn numbers(rows: &[Row]) -> Option<String> {
    let is_next = |pair: &[Row]| matches!(pair, [a, b] if a.t_s.fract() == 0.0 && (b.t_s - a.t_s - 1.0).abs() < 1e-9);
    let [first, second] = [rows.first()?.t_s, rows.get(1)?.t_s];
    (rows.len() >= MIN_NUMBERS && rows.windows(2).all(is_next)).then(|| {
        format!("the stamps are {first}, {second}, ... and taken as seconds; if they number the rows, export the time of each row")
    })
}

/// How a table is sorted whose first column is the time.
const SORT: &str = "`(head -1 FILE; tail -n +2 FILE | sort -t, -k1,1g) > SORTED`, if the time is the first column";

#[cfg(test)]
mod tests {
    use super::*;

    fn checked(stamp: impl Fn(u32) -> f64) -> Result<(), String> {
        let row = |k: u32| Row { line: k as usize + 2, t_s: stamp(k), ticks: [None; 2], readings: Vec::new() };
        check(&(0..100).map(row).collect::<Vec<_>>(), 1.0, "a.csv").map_err(|error| error.to_string())
    }

    #[test]
    fn reversed_and_shuffled_rows_are_told_apart() {
        let text = checked(|k| f64::from(99 - k)).unwrap_err();
        assert!(text.starts_with("a.csv: the times run backwards, from 99 in line 2 to 0 in line 101: "), "{text}");
        let text = checked(|k| f64::from(k * 37 % 100)).unwrap_err();
        assert!(text.starts_with("a.csv: line 5: 36 of 100 rows have an earlier time"), "{text}");
        let text = checked(|k| f64::from(k ^ 1)).unwrap_err();
        assert!(text.starts_with("a.csv: line 3: 50 of 100 rows have an earlier time"), "{text}");
    }

    #[test]
    fn clocks_that_step_now_and_then_are_not_shuffled() {
        assert_eq!(checked(f64::from), Ok(()));
        assert_eq!(checked(|k| f64::from(k % 50)), Ok(()));
        assert_eq!(checked(|k| f64::from(k % 5)), Ok(()), "a clock that wraps");
        assert_eq!(checked(|k| if k % 20 == 7 { 0.0 } else { f64::from(k) }), Ok(()), "single wrong stamps");
    }

    #[test]
    fn stamps_that_may_number_the_rows_are_asked_about() {
        let rows = |step_s: f64| -> Vec<Row> {
            let row = |k: u32| Row { line: 2, t_s: step_s * f64::from(k), ticks: [None; 2], readings: Vec::new() };
            (0..30).map(row).collect()
        };
        assert!(numbers(&rows(1.0)).unwrap().starts_with("the stamps are 0, 1, ... and taken as seconds"));
        assert_eq!((numbers(&rows(0.5)), numbers(&rows(2.0)), numbers(&rows(1.0)[..9])), (None, None, None));
    }
}
