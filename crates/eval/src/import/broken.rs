//! Lines that cannot be read: left out, counted and named, as long as they are few.

use super::ImportError;
use super::table::excerpt;
use std::collections::BTreeMap;

/// A recording of which more rows are broken is refused: a loose wire or a full card breaks a few, a misread format breaks most.
const MAX_SHARE: f64 = 0.1;
/// A text that stands in so many rows is no damage but has a meaning.
const MAX_ALIKE: u32 = 2;
/// So many lines are listed.
const MAX_LISTED: usize = 5;

/// What was left out.
#[derive(Debug, Default)]
pub(super) struct Broken {
    errors: Vec<ImportError>,
    count: usize,
    /// How often a text that is no number was found, and where first.
    alike: BTreeMap<String, (u32, usize)>,
    /// Lines of text between the rows, and the first of them.
    texts: usize,
    first_text: Option<(usize, String)>,
}

impl Broken {
    /// A row that cannot be read.
    pub(super) fn row(&mut self, error: ImportError) {
        self.count += 1;
        let index = self.errors.len();
        if let ImportError::Line { found, .. } = &error
            && found.parse::<f64>().is_err()
            && !found.is_empty()
        {
            let seen = self.alike.entry(found.clone()).or_insert((0, index));
            seen.0 += 1;
        }
        // The first ones are named; a text that is found often was found among the first ones.
        if index < MAX_KEPT {
            self.errors.push(error);
        }
    }

    /// A line that is no row at all, such as what a board prints when it starts.
    pub(super) fn text(&mut self, line: usize, text: &str) {
        self.texts += 1;
        self.first_text.get_or_insert_with(|| (line, excerpt(text)));
    }

    /// What was left out of a recording with so many good rows, one sentence each.
    ///
    /// # Errors
    /// The first broken row, where no row is good or too many are broken; one whose text stands in several rows.
    pub(super) fn end(mut self, rows: usize) -> Result<Vec<String>, ImportError> {
        let habit = self.alike.values().find(|(times, _)| *times > MAX_ALIKE).map(|(_, index)| *index);
        if let Some(index) = habit.filter(|index| *index < self.errors.len()) {
            return Err(self.errors.swap_remove(index));
        }
        let all = rows + self.count;
        let mut remarks = Vec::new();
        if let Some(first) = self.errors.first() {
            if self.count as f64 > MAX_SHARE * all as f64 {
                return Err(if self.count < 3 { self.errors.swap_remove(0) } else { many(first, self.count, all) });
            }
            let lines: Vec<String> = self.errors.iter().take(MAX_LISTED).map(|error| line(error).to_string()).collect();
            let more = if self.count > lines.len() { ", ..." } else { "" };
            let (rows, lines) = (if self.count == 1 { "row is" } else { "rows are" }, lines.join(", "));
            remarks.push(format!("{} broken {rows} left out (line {lines}{more}): {}", self.count, reason(first)));
        }
        if let Some((line, text)) = self.first_text {
            let rows = if self.texts == 1 { "line is no row and left out" } else { "lines are no rows and left out" };
            remarks.push(format!("{} {rows}; the first is line {line}: `{text}`", self.texts));
        }
        Ok(remarks)
    }
}

/// Errors that are kept.
const MAX_KEPT: usize = 1_000;

const fn line(error: &ImportError) -> usize {
    match error {
        ImportError::Line { line, .. } => *line,
        _ => 0,
    }
}

/// The error without the file's name.
fn reason(error: &ImportError) -> String {
    match error {
        ImportError::Line { line, column, found, expected, .. } => {
            format!("line {line}, column {column}: `{found}`: expected {expected}")
        }
        other => other.to_string(),
    }
}

fn many(first: &ImportError, count: usize, all: usize) -> ImportError {
    let file = match first {
        ImportError::Line { file, .. } => file.clone(),
        _ => String::new(),
    };
    let problem = format!(
        "{}; {count} of {all} rows cannot be read, more than {:.0} %: is it another format?",
        reason(first),
        100.0 * MAX_SHARE
    );
    ImportError::Problem { file, problem }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(line: usize, found: &str) -> ImportError {
        ImportError::Line { file: "a.csv".into(), line, column: 4, found: found.into(), expected: "metres".into() }
    }

    #[test]
    fn few_broken_rows_are_named_and_many_are_refused() {
        let mut broken = Broken::default();
        broken.row(error(7, "1.2.3"));
        broken.row(error(9, ""));
        broken.text(12, "ets Jun  8 2016");
        let said = broken.end(18).unwrap();
        assert_eq!(said[0], "2 broken rows are left out (line 7, 9): line 7, column 4: `1.2.3`: expected metres");
        assert_eq!(said[1], "1 line is no row and left out; the first is line 12: `ets Jun  8 2016`");
        let mut broken = Broken::default();
        (0..3).for_each(|line| broken.row(error(line + 2, &format!("x{line}"))));
        let refused = broken.end(26).unwrap_err().to_string();
        assert!(refused.starts_with("a.csv: line 2, column 4: `x0`") && refused.contains("3 of 29 rows"), "{refused}");
    }

    #[test]
    fn a_text_in_several_rows_has_a_meaning() {
        let mut broken = Broken::default();
        broken.row(error(3, "1.2.3"));
        (0..3).for_each(|line| broken.row(error(line + 5, "NULL")));
        assert!(broken.end(1_000).unwrap_err().to_string().contains("line 5, column 4: `NULL`"));
    }
}
