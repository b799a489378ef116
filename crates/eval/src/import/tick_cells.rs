//! Encoder cells that are no plain numbers: thousands separators, and counts below 0 in an unsigned counter of 64 bits.

use super::columns::Role;
use super::table::Record;
use super::{ImportError, SourceLine};

/// The count in a cell; none if it is no number. An unsigned counter of 64 bits has counts below 0 at its end.
pub(super) fn count(cell: &str) -> Option<f64> {
    if let Some(digits) = hex_digits(cell) {
        return u64::from_str_radix(digits, 16).ok().map(|whole| whole.cast_signed() as f64);
    }
    let whole = cell.parse::<i64>().ok().or_else(|| cell.parse::<u64>().ok().map(u64::cast_signed));
    whole.map(|whole| whole as f64).or_else(|| cell.parse().ok()).filter(|count: &f64| count.is_finite())
}

/// The digits of a number such as `0x1F`.
fn hex_digits(cell: &str) -> Option<&str> {
    cell.strip_prefix("0x").or_else(|| cell.strip_prefix("0X"))
}

/// True for a count such as `0x1F`.
pub(super) fn is_hexadecimal(cell: &str) -> bool {
    hex_digits(cell).is_some()
}

/// What the cells of one encoder look like.
#[derive(Default)]
struct Seen {
    /// The first cell that may be grouped by thousands: its line, and as it stands.
    grouped: Option<(usize, String)>,
    /// Cells below 1000 without a separator.
    small: usize,
    /// Cells that are not grouped, though they would be: fractions, and numbers above 999.
    plain: usize,
    /// A cell that can be nothing else.
    is_sure: bool,
}

/// Refuses ticks with thousands separators. As decimal fractions they would be small, and nothing else would say so.
///
/// # Errors
/// At the first such cell.
pub(super) fn check_separators(
    records: impl Iterator<Item = Record> + Clone,
    roles: &[Role],
    file: &str,
) -> Result<(), ImportError> {
    for (column, _) in roles.iter().enumerate().filter(|(_, role)| matches!(role, Role::Ticks(_))) {
        let mut seen = Seen::default();
        for record in records.clone() {
            let Some(cell) = record.fields.get(column) else { continue };
            let digits = cell.trim_start_matches(['-', '+']);
            let groups = groups(digits);
            if groups > 1 {
                let sign = sign_of(&record, column);
                seen.grouped
                    .get_or_insert_with(|| (record.line, if sign { cell.replace('.', ",") } else { cell.clone() }));
                seen.is_sure |= groups > 2 || decimal_sign(&record, roles).is_some_and(|other| other != sign);
            } else if !digits.is_empty() {
                let is_small = digits.len() <= 3 && digits.bytes().all(|byte| byte.is_ascii_digit());
                *(if is_small { &mut seen.small } else { &mut seen.plain }) += 1;
            }
        }
        if let Some((number, found)) = seen.grouped.filter(|_| seen.is_sure || (seen.small > 0 && seen.plain == 0)) {
            let expected = "a number of encoder ticks without thousands separators: export the column as plain numbers";
            return Err(SourceLine { file, number }.error(&found, column, expected));
        }
    }
    Ok(())
}

/// How many groups of three digits a number has, the first of one to three; 0 if it has others. A fraction below 1 has others.
fn groups(digits: &str) -> usize {
    let mut groups = digits.split('.');
    let is_digits = |group: &str| group.bytes().all(|byte| byte.is_ascii_digit());
    let is_first = |group: &str| (1..=3).contains(&group.len()) && is_digits(group) && !group.starts_with('0');
    if !groups.next().is_some_and(is_first) {
        return 0;
    }
    let mut count = 1;
    for group in groups {
        if group.len() != 3 || !is_digits(group) {
            return 0;
        }
        count += 1;
    }
    count
}

/// True if a cell has commas.
fn sign_of(record: &Record, column: usize) -> bool {
    record.has_comma.get(column).copied().unwrap_or_default()
}

/// Whether commas are the decimal signs of the time and the ranges of a row; none if they have no fractions, or both.
fn decimal_sign(record: &Record, roles: &[Role]) -> Option<bool> {
    let is_measured = |role: &Role| matches!(role, Role::Time | Role::Range(_));
    let columns = roles.iter().enumerate().filter(|(_, role)| is_measured(role)).map(|(column, _)| column);
    let mut signs = columns
        .filter(|column| record.fields.get(*column).is_some_and(|cell| cell.contains('.')))
        .map(|column| sign_of(record, column));
    let first = signs.next()?;
    signs.all(|sign| sign == first).then_some(first)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(rows: &[&[&str]]) -> Option<String> {
        let record =
            |(line, cells): (usize, &&[&str])| Record::new(line, cells.iter().map(ToString::to_string).collect());
        let records: Vec<Record> = (2..).zip(rows).map(record).collect();
        let roles = [Role::Time, Role::Ticks(0), Role::Ticks(1), Role::Range(0)];
        check_separators(records.into_iter(), &roles, "a.csv").err().map(|error| error.to_string())
    }

    #[test]
    fn thousands_separators_are_named() {
        let text = error(&[&["0.1", "0", "0", "1.5"], &["0.2", "1,234", "5", "1.5"]]).unwrap();
        assert!(
            text.starts_with("a.csv: line 3, column 2: `1,234`: expected a number of encoder ticks without thousands"),
            "{text}"
        );
        // The other way round, without a count below 1000, with whole times, and in millions.
        assert!(error(&[&["0,1", "0", "-1.234", "1,5"]]).unwrap().contains("column 3: `-1.234`"));
        assert!(error(&[&["1", "12,345", "5", "2"], &["2", "999", "5", "2"]]).unwrap().contains("line 2, column 2"));
        assert!(error(&[&["1", "1,234,567", "5", "2"]]).unwrap().contains("`1,234,567`"));
    }

    #[test]
    fn fractions_are_no_thousands() {
        assert_eq!(
            error(&[&["0.1", "0", "0", "1.5"], &["0.2", "1.234", "5", "1.5"], &["0.3", "12.5", "5", "1.5"]]),
            None
        );
        assert_eq!(error(&[&["0,1", "0,000", "7", "1,5"], &["0,2", "1,234", "7", "1,5"]]), None);
        assert_eq!(error(&[&["0.1", "1500", "0", "inf"], &["0.2", "1500.125", "", "inf"]]), None);
    }

    #[test]
    fn unsigned_counts_of_64_bits_are_signed() {
        assert_eq!(count("18446744073709551116"), Some(-500.0));
        assert_eq!(count("-500"), Some(-500.0));
        assert_eq!(count("4294966796"), Some(4_294_966_796.0));
        assert_eq!(count("12.5"), Some(12.5));
        assert_eq!(count("1e3"), Some(1000.0));
        assert_eq!((count("0x1F"), count("0XFFFFFF9C"), count("0xZZ")), (Some(31.0), Some(4_294_967_196.0), None));
        assert!(["", "inf", "nan", "1.234.567", "x"].into_iter().all(|cell| count(cell).is_none()));
    }
}
