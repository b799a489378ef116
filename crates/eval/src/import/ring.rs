//! The ring CSV: one row per sweep, `t_s,left_ticks,right_ticks,r0,r1,…`.
//!
//! Seconds, absolute encoder ticks and metres per sensor: empty or `nan` is no measurement, `inf` is no echo. Encodings, separators,
//! units and further habits are read as they are found, or as [`Options`] name them; a recording of which hardly a reading lies within
//! the ring's range is refused, because it is in another unit.
//!
//! An encoder without a column stands at 0. Single missing counts are interpolated (`rows.rs`). Where rows hold only the sensors
//! that have just answered, the others empty, `nan`, 0 or negative, the rows of a cycle become one sweep, each with its own time and
//! counts.

use super::broken::Broken;
use super::cells::{self, READING};
use super::columns::{Columns, Role, T_S, roles};
use super::counts::{self, Cells, Counting};
use super::drive::{Drive, Found, sound_m_s};
use super::encoder_columns::{self, Wheels};
use super::header::Layout;
use super::ranges::RangeUnit;
use super::rows::{Filler, Row};
use super::sequence::spread_equal;
use super::table::{self, Record, Table, excerpt};
use super::{
    ImportError, Options, SourceLine, column_names, cut_end, dates, monitor_log, order, text, tick_cells, times,
};
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
    let columns = options.columns.as_ref();
    let (text, is_labelled) = plain_text(input, file, columns.is_some())?;
    let first = columns.map_or(T_S, Columns::first);
    let mut table = Table::read(&text.text, first, columns.is_some_and(Columns::is_in_order));
    if is_labelled {
        // The file has no line of names.
        table.lines.iter_mut().for_each(|(line, _)| *line = line.saturating_sub(1));
    }
    if table.header.is_none() && table.lines.is_empty() {
        return Err(ImportError::Empty { file: file.into(), expected: "a header line and rows" });
    }
    let Layout { roles, time_unit, range_unit, said } = roles(columns, table.header.as_ref(), file, sensors)?;
    let mut options = options.clone();
    options.time_unit = options.time_unit.or_else(|| time_unit.filter(|unit| *unit != times::TimeUnit::Seconds));
    options.range_unit = options.range_unit.or_else(|| range_unit.filter(|unit| *unit != RangeUnit::Metres));
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
    if !said.is_empty() {
        found.remarks.push(format!("line {}: {said}", table.header.as_ref().map_or(1, |header| header.line)));
    }
    units_row(&mut table, &roles, &mut options, &mut found);
    tick_cells::check_separators(table.records(), &roles, file)?;
    let mut readings = cells::Cells {
        no_echo: &options.no_echo_words,
        unit_m: options.range_unit.unwrap_or(RangeUnit::Metres).metres(sound_m_s(config)),
        sound_m_s: sound_m_s(config),
        ..cells::Cells::default()
    };
    let (mut rows, mut cells) = parse(&table, &roles, (file, sensors), &mut readings, &mut found)?;
    if rows.is_empty() {
        return Err(ImportError::Empty { file: file.into(), expected: "a header line and rows" });
    }
    if let Some((line, cell)) = readings.with_unit {
        found.remarks.push(format!("line {line}: `{cell}`: ranges are read in the unit that stands with them"));
    }
    if let Some((line, cell)) = readings.hexadecimal {
        found.remarks.push(format!("line {line}: `{cell}`: ticks are read as hexadecimal numbers"));
    }
    times_of(&table, &roles, (&mut rows, &mut cells), options.time_unit, (file, &mut found))?;
    check_negative(&rows, &options, &roles, file)?;
    found.doubts.extend(cells::missing(&rows));
    let metres_per_tick = TAU * config.robot.wheel_radius_m / f64::from(ticks_per_turn);
    let wheels = Wheels { metres_per_tick, ticks_per_turn: f64::from(ticks_per_turn) };
    found.doubts.extend(encoder_columns::check(&table, &roles, &cells, (wheels, options.counting), file)?);
    count(&mut cells, wheels, (options.counting, config.robot.max_speed_m_s), (file, &mut found))?;
    counts::fill(&mut rows, &cells);
    Drive::new(rows, found, file, config, &options)
}

/// The text of a table without what loggers and programs put around its cells, and whether the names of the columns were labels in every row.
/// `is_named` where the user has named the columns.
fn plain_text(input: impl Read, file: &str, is_named: bool) -> Result<(text::Text, bool), ImportError> {
    let mut text = text::read(input, file)?;
    if text::is_carmen(&text.text) {
        let what = "a CARMEN log; `slamd import carmen` reads it";
        return Err(ImportError::Foreign { file: file.into(), what });
    }
    if is_json(&text.text) {
        let what = "a file of JSON; write a table with one line per row, for example with `jq -r '[.t_s, .left_ticks, ...] | @csv'`";
        return Err(ImportError::Foreign { file: file.into(), what });
    }
    let has_time = |line: &str| is_named || table::is_header(line, T_S);
    if let Some((without, said)) = monitor_log::without(&text.text, has_time) {
        text.text = without;
        text.remarks.push(said.into());
    }
    if let Some(rows) = monitor_log::unwrapped(&text.text) {
        text.text = rows;
        text.remarks.push("the brackets around each row are left out".into());
    }
    let labelled = monitor_log::labelled(&text.text);
    let is_labelled = labelled.is_some();
    if let Some(table) = labelled {
        text.text = table;
        text.remarks.push("the cells have labels, which are taken as the names of the columns".into());
    }
    Ok((text, is_labelled))
}

/// Makes seconds of the stamps, which have this unit, and checks them.
fn times_of(
    table: &Table<'_>,
    roles: &[Role],
    (rows, cells): (&mut Vec<Row>, &mut Vec<Cells>),
    unit: Option<times::TimeUnit>,
    (file, found): (&str, &mut Found),
) -> Result<(), ImportError> {
    if let Some(kind) = dates_of(table, roles) {
        if unit.is_some() {
            let problem = format!("the stamps are {kind}: leave out --time-unit");
            return Err(ImportError::Problem { file: file.into(), problem });
        }
        let zone = if kind == TIMES_OF_DAY { "" } else { ", taken as UTC where they name no offset" };
        found.remarks.push(format!("the stamps are {kind}{zone}"));
    }
    let unit_s = unit.map_or(1.0, times::TimeUnit::seconds);
    for (row, cells) in rows.iter_mut().zip(cells) {
        row.t_s *= unit_s;
        cells.t_s = row.t_s;
    }
    order::check(rows, unit_s, file)?;
    found.doubts.extend(order::numbers(rows).filter(|_| unit.is_none()));
    found.doubts.extend(times::check(rows, unit, file)?);
    found.remarks.extend(spread_equal(rows));
    Ok(())
}

/// Makes counts of the encoders' cells, which are what the user says.
fn count(
    cells: &mut [Cells],
    wheels: Wheels,
    (told_counting, max_speed_m_s): (Option<Counting>, f64),
    (file, found): (&str, &mut Found),
) -> Result<(), ImportError> {
    if told_counting.is_none() && counts::wraps_at_8_bits(cells) {
        let problem = "the ticks are those of counters of 8 bits: they wrap so often that nothing says how far a wheel turned; \
                       send counters of 16 or 32 bits, or, where they are ticks since the row before: --ticks deltas";
        return Err(ImportError::Problem { file: file.into(), problem: problem.into() });
    }
    if let Some(factor) =
        told_counting.and_then(|counting| counting.ticks(wheels.metres_per_tick, wheels.ticks_per_turn))
    {
        let ticks = cells.iter_mut().flat_map(|cells| &mut cells.ticks);
        ticks.flatten().for_each(|ticks| *ticks *= factor);
    }
    let counting = counts::find(cells, wheels.metres_per_tick, max_speed_m_s);
    // Metres may be those since the row before, too.
    let told = told_counting.filter(|counting| matches!(counting, Counting::Counts | Counting::Deltas));
    if told.unwrap_or(counting) == Counting::Deltas {
        counts::sum(cells);
        found.is_deltas = true;
        if told.is_none() {
            found.remarks.push(
                "the ticks are taken as those since the row before, because as counts the robot would hardly have moved; --ticks counts takes them as counts".into(),
            );
        }
    }
    Ok(())
}

/// What the stamps are, where they are no numbers.
fn dates_of(table: &Table<'_>, roles: &[Role]) -> Option<&'static str> {
    let time = roles.iter().position(|role| *role == Role::Time)?;
    let cell = |record: Record| record.fields.get(time).filter(|cell| is_date(cell)).cloned();
    let cell = table.records().take(MAX_HEAD).find_map(cell)?;
    Some(if cell.contains(['-', '/', '.']) && cell.contains([' ', 'T', 't']) {
        "dates and times"
    } else {
        TIMES_OF_DAY
    })
}

const TIMES_OF_DAY: &str = "times of day";

/// True for lines that are objects of JSON, or a list of them.
fn is_json(text: &str) -> bool {
    let start: String = text.chars().filter(|character| !character.is_whitespace()).take(2).collect();
    start == "{\"" || start == "{'" || start == "[{" || start == "[["
}

/// Takes the units of a row below the header, such as `ms,,,cm,cm`.
fn units_row(table: &mut Table<'_>, roles: &[Role], options: &mut Options, found: &mut Found) {
    let Some(record) = table.records().next() else { return };
    let Some((time, range)) = column_names::units(&record.fields, roles) else { return };
    table.lines.remove(0);
    let words = [time.map(times::TimeUnit::word), range.map(RangeUnit::word)];
    let said: Vec<String> = ["--time-unit", "--range-unit"]
        .into_iter()
        .zip(words)
        .filter_map(|(option, word)| word.map(|word| format!("{option} {word}")))
        .collect();
    options.time_unit = options.time_unit.or(time);
    options.range_unit = options.range_unit.or(range);
    found.remarks.push(format!("line {}: a row of units, taken as {}", record.line, said.join(" ")));
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
    readings: &mut cells::Cells<'_>,
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
        match row(&record, roles, (file, sensors), readings) {
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
    readings: &mut cells::Cells<'_>,
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
            Role::Range(sensor) if is_empty => {
                if let (Some(cell), true) = (row.readings.get_mut(*sensor), readings.is_empty_no_echo()) {
                    *cell = f64::INFINITY;
                }
            }
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
                if tick_cells::is_hexadecimal(cell) {
                    readings.hexadecimal.get_or_insert_with(|| (record.line, cell.to_owned()));
                }
                if let Some(cell) = ticks.get_mut(*wheel) {
                    *cell = Some(count);
                }
            }
            Role::Range(sensor) => {
                let reading = readings.reading(line, fields, column)?;
                if let Some(cell) = row.readings.get_mut(*sensor) {
                    *cell = reading;
                }
            }
            Role::Ignored => {}
        }
    }
    Ok((row, ticks))
}

const STAMP: &str = "seconds, or a date and time such as 2026-05-01T12:00:00.5Z, with 24 hours";
const AMBIGUOUS_DATE: &str = "a date that begins with its year: of 07/04/2024 nobody knows whether it is in April or July; export the column as \
                              2024-07-04 13:00:00, with 24 hours";
const TICKS: &str = "a number of encoder ticks, or nothing";

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
            let expected = format!("{READING}; where it means no echo: {}", cells::no_echo(&found));
            return Err(SourceLine { file, number: row.line }.error(&found, column, &expected));
        }
    }
    Ok(())
}
