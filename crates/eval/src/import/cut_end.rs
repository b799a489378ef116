//! A recording that ends within a number: its last value is a number too, but a shorter one.

use super::columns::Role;
use super::table::{Record, Table};

/// So many other rows tell how long a value is.
const MIN_OTHERS: usize = 10;
/// So many of the last rows are looked at.
const MAX_OTHERS: usize = 200;

/// The line of the last row, if its last value is cut off: the file has no line end, and the value has fewer decimals than all others, or
/// is the beginning of a whole number like the one before.
pub(super) fn line(table: &Table<'_>, roles: &[Role]) -> Option<usize> {
    if table.ends_with_line_feed || *roles.last()? == Role::Ignored {
        return None;
    }
    let column = roles.len() - 1;
    let skipped = table.lines.len().saturating_sub(MAX_OTHERS);
    let mut records: Vec<Record> = table.records().skip(skipped).collect();
    let last = records.pop()?;
    let cell = |record: &Record| {
        record.fields.get(column).filter(|cell| cell.parse::<f64>().is_ok_and(f64::is_finite)).cloned()
    };
    let value = cell(&last).filter(|_| last.fields.len() == roles.len())?;
    let others: Vec<String> = records.iter().filter_map(cell).collect();
    if others.len() < MIN_OTHERS {
        return None;
    }
    let least = others.iter().map(|other| decimals(other)).min()?;
    let before = others.last()?.parse::<f64>().ok()?;
    let is_cut = if least > 0 { decimals(&value) < least } else { is_beginning(value.parse().ok()?, before) };
    is_cut.then_some(last.line)
}

fn decimals(cell: &str) -> usize {
    cell.split_once('.').map_or(0, |(_, decimals)| decimals.chars().take_while(char::is_ascii_digit).count())
}

/// True if a number like `before` begins with the digits of a whole number.
fn is_beginning(value: f64, before: f64) -> bool {
    let is_like = |factor: f64| (value * factor - before).abs() <= 0.1 * before + factor;
    value > 0.0 && before > 0.0 && value < 0.3 * before && [10.0, 100.0, 1000.0].into_iter().any(is_like)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cut(cells: &str, last: &str) -> Option<usize> {
        let rows: String = (0..20).map(|row| format!("0.{row},{cells}{row:02}\n")).collect();
        let text = format!("t_s,r0\n{rows}2.0,{last}");
        line(&Table::read(&text, "t_s", false), &[Role::Time, Role::Range(0)])
    }

    #[test]
    fn a_value_without_its_last_digits_is_cut() {
        assert_eq!(cut("1.5", "1.5"), Some(22));
        assert_eq!(cut("1.5", "1."), Some(22));
        assert_eq!(cut("1.5", "1.523"), None);
        assert_eq!(cut("1.5", "1.523\n"), None, "it has its line end");
        assert_eq!(cut("15", "15"), Some(22), "whole numbers of four digits");
        assert_eq!(cut("15", "1523"), None);
        assert_eq!(cut("15", "800"), None, "nearer");
    }
}
