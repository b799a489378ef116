//! The unit of a recording's stamps.

use super::ImportError;
use super::rows::Row;
use super::sequence::typical_step_s;
use std::str::FromStr;

/// The unit of a recording's stamps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TimeUnit {
    /// Seconds.
    Seconds,
    /// Milliseconds.
    Milliseconds,
    /// Microseconds.
    Microseconds,
    /// Nanoseconds.
    Nanoseconds,
}

use TimeUnit::{Microseconds, Milliseconds, Nanoseconds, Seconds};

impl TimeUnit {
    const ALL: [Self; 4] = [Seconds, Milliseconds, Microseconds, Nanoseconds];

    const fn words(self) -> [&'static str; 2] {
        match self {
            Seconds => ["seconds", "s"],
            Milliseconds => ["milliseconds", "ms"],
            Microseconds => ["microseconds", "us"],
            Nanoseconds => ["nanoseconds", "ns"],
        }
    }

    /// Its word on the command line.
    pub(super) const fn word(self) -> &'static str {
        let [_, word] = self.words();
        word
    }

    /// How many seconds it is.
    pub(super) const fn seconds(self) -> f64 {
        match self {
            Seconds => 1.0,
            Milliseconds => 1e-3,
            Microseconds => 1e-6,
            Nanoseconds => 1e-9,
        }
    }
}

impl FromStr for TimeUnit {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut named = Self::ALL.into_iter().filter(|unit| unit.words().get(1) == Some(&text));
        named.next().ok_or_else(|| "it must be s, ms, us or ns".into())
    }
}

/// Rows of a sonar ring are closer, seconds.
const MAX_STEP_S: f64 = 20.0;
/// From here on it is asked.
const LONG_STEP_S: f64 = 5.0;
/// Rows are farther apart, seconds: an echo from 0.2 m takes longer.
const MIN_STEP_S: f64 = 1e-3;
/// Days since 1900 from 2009 to 2064, as spreadsheets store dates.
const SPREADSHEET_DAYS: std::ops::Range<f64> = 40_000.0..60_000.0;
/// Boards that write a cycle's rows at once make a pause after it: at least this share of the steps.
const MIN_PAUSES: f64 = 0.01;

/// What is doubtful of the rows' times, which `unit` has made seconds; none is taken as seconds.
///
/// # Errors
/// Where the stamps stand still, or cannot be of this unit.
pub(super) fn check(rows: &[Row], unit: Option<TimeUnit>, file: &str) -> Result<Option<String>, ImportError> {
    let [Some(first), Some(second)] = [0, 1].map(|index| rows.get(index)) else { return Ok(None) };
    let error = |problem| Err(ImportError::Problem { file: file.into(), problem });
    let unit_s = unit.map_or(1.0, TimeUnit::seconds);
    if rows.iter().all(|row| row.t_s.total_cmp(&first.t_s).is_eq()) {
        let stamp = if first.t_s.is_nan() { "no stamp".into() } else { format!("the stamp {}", first.t_s / unit_s) };
        let (line, count) = (first.line, rows.len());
        return error(format!(
            "line {line}: all {count} rows have {stamp}, so nothing says when they were measured; --columns t_s=NAME names the column of the time"
        ));
    }
    let step_s = typical_step_s(rows);
    let fits = |unit: &TimeUnit| (MIN_STEP_S..=LONG_STEP_S).contains(&(step_s / unit_s * unit.seconds()));
    let other = TimeUnit::ALL.into_iter().filter(|other| *other != unit.unwrap_or(Seconds)).find(fits);
    let question = |words: &str| match (other.map(TimeUnit::words), unit) {
        (Some([name, word]), None) => format!("{words}: is t_s in {name}? --time-unit {word}"),
        (Some([name, word]), Some(_)) => format!("{words}: are the stamps in {name}? --time-unit {word}"),
        (None, _) => format!("{words}: no unit fits; --columns t_s=NAME names the column of the time"),
    };
    let line = second.line;
    let at = unit.map_or_else(
        || format!("line {line}: "),
        |unit| format!("line {line}: with --time-unit {} ", unit.words().get(1).unwrap_or(&"")),
    );
    if is_too_short(rows) {
        if unit.is_none() && SPREADSHEET_DAYS.contains(&first.t_s) && SPREADSHEET_DAYS.contains(&(first.t_s + step_s)) {
            return error(format!(
                "{at}the stamps are a spreadsheet's days since 1900: give the column the format yyyy-mm-dd hh:mm:ss.000 before the export"
            ));
        }
        let step_ms = 1e3 * step_s;
        let digits = decimals(step_ms);
        return error(question(&format!("{at}rows are {step_ms:.digits$} ms apart")));
    }
    if step_s >= MAX_STEP_S {
        return error(question(&format!("{at}rows are {step_s:.0} s apart")));
    }
    let is_asked = step_s >= LONG_STEP_S && unit.is_none();
    Ok(is_asked.then(|| question(&format!("rows are {step_s:.0} s apart"))))
}

/// A step is a wrap if it differs by less: seconds, and a share of the wrap.
const NEAR_WRAP_S: f64 = 2.0;
const NEAR_WRAP: f64 = 0.005;
/// Counters that wrap, seconds, and why.
const WRAPS: [(f64, &str); 4] = [
    (4_294_967.296, "millis() wraps after 2^32 ms (49.7 days)"),
    (4_294.967_296, "micros() wraps after 2^32 us (71.6 minutes)"),
    (65.536, "a counter of milliseconds of 16 bits wraps after 65.5 s"),
    (86_400.0, "a time of day begins anew at midnight"),
];

/// Why a clock steps by so much.
pub(super) fn step(step_s: f64) -> String {
    let wrap = WRAPS.into_iter().find(|(wrap_s, _)| (step_s + wrap_s).abs() <= NEAR_WRAP_S.min(NEAR_WRAP * wrap_s));
    wrap.map_or_else(|| format!("the clock steps by {step_s:.2} s"), |(_, why)| why.to_owned())
}

/// True if nearly all rows are closer than any two echoes.
fn is_too_short(rows: &[Row]) -> bool {
    let steps = || rows.windows(2).filter_map(|pair| Some(pair.last()?.t_s - pair.first()?.t_s)).filter(|s| *s > 0.0);
    let long = steps().filter(|step_s| *step_s >= MIN_STEP_S).count();
    (long as f64) < MIN_PAUSES * steps().count() as f64
}

/// Digits after the point that show one that is not 0.
fn decimals(step_ms: f64) -> usize {
    let mut scaled = step_ms;
    (0..9)
        .take_while(|_| {
            scaled *= 10.0;
            scaled < 9.5
        })
        .count()
        .max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(step: f64, unit: Option<TimeUnit>) -> Vec<Row> {
        let unit_s = unit.map_or(1.0, TimeUnit::seconds);
        let row = |k: u32| Row {
            line: k as usize + 2,
            t_s: step * f64::from(k) * unit_s,
            ticks: [None; 2],
            readings: Vec::new(),
        };
        (0..100).map(row).collect()
    }

    fn said(step: f64, unit: Option<TimeUnit>) -> Result<Option<String>, String> {
        check(&rows(step, unit), unit, "a.csv").map_err(|error| error.to_string())
    }

    #[test]
    fn steps_that_are_no_seconds_are_refused_with_their_unit() {
        let error = |step_s| said(step_s, None).unwrap_err();
        assert_eq!(said(1.0, None), Ok(None));
        assert_eq!(said(6.0, None), Ok(Some("rows are 6 s apart: is t_s in milliseconds? --time-unit ms".into())));
        assert_eq!(error(100.0), "a.csv: line 3: rows are 100 s apart: is t_s in milliseconds? --time-unit ms");
        assert!(error(1e5).contains("--time-unit us") && error(1e8).contains("--time-unit ns"));
        assert!(error(1e-6).contains("line 3: rows are 0.001 ms apart: no unit fits"));
        assert_eq!("us".parse(), Ok(Microseconds));
    }

    #[test]
    fn a_unit_that_cannot_be_is_refused_with_file_line_and_option() {
        assert_eq!(
            said(0.1, Some(Milliseconds)).unwrap_err(),
            "a.csv: line 3: with --time-unit ms rows are 0.1 ms apart: are the stamps in seconds? --time-unit s"
        );
        assert_eq!(
            said(100.0, Some(Seconds)).unwrap_err(),
            "a.csv: line 3: with --time-unit s rows are 100 s apart: are the stamps in milliseconds? --time-unit ms"
        );
        assert!(said(1e5, Some(Nanoseconds)).unwrap_err().ends_with("--time-unit us"));
        for (step, unit) in
            [(0.1, Seconds), (6.0, Seconds), (100.0, Milliseconds), (5e3, Microseconds), (1e9, Nanoseconds)]
        {
            assert_eq!(said(step, Some(unit)), Ok(None));
        }
    }

    #[test]
    fn bursts_with_pauses_are_taken() {
        let mut bursts = rows(1e-4, None);
        bursts.iter_mut().enumerate().for_each(|(k, row)| row.t_s += 0.1 * (k / 16) as f64);
        assert_eq!(check(&bursts, None, "a.csv").unwrap(), None);
    }

    #[test]
    fn stamps_that_stand_still_are_refused() {
        for (stamp, words) in [(0.0, "the stamp 0"), (12.5, "the stamp 12.5"), (f64::NAN, "no stamp")] {
            let mut still = rows(0.1, None);
            still.iter_mut().for_each(|row| row.t_s = stamp);
            let error = check(&still, None, "a.csv").unwrap_err().to_string();
            assert!(error.starts_with(&format!("a.csv: line 2: all 100 rows have {words}, so")), "{error}");
            assert_eq!(check(&still[..1], None, "a.csv").unwrap(), None);
        }
    }

    #[test]
    fn days_of_a_spreadsheet_are_named() {
        let mut days = rows(0.1 / 86_400.0, None);
        days.iter_mut().for_each(|row| row.t_s += 46_143.5);
        let error = check(&days, None, "a.csv").unwrap_err().to_string();
        assert!(error.starts_with("a.csv: line 3: the stamps are a spreadsheet's days since 1900: give"), "{error}");
    }

    #[test]
    fn counters_that_wrap_are_named() {
        assert_eq!(step(-4_294_967.196), "millis() wraps after 2^32 ms (49.7 days)");
        assert_eq!(step(-4_294.9), "micros() wraps after 2^32 us (71.6 minutes)");
        assert_eq!(step(-86_399.9), "a time of day begins anew at midnight");
        assert_eq!(step(-65.5), "a counter of milliseconds of 16 bits wraps after 65.5 s");
        assert_eq!(step(-12.345), "the clock steps by -12.35 s");
    }
}
