//! The lines of a CSV text: where its header is, what separates its fields, and whether its end is missing.

use super::columns::T_S;
use super::header;

/// One line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Record {
    /// Line of the file, from 1.
    pub(super) line: usize,
    /// With points for decimal commas.
    pub(super) fields: Vec<String>,
    /// By field, whether it has commas, which became points.
    pub(super) has_comma: Vec<bool>,
}

impl Record {
    /// Makes points of decimal commas.
    pub(super) fn new(line: usize, fields: Vec<String>) -> Self {
        let has_comma = fields.iter().map(|field| field.contains(',')).collect();
        Self { line, fields: fields.into_iter().map(|field| field.replace(',', ".")).collect(), has_comma }
    }
}

/// A table with its header. Its rows are split when they are asked for: their fields would take much more memory than the text.
#[derive(Debug)]
pub(super) struct Table<'a> {
    pub(super) header: Option<Record>,
    /// The number and the text of each row's line.
    pub(super) lines: Vec<(usize, &'a str)>,
    delimiter: char,
    /// Lines before the header, which are left out: the first.
    pub(super) garbage: Option<String>,
    /// False if the last line has no line feed.
    pub(super) ends_with_line_feed: bool,
}

/// The header is searched so far: boot messages are shorter.
const MAX_GARBAGE_LINES: usize = 200;
/// Characters around a field that are not part of it.
const PADDING: [char; 3] = [' ', '\t', '\r'];

impl<'a> Table<'a> {
    /// The rows.
    pub(super) fn records(&self) -> impl Iterator<Item = Record> + Clone {
        self.lines.iter().map(|(line, text)| Record::new(*line, split(text, self.delimiter)))
    }

    /// Splits a text. The header is the line with a column `first_column`, also one that is a comment; without one, `is_headless` says whether
    /// the header may be missing.
    pub(super) fn read(text: &'a str, first_column: &str, is_headless: bool) -> Self {
        let end = if text.contains('\n') { '\n' } else { '\r' };
        let has_first =
            |line: &str| split(line, delimiter(line)).iter().any(|name| name.eq_ignore_ascii_case(first_column));
        let head = || (1..).zip(text.split(end)).take(MAX_GARBAGE_LINES).map(|(_, line)| uncommented(line));
        // Other names count where there is none of the right name.
        let is_other = !is_headless && first_column == T_S && !head().any(has_first);
        let is_header = |line: &str| if is_other { is_header(line, first_column) } else { has_first(line) };
        let is_row = |line: &str| !line.trim().is_empty() && (!is_comment(line) || is_header(uncommented(line)));
        let lines = || (1..).zip(text.split(end)).filter(|(_, line): &(usize, &str)| is_row(line));
        let header = lines().take(MAX_GARBAGE_LINES).find(|(_, line)| is_header(uncommented(line)));
        let header = header.map(|(number, _)| number);
        let first = header.or_else(|| lines().next().map(|(number, _)| number)).unwrap_or(1);
        let garbage = lines().next().filter(|(number, _)| *number < first).map(|(_, line)| excerpt(line.trim()));
        let body = || lines().skip_while(|(number, _)| *number < first);
        let delimiter = body().next().map_or(',', |(_, line)| delimiter(uncommented(line)));
        let has_header = header.is_some() || !is_headless;
        let head = body().next().filter(|_| has_header);
        let header = head.map(|(line, text)| Record::new(line, split(uncommented(text), delimiter)));
        let rows = body().skip(usize::from(header.is_some()));
        let lines = rows.filter(|(_, line)| !is_comment(line)).collect();
        Self { header, lines, delimiter, garbage, ends_with_line_feed: text.ends_with(end) }
    }
}

/// True for a line that names the columns, by our name of the first or by usual ones.
pub(super) fn is_header(line: &str, first_column: &str) -> bool {
    let names = split(line, delimiter(line));
    names.iter().any(|name| name.eq_ignore_ascii_case(first_column)) || header::is_header(&names)
}

fn is_comment(line: &str) -> bool {
    COMMENTS.iter().any(|mark| line.trim_start().starts_with(mark))
}

/// How comments begin.
const COMMENTS: [&str; 4] = ["#", "//", "%", ";;"];

/// A line without the mark of a comment before it.
fn uncommented(line: &str) -> &str {
    line.trim_start_matches(['#', '/', '%', ' '])
}

/// The fields of a line, without the quotes around them.
fn split(line: &str, delimiter: char) -> Vec<String> {
    let (mut fields, mut field, mut is_quoted) = (Vec::new(), String::new(), false);
    // Spaces align columns: several are one.
    let line = if delimiter == ' ' { line.trim_matches(PADDING) } else { line };
    let is_between = |character: char| character == delimiter || (delimiter == ' ' && character == '\t');
    let mut characters = line.chars().peekable();
    while let Some(character) = characters.next() {
        match character {
            '"' if is_quoted && characters.peek() == Some(&'"') => field.extend(characters.next()),
            '"' => is_quoted = !is_quoted,
            _ if is_between(character) && !is_quoted => {
                while delimiter == ' ' && characters.peek().copied().is_some_and(is_between) {
                    characters.next();
                }
                fields.push(std::mem::take(&mut field));
            }
            _ => field.push(character),
        }
    }
    fields.push(field);
    fields.into_iter().map(|field| field.trim_matches(PADDING).to_owned()).collect()
}

/// What separates the fields of a header: spaces only where nothing else does.
fn delimiter(header: &str) -> char {
    let count = |delimiter: char| header.chars().filter(|character| *character == delimiter).count();
    let found = [',', ';', '\t', '|'].into_iter().filter(|delimiter| count(*delimiter) > 0);
    let default = if header.trim().contains(' ') { ' ' } else { ',' };
    found.max_by_key(|delimiter| (count(*delimiter), *delimiter == ',')).unwrap_or(default)
}

/// The beginning of a text without control characters.
pub(super) fn excerpt(text: &str) -> String {
    text.chars().filter(|c| !c.is_control()).take(60).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fields(text: &str) -> Vec<Vec<String>> {
        let table = Table::read(text, "t_s", false);
        table.header.clone().into_iter().chain(table.records()).map(|record| record.fields).collect()
    }

    #[test]
    fn separators_quotes_and_line_ends_do_not_matter() {
        let plain = fields("t_s,r0\n0.5,1.5\n");
        for text in [
            "t_s;r0\r\n0,5;1,5\r\n",
            "\"t_s\",\"r0\"\n\"0,5\",\"1,5\"\n",
            "t_s\tr0\r0.5\t1,5\r",
            "# a comment\nt_s , r0\n\n0.5, 1.5",
            "t_s|r0\n0.5|1.5\n",
            "t_s r0\n0.5 1.5\n",
            "# t_s  r0\n  0,5   1,5\n# a comment\n",
            "#t_s,r0\n0.5,1.5\n",
        ] {
            assert_eq!(fields(text), plain, "{text:?}");
        }
    }

    #[test]
    fn lines_before_the_header_are_left_out_and_named() {
        let table = Table::read("\u{fffd}@ets Jun  8\r\nboot\r\nt_s,r0\r\n0,1\r\n", "t_s", false);
        assert_eq!(table.garbage.as_deref(), Some("\u{fffd}@ets Jun  8"));
        assert_eq!((table.header.unwrap().line, table.lines[0].0), (3, 4));
        let table = Table::read("0,1\n1,2\n", "t_s", true);
        assert!(table.header.is_none() && table.garbage.is_none());
        assert_eq!(table.lines.iter().map(|(line, _)| *line).collect::<Vec<_>>(), [1, 2]);
    }
}
