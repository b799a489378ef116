//! The unit of a recording's stamps.

use super::ImportError;
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

/// What is doubtful of rows that are so far apart, where the stamps are seconds.
///
/// # Errors
/// Where they cannot be seconds.
pub(super) fn check(step_s: f64, file: &str) -> Result<Option<String>, ImportError> {
    let other =
        [Milliseconds, Microseconds, Nanoseconds].into_iter().find(|unit| step_s * unit.seconds() <= LONG_STEP_S);
    let [name, word] = other.unwrap_or(Nanoseconds).words();
    let question = format!("rows are {step_s:.0} s apart: is t_s in {name}? --time-unit {word}");
    if step_s >= MAX_STEP_S {
        return Err(ImportError::Problem { file: file.into(), problem: question });
    }
    Ok((step_s >= LONG_STEP_S).then_some(question))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_that_are_no_seconds_are_refused_with_their_unit() {
        let error = |step_s| check(step_s, "a.csv").unwrap_err().to_string();
        assert_eq!(check(1.0, "a.csv").unwrap(), None);
        assert!(check(6.0, "a.csv").unwrap().unwrap().contains("rows are 6 s apart"));
        assert!(error(100.0).ends_with("rows are 100 s apart: is t_s in milliseconds? --time-unit ms"));
        assert!(error(1e5).contains("--time-unit us") && error(1e8).contains("--time-unit ns"));
        assert_eq!("us".parse(), Ok(Microseconds));
    }
}
