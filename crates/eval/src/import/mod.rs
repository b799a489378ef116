//! Real recordings → captures of ordinary frames, as if a board had sent them.
//!
//! Each capture begins with HELLO, GEOMETRY and one STATUS; then every row of the recording becomes a SONAR per firing group.
//! Board time equals host time. Ranges become times of flight at the configured temperature, which the STATUS repeats, so that
//! they come back within 0.1 mm.

#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing, clippy::string_slice)]
#![deny(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)]
#![deny(clippy::allow_attributes, clippy::allow_attributes_without_reason)]

pub mod bag;
mod broken;
pub mod carmen;
mod cells;
mod column_names;
mod columns;
mod counts;
mod cut_end;
mod dates;
mod drive;
mod encoder_columns;
mod header;
mod mixed_units;
mod monitor_log;
mod order;
mod pile;
mod ranges;
mod recorder;
pub mod ring;
mod rows;
mod sequence;
mod stamps;
mod table;
mod text;
mod tick_cells;
mod ticks;
mod times;
mod wheel_check;

pub use carmen::Scan;
pub use columns::Columns;
pub use counts::Counting;
pub use drive::Drive;
pub use ranges::RangeUnit;
pub use recorder::Summary;
pub use ticks::WheelTicks;
pub use times::TimeUnit;

use slamd_capture::CaptureError;
use std::io;
use std::str::FromStr;

/// A recording that cannot be imported.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// The recording cannot be read.
    #[error("{file}: {source}")]
    Io {
        /// The recording.
        file: String,
        /// What the system says.
        source: io::Error,
    },
    /// A line that does not say what it should.
    #[error("{file}: line {line}, column {column}: `{found}`: expected {expected}")]
    Line {
        /// The recording.
        file: String,
        /// From 1.
        line: usize,
        /// The field in the line, from 1.
        column: usize,
        /// The field as it stands.
        found: String,
        /// What it should be.
        expected: String,
    },
    /// The recording holds no row.
    #[error("{file}: nothing to import: expected {expected}")]
    Empty {
        /// The recording.
        file: String,
        /// What it should hold.
        expected: &'static str,
    },
    /// The recording as a whole is not what it should be.
    #[error("{file}: {problem}")]
    Problem {
        /// The recording.
        file: String,
        /// What is wrong, and what to do.
        problem: String,
    },
    /// Another kind of file.
    #[error("{file} is {what}")]
    Foreign {
        /// The recording.
        file: String,
        /// What it is, and what to do.
        what: &'static str,
    },
    /// The configuration lacks what a recording does not say.
    #[error("the configuration must give {0}: a recording does not say it")]
    Config(&'static str),
    /// The capture cannot be written.
    #[error(transparent)]
    Capture(#[from] CaptureError),
}

/// What the user knows of a recording.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// What the columns of a CSV hold.
    pub columns: Option<Columns>,
    /// The unit of the ranges; metres if none is given.
    pub range_unit: Option<RangeUnit>,
    /// The unit of the stamps; seconds if none is given.
    pub time_unit: Option<TimeUnit>,
    /// Readings that mean "no echo".
    pub no_echo: Vec<f64>,
    /// The same as texts that are no numbers, such as `NULL`, of a CSV.
    pub no_echo_words: Vec<String>,
    /// How the encoders count; found out if none is given.
    pub counting: Option<Counting>,
    /// The run to import, from 1, where the recording has several.
    pub run: Option<usize>,
    /// The kind of ranges in a CARMEN log that has several.
    pub scan: Option<Scan>,
}

/// One line of a recording, for errors that say where.
#[derive(Clone, Copy)]
struct SourceLine<'a> {
    file: &'a str,
    number: usize,
}

impl SourceLine<'_> {
    /// The field at `column`, from 0, as a value.
    fn value<T: FromStr>(self, fields: &[impl AsRef<str>], column: usize, expected: &str) -> Result<T, ImportError> {
        let field = fields.get(column).map(AsRef::as_ref).unwrap_or_default().trim();
        field.parse().map_err(|_| self.error(field, column, expected))
    }

    /// The field at `column`, from 0, as a finite number.
    fn number(self, fields: &[impl AsRef<str>], column: usize, expected: &str) -> Result<f64, ImportError> {
        let value: f64 = self.value(fields, column, expected)?;
        if value.is_finite() { Ok(value) } else { Err(self.error(&value.to_string(), column, expected)) }
    }

    fn error(self, found: &str, column: usize, expected: &str) -> ImportError {
        ImportError::Line {
            file: self.file.into(),
            line: self.number,
            column: column + 1,
            found: found.into(),
            expected: expected.into(),
        }
    }
}
