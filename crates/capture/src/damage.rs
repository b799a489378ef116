//! What is wrong with a capture.

use mcap::McapError;
use slamd_core::Timestamp;

/// What is missing in a file.
#[derive(Default)]
pub(super) struct Holes {
    count: u32,
    /// The last sound record before the first damage, and what the damage is.
    first: Option<(Timestamp, String)>,
    /// Nothing was found behind the last damage.
    pub(super) has_no_end: bool,
    /// The end is missing.
    pub(super) is_cut: bool,
}

impl Holes {
    pub(super) fn add(&mut self, after: Timestamp, what: &str) {
        self.count += 1;
        self.first.get_or_insert_with(|| (after, what.into()));
    }

    /// True if something is missing before the end.
    pub(super) const fn are_there(&self) -> bool {
        self.count > 0
    }

    /// In words; none if nothing is missing. `last` is the time of the last record.
    pub(super) fn described(&self, last: Timestamp) -> Option<String> {
        let Self { count, first, has_no_end, is_cut } = self;
        let mut parts = Vec::new();
        if let Some((after, what)) = first {
            let places = if *count == 1 { String::new() } else { format!(" and in {} more places", count - 1) };
            let rest =
                if *has_no_end { "nothing after the last damage was read" } else { "all other chunks were read" };
            parts.push(format!(
                "the file is damaged after {:.3} s ({what}){places}; the damaged chunks are missing, and {rest}",
                after.seconds()
            ));
        }
        if *is_cut {
            parts.push(format!(
                "the file was not finished: it holds everything up to {:.3} s, and what was recorded after that \
                 (0.1 s where the recorder was killed) is missing",
                last.seconds()
            ));
        }
        (!parts.is_empty()).then(|| parts.join("; "))
    }
}

/// Why a record cannot be used.
pub(super) enum Damage {
    /// The file ends within it.
    End,
    Other(String),
}

impl From<McapError> for Damage {
    fn from(error: McapError) -> Self {
        match error {
            McapError::UnexpectedEof => Self::End,
            McapError::Io(source) => Self::Other(source.to_string()),
            other => Self::Other(other.to_string()),
        }
    }
}
