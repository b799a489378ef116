//! Errors of a configuration, with their origin.

use std::fmt;

/// Where a value was written.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Origin {
    /// A line, from 1, of a text without a name.
    Line(usize),
    /// A line, from 1, of a file.
    File(String, usize),
    /// An environment variable or a command line option.
    Named(String),
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(line) => write!(f, "line {line}"),
            Self::File(name, line) => write!(f, "{name}:{line}"),
            Self::Named(name) => f.write_str(name),
        }
    }
}

/// One error.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, thiserror::Error)]
#[error("{origin}: {words}")]
pub struct Problem {
    /// Where it is.
    pub origin: Origin,
    /// The key, the value, and what is allowed.
    pub words: String,
}

/// A configuration that cannot be used: all its errors, up to a limit.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub struct ConfigError {
    /// In the order of the layers, and of the lines in each.
    pub problems: Vec<Problem>,
}

impl fmt::Display for ConfigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.problems.as_slice() {
            [only] => write!(f, "{only}"),
            many => {
                write!(f, "{} errors", many.len())?;
                many.iter().try_for_each(|problem| write!(f, "\n  {problem}"))
            }
        }
    }
}
