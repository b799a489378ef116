//! Cells of ranges as recordings have them: numbers, also with their unit, and texts that mean "no echo". What is met of them and of the
//! encoders' cells while rows are read.

use super::ranges::RangeUnit;
use super::rows::{Filler, Row};
use super::{ImportError, SourceLine};

/// Longer texts are no marks.
const MAX_WORD: usize = 24;
pub(super) const READING: &str = "metres, at least 0, `inf` for no echo, or nothing or `nan` for no measurement";
/// The word of `--no-echo` for cells without anything.
const EMPTY: &str = "empty";

/// How cells of ranges are read, and what was met in them.
#[derive(Clone, Debug, Default)]
pub(super) struct Cells<'a> {
    /// Texts that mean "no echo".
    pub(super) no_echo: &'a [String],
    /// How many metres a plain number stands for.
    pub(super) unit_m: f64,
    pub(super) sound_m_s: f64,
    /// The first cell with a unit, and its line.
    pub(super) with_unit: Option<(usize, String)>,
    /// The first hexadecimal count, and its line.
    pub(super) hexadecimal: Option<(usize, String)>,
}

impl Cells<'_> {
    /// The reading in a cell, in the unit of plain numbers.
    ///
    /// # Errors
    /// If it is none. A text may mean that there was no echo.
    pub(super) fn reading(
        &mut self,
        line: SourceLine<'_>,
        fields: &[String],
        column: usize,
    ) -> Result<f64, ImportError> {
        let cell = fields.get(column).map(String::as_str).unwrap_or_default();
        if self.no_echo.iter().any(|word| word.eq_ignore_ascii_case(cell)) {
            return Ok(f64::INFINITY);
        }
        if let Some((value, unit)) = with_unit(cell) {
            self.with_unit.get_or_insert_with(|| (line.number, cell.to_owned()));
            return Ok(value * unit.metres(self.sound_m_s) / self.unit_m);
        }
        line.value(fields, column, READING).map_err(|error| {
            if !is_mark(cell) {
                return error;
            }
            let word = if cell.chars().all(|c| c.is_alphanumeric() || "_-/.".contains(c)) {
                cell.to_owned()
            } else {
                format!("'{cell}'")
            };
            line.error(cell, column, &format!("{READING}; where it means no echo: {}", no_echo(&word)))
        })
    }

    /// True if cells without anything mean "no echo".
    pub(super) fn is_empty_no_echo(&self) -> bool {
        self.no_echo.iter().any(|word| word.is_empty() || word.eq_ignore_ascii_case(EMPTY))
    }
}

/// The option for a value that means "no echo". A sign in front of it would be another option.
pub(super) fn no_echo(value: &str) -> String {
    let is_sign = value.starts_with('-') && !value.parse::<f64>().is_ok_and(f64::is_finite);
    format!("--no-echo{}{value}", if is_sign { "=" } else { " " })
}

/// A number with its unit, such as `101 cm` or `1.01m`.
fn with_unit(cell: &str) -> Option<(f64, RangeUnit)> {
    let at = cell.rfind(|character: char| character.is_ascii_digit() || character == '.')? + 1;
    let (number, unit) = cell.split_at_checked(at)?;
    let unit = match unit.trim().trim_end_matches('.').to_lowercase().as_str() {
        "\"" | "inch" | "inches" => RangeUnit::Inches,
        "us" | "µs" => RangeUnit::Microseconds,
        other if !other.is_empty() => other.parse().ok()?,
        _ => return None,
    };
    Some((number.trim().parse().ok().filter(|value: &f64| value.is_finite())?, unit))
}

/// True for a text that stands for something: words, signs alone, or `>400`.
fn is_mark(cell: &str) -> bool {
    let has_digit = cell.chars().any(|character| character.is_ascii_digit());
    let is_beyond = cell.starts_with('>') && cell.trim_start_matches(['>', '=', ' ']).parse::<f64>().is_ok();
    let is_text = !has_digit && cell.chars().all(|c| c.is_alphabetic() || "_-/ .*!?<>()".contains(c));
    !cell.is_empty() && cell.len() <= MAX_WORD && (is_text || is_beyond)
}

/// From this share of missing readings on it is asked what they mean.
const MAX_MISSING: f64 = 0.01;

/// Asks what empty cells mean, where rows are nearly full: there they are no sensors that have not fired yet.
pub(super) fn missing(rows: &[Row]) -> Option<String> {
    let mut seen = vec![0_u64; rows.first()?.readings.len()];
    let with_readings = || rows.iter().filter(|row| row.readings.iter().any(|reading| !reading.is_nan()));
    for row in with_readings() {
        seen.iter_mut().zip(&row.readings).for_each(|(seen, reading)| *seen += u64::from(!reading.is_nan()));
    }
    let count = with_readings().count() as u64;
    // A sensor that never measures is not there.
    let (missing, cells) = seen
        .iter()
        .filter(|seen| **seen > 0)
        .fold((0, 0), |(missing, cells), seen| (missing + count - seen, cells + count));
    if (missing as f64) < MAX_MISSING * cells as f64 || missing == 0 || Filler::find(rows).is_some() {
        return None;
    }
    let percent = 100.0 * missing as f64 / cells as f64;
    Some(format!(
        "{missing} cells of ranges ({percent:.0} %) are empty or nan, taken as no measurement; where they mean no echo: --no-echo {} --no-echo nan",
        EMPTY
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(cell: &str, no_echo: &[&str], unit_m: f64) -> Result<f64, String> {
        let words: Vec<String> = no_echo.iter().map(ToString::to_string).collect();
        let mut cells = Cells { no_echo: &words, unit_m, sound_m_s: 340.0, ..Cells::default() };
        let line = SourceLine { file: "a.csv", number: 3 };
        cells.reading(line, &[cell.to_owned()], 0).map_err(|error| error.to_string())
    }

    #[test]
    fn numbers_with_their_unit_are_metres() {
        for (cell, metres) in
            [("101 cm", 1.01), ("101cm", 1.01), ("1010 mm", 1.01), ("1.01m", 1.01), ("40 in", 1.016), ("10000us", 1.7)]
        {
            assert!((read(cell, &[], 1.0).unwrap() - metres).abs() < 1e-9, "{cell}");
            assert!((0.01 * read(cell, &[], 0.01).unwrap() - metres).abs() < 1e-9, "{cell} beside centimetres");
        }
        assert!(read("12 apples", &[], 1.0).is_err() && read("1.2.3 cm", &[], 1.0).is_err());
    }

    #[test]
    fn a_text_may_mean_no_echo() {
        assert_eq!(read("null", &["NULL"], 1.0), Ok(f64::INFINITY));
        for (cell, option) in [
            ("NULL", "--no-echo NULL"),
            ("OUT OF RANGE", "--no-echo 'OUT OF RANGE'"),
            (">4.0", "--no-echo '>4.0'"),
            ("---", "--no-echo=---"),
            ("***", "--no-echo '***'"),
        ] {
            let error = read(cell, &["none"], 1.0).unwrap_err();
            assert!(error.ends_with(&format!("where it means no echo: {option}")), "{error}");
            assert!(error.starts_with(&format!("a.csv: line 3, column 1: `{cell}`: expected metres")), "{error}");
        }
        assert!(!read("0.6#8", &[], 1.0).unwrap_err().contains("--no-echo"));
    }
}
