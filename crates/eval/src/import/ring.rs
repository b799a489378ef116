//! The ring CSV: one row per sweep, `t_s,left_ticks,right_ticks,r0,r1,…`.
//!
//! Seconds, absolute encoder ticks and metres per sensor: empty or `nan` is no measurement, `inf` is no echo. Encodings, separators,
//! units and further habits are read as they are found, or as [`Options`] name them; a recording of which hardly a reading lies within
//! the ring's range is refused, because it is in another unit.
//!
//! An encoder without any count stands at 0. Single missing counts are interpolated (`rows.rs`). Where rows hold only the sensors
//! that have just answered, the others empty, `nan`, 0 or negative, the rows of a cycle become one sweep, each with its own time and
//! counts.

use super::broken::Broken;
use super::columns::{Columns, Role, T_S, roles};
use super::counts::{self, Cells, Counting};
use super::drive::{Drive, Found};
use super::rows::{Filler, Row};
use super::sequence::spread_equal;
use super::table::{Record, Table, excerpt};
use super::{ImportError, Options, SourceLine, cut_end, dates, text, tick_cells, times};
use slamd_core::Config;
use std::f64::consts::TAU;
use std::io::Read;

/// Reads and checks the recording `input`, called `file` in errors.
///
/// # Errors
/// When the recording cannot be read, a field is not what it should be, ranges or stamps are of another unit, or the configuration lacks the
/// ring or `robot.ticks_per_turn`.
pub fn read(input: impl Read, file: &str, config: &Config, options: &Options) -> Result<Drive, ImportError> {
    let sensors = config.ring.ring().ok_or(ImportError::Config("ring.circle or ring.sensors"))?.len();
    let ticks_per_turn = config.robot.ticks_per_turn.ok_or(ImportError::Config("robot.ticks_per_turn"))?;
    let text = text::read(input, file)?;
    if text::is_carmen(&text.text) {
        let what = "a CARMEN log; `slamd import carmen` reads it";
        return Err(ImportError::Foreign { file: file.into(), what });
    }
    let columns = options.columns.as_ref();
    let first = columns.map_or(T_S, Columns::first);
    let mut table = Table::read(&text.text, first, columns.is_some_and(Columns::is_in_order));
    if table.header.is_none() && table.lines.is_empty() {
        return Err(ImportError::Empty { file: file.into(), expected: "a header line and rows" });
    }
    let roles = roles(columns, table.header.as_ref(), file, sensors)?;
    let mut found = Found {
        kind: "the ring CSV",
        is_whole: text.is_whole,
        collects: true,
        remarks: text.remarks,
        ..Found::default()
    };
    if table.header.is_none() {
        skip_head(&mut table, &roles, &mut found);
    }
    if let Some(garbage) = &table.garbage {
        let header = table.header.as_ref().map_or(1, |header| header.line);
        found
            .remarks
            .push(format!("line 1: `{garbage}` is no row; what stands before the header in line {header} is left out"));
    }
    tick_cells::check_separators(table.records(), &roles, file)?;
    let (mut rows, mut cells) = parse(&table, &roles, (file, sensors), &options.no_echo_words, &mut found)?;
    if rows.is_empty() {
        return Err(ImportError::Empty { file: file.into(), expected: "a header line and rows" });
    }
    if has_dates(&table, &roles) {
        if options.time_unit.is_some() {
            let problem = "the stamps are dates and times: leave out --time-unit".into();
            return Err(ImportError::Problem { file: file.into(), problem });
        }
        found.remarks.push("the stamps are dates and times, taken as UTC where they name no offset".into());
    }
    let unit_s = options.time_unit.map_or(1.0, times::TimeUnit::seconds);
    for (row, cells) in rows.iter_mut().zip(&mut cells) {
        row.t_s *= unit_s;
        cells.t_s = row.t_s;
    }
    found.doubts.extend(times::check(&rows, options.time_unit, file)?);
    found.remarks.extend(spread_equal(&mut rows));
    check_negative(&rows, options, &roles, file)?;
    let metres_per_tick = TAU * config.robot.wheel_radius_m / f64::from(ticks_per_turn);
    if options.counting.is_none() && counts::wraps_at_8_bits(&cells) {
        let problem = "the ticks are those of counters of 8 bits: they wrap so often that nothing says how far a wheel turned; \
                       send counters of 16 or 32 bits, or, where they are ticks since the row before: --ticks deltas";
        return Err(ImportError::Problem { file: file.into(), problem: problem.into() });
    }
    let counting = counts::find(&cells, metres_per_tick, config.robot.max_speed_m_s);
    if options.counting.unwrap_or(counting) == Counting::Deltas {
        counts::sum(&mut cells);
        found.is_deltas = true;
        if options.counting.is_none() {
            found.remarks.push(
                "the ticks are taken as those since the row before, because as counts the robot would hardly have moved; --ticks counts takes them as counts".into(),
            );
        }
    }
    counts::fill(&mut rows, &cells);
    Drive::new(rows, found, file, config, options)
}

/// True if the first stamp is a date or a time of day.
fn has_dates(table: &Table<'_>, roles: &[Role]) -> bool {
    let time = roles.iter().position(|role| *role == Role::Time);
    let stamp = |record: &Record| time.and_then(|time| record.fields.get(time)).is_some_and(|cell| is_date(cell));
    table.records().take(MAX_HEAD).any(|record| stamp(&record))
}

fn is_date(cell: &str) -> bool {
    dates::seconds(cell).is_some()
}

/// Leaves out what stands before the first row, where the columns are named in order: another header, boot messages.
fn skip_head(table: &mut Table<'_>, roles: &[Role], found: &mut Found) {
    let time = roles.iter().position(|role| *role == Role::Time).unwrap_or_default();
    let is_row =
        |record: &Record| record.fields.get(time).is_some_and(|field| field.parse::<f64>().is_ok() || is_date(field));
    let count = table.records().take(MAX_HEAD).position(|record| is_row(&record)).unwrap_or_default();
    let head = table.records().take(count).next();
    table.lines.drain(..count);
    if let Some(head) = head {
        let line = head.line;
        found.remarks.push(format!("line {line}: `{}` is no row and left out", excerpt(&head.fields.join(","))));
    }
}

/// A head has fewer lines.
const MAX_HEAD: usize = 200;

/// The rows without counts, and their encoder cells.
fn parse(
    table: &Table<'_>,
    roles: &[Role],
    (file, sensors): (&str, usize),
    no_echo: &[String],
    found: &mut Found,
) -> Result<(Vec<Row>, Vec<Cells>), ImportError> {
    let (mut rows, mut cells) = (Vec::with_capacity(table.lines.len()), Vec::with_capacity(table.lines.len()));
    let (last, mut broken) = (table.lines.len().saturating_sub(1), Broken::default());
    for (index, record) in table.records().enumerate() {
        if record.fields.iter().all(String::is_empty) {
            found.left_out += u64::from(record.fields.len() > 1);
            continue;
        }
        if table.header.as_ref().is_some_and(|header| header.fields == record.fields) {
            found.skipped += 1;
            continue;
        }
        match row(&record, roles, (file, sensors), no_echo) {
            Ok((row, ticks)) => {
                cells.push(Cells { t_s: row.t_s, ticks });
                rows.push(row);
            }
            Err(_)
                if index == last && index > 0 && (record.fields.len() < roles.len() || !table.ends_with_line_feed) =>
            {
                found.is_whole = false;
                let (line, fields, columns) = (record.line, record.fields.len(), roles.len());
                found.remarks.push(format!(
                    "line {line}: the last row is cut off ({fields} of {columns} fields) and left out; what followed it is lost"
                ));
            }
            // What a board prints when it starts has neither the time nor the number of a row's fields.
            Err(_) if record.fields.len() != roles.len() && !has_stamp(&record, roles) => {
                broken.text(record.line, &record.fields.join(","));
            }
            Err(error) => broken.row(error),
        }
    }
    found.remarks.extend(broken.end(rows.len())?);
    if let Some(line) = cut_end::line(table, roles) {
        found.is_whole = false;
        rows.pop();
        cells.pop();
        found.remarks.push(format!(
            "line {line}: the last row has no line end, and its last value is shorter than the others: it is cut off and left out"
        ));
    }
    Ok((rows, cells))
}

/// True if the time of a row can be read.
fn has_stamp(record: &Record, roles: &[Role]) -> bool {
    let cell = roles.iter().position(|role| *role == Role::Time).and_then(|time| record.fields.get(time));
    cell.is_some_and(|cell| cell.is_empty() || cell.parse::<f64>().is_ok() || is_date(cell))
}

type Ticks = [Option<f64>; 2];

fn row(
    record: &Record,
    roles: &[Role],
    (file, sensors): (&str, usize),
    no_echo: &[String],
) -> Result<(Row, Ticks), ImportError> {
    let line = SourceLine { file, number: record.line };
    let fields = &record.fields;
    if fields.len() < roles.len() {
        let expected = format!("{} fields: the ring has {sensors} sensors", roles.len());
        return Err(line.error("", fields.len(), &expected));
    }
    if let Some(field) = fields.get(roles.len()).filter(|field| !field.is_empty()) {
        let is_whole = |field: &String| field.parse::<i64>().is_ok();
        let hint = if fields.iter().all(is_whole) {
            ": commas are decimal signs here, too: export with decimal points, or with ; between the fields"
        } else {
            ""
        };
        let expected = format!("the end of the line: the ring has {sensors} sensors{hint}");
        return Err(line.error(field, roles.len(), &expected));
    }
    let mut ticks: Ticks = [None, None];
    let mut row = Row { line: record.line, t_s: f64::NAN, ticks: [None; 2], readings: vec![f64::NAN; sensors] };
    for (column, role) in roles.iter().enumerate() {
        let is_empty = fields.get(column).is_none_or(String::is_empty);
        match role {
            _ if is_empty => {}
            Role::Time => {
                let cell = fields.get(column).map(String::as_str).unwrap_or_default();
                row.t_s = match dates::seconds(cell) {
                    Some(seconds) => seconds,
                    None if cell.contains('/') => return Err(line.error(cell, column, AMBIGUOUS_DATE)),
                    None => line.number(fields, column, STAMP)?,
                };
            }
            Role::Ticks(wheel) => {
                let cell = fields.get(column).map(String::as_str).unwrap_or_default();
                let count = tick_cells::count(cell).ok_or_else(|| line.error(cell, column, TICKS))?;
                if let Some(cell) = ticks.get_mut(*wheel) {
                    *cell = Some(count);
                }
            }
            Role::Range(sensor) => {
                let is_none = |field: &String| no_echo.iter().any(|word| word.eq_ignore_ascii_case(field));
                let reading = if fields.get(column).is_some_and(is_none) {
                    f64::INFINITY
                } else {
                    reading(line, fields, column)?
                };
                if let Some(cell) = row.readings.get_mut(*sensor) {
                    *cell = reading;
                }
            }
            Role::Ignored => {}
        }
    }
    Ok((row, ticks))
}

/// The reading in a cell. A text may mean that there was no echo.
fn reading(line: SourceLine<'_>, fields: &[String], column: usize) -> Result<f64, ImportError> {
    line.value(fields, column, READING).map_err(|error| match fields.get(column) {
        Some(word)
            if !word.is_empty()
                && word.len() <= MAX_WORD
                && word.chars().all(|c| c.is_alphabetic() || "_-/".contains(c)) =>
        {
            line.error(word, column, &format!("{READING}; where it means no echo: --no-echo {word}"))
        }
        _ => error,
    })
}

/// Longer words are no marks.
const MAX_WORD: usize = 20;
const STAMP: &str = "seconds, or a date and time such as 2026-05-01T12:00:00.5Z";
const AMBIGUOUS_DATE: &str = "a date that begins with its year: of 07/04/2024 nobody knows whether it is in April or July; export the column as \
                              2024-07-04 13:00:00, with 24 hours";
const TICKS: &str = "a number of encoder ticks, or nothing";
const READING: &str = "metres, at least 0, `inf` for no echo, or nothing or `nan` for no measurement";

/// Negative readings mean something only where they fill the place of sensors that have not answered, or the user says what.
fn check_negative(rows: &[Row], options: &Options, roles: &[Role], file: &str) -> Result<(), ImportError> {
    let filler = Filler::find(rows).unwrap_or_default();
    let is_named = |reading: f64| options.no_echo.iter().any(|value| (value - reading).abs() < 1e-9);
    let is_wrong = |reading: f64| reading < 0.0 && !filler.fills(reading) && !is_named(reading);
    for row in rows {
        let negative = row.readings.iter().position(|reading| is_wrong(*reading));
        if let Some(sensor) = negative {
            let found = row.readings.get(sensor).map(ToString::to_string).unwrap_or_default();
            let column = roles.iter().position(|role| *role == Role::Range(sensor)).unwrap_or_default();
            let expected = format!("{READING}; where it means no echo: --no-echo {found}");
            return Err(SourceLine { file, number: row.line }.error(&found, column, &expected));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_may_mean_no_echo() {
        let record = Record::new(3, ["0.1", "0", "0", "NULL"].map(str::to_owned).to_vec());
        let roles = [Role::Time, Role::Ticks(0), Role::Ticks(1), Role::Range(0)];
        let read = |word: &str| row(&record, &roles, ("a.csv", 1), &[word.to_owned()]);
        assert_eq!(read("null").unwrap().0.readings, [f64::INFINITY]);
        let error = read("none").unwrap_err().to_string();
        assert!(error.ends_with("where it means no echo: --no-echo NULL"), "{error}");
        assert!(error.contains("line 3, column 4: `NULL`: expected metres"), "{error}");
    }
}
