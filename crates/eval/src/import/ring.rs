//! The ring CSV: one row per sweep, `t_s,left_ticks,right_ticks,r0,r1,…`.
//!
//! Seconds, absolute encoder ticks and metres per sensor: empty or `nan` is no measurement, `inf` is no echo. Ranges are taken as they
//! stand; what exceeds the configured range is the pipeline's affair, but a recording of which hardly a reading lies within it is
//! refused, because it is in another unit.
//!
//! An encoder without any count stands at 0. Single missing counts are interpolated (`rows.rs`). Where rows hold only the sensors
//! that have just answered, the others empty, `nan`, 0 or negative, the rows of a cycle become one sweep, each with its own time and
//! counts.

use super::recorder::{Recorder, Summary};
use super::rows::{self, Filler, Row};
use super::units::Readings;
use super::wheel_check::WheelCheck;
use super::{ImportError, SourceLine};
use slamd_core::Config;
use std::io::BufRead;
use std::path::Path;

/// Writes the recording `input`, called `file` in errors, as a capture. All of it is read and checked before the capture is created.
///
/// # Errors
/// When the recording cannot be read, a field is not what it should be, the ranges are not metres, the configuration lacks the ring or
/// `robot.ticks_per_turn`, or the capture cannot be written.
pub fn import(input: impl BufRead, file: &str, config: &Config, capture: &Path) -> Result<Summary, ImportError> {
    let sensors = config.ring.ring().ok_or(ImportError::Config("ring.circle or ring.sensors"))?.len();
    config.robot.ticks_per_turn.ok_or(ImportError::Config("robot.ticks_per_turn"))?;
    let mut left_out = 0;
    let mut rows = Vec::new();
    for (number, line) in (1..).zip(input.lines()) {
        let text = line.map_err(|source| ImportError::Io { file: file.into(), source })?;
        let line = SourceLine { file, number };
        let fields: Vec<&str> = text.trim_end().split(',').collect();
        if number == 1 {
            check_header(line, &fields, sensors)?;
        } else if fields.iter().any(|field| !field.trim().is_empty()) {
            rows.push(row(line, &fields, sensors)?);
        } else if !text.trim().is_empty() {
            left_out += 1;
        }
    }
    if rows.is_empty() {
        return Err(ImportError::Empty { file: file.into(), expected: "a header line and rows" });
    }
    let filler = Filler::find(&rows);
    filler.unwrap_or_default().clear(&mut rows);
    let mut readings = Readings::new(config);
    for row in &rows {
        check_readings(SourceLine { file, number: row.line }, row)?;
        row.readings.iter().for_each(|reading| readings.add(*reading));
    }
    let doubt = readings.check(file)?;
    let filled = rows::fill_ticks(&mut rows, file)?;
    let mut recorder = Recorder::create(capture, config, format!("imported from the ring CSV {file}"))?;
    recorder.summary.doubts.extend(doubt);
    recorder.summary.filled_ticks = filled.cells;
    recorder.summary.left_out = left_out + filled.rows_left_out;
    let mut wheels = WheelCheck::new(&config.robot);
    let ends = filler.map(|filler| rows::cycle_ends(&rows, filler));
    for (index, row) in rows.iter().enumerate() {
        let is_end = ends.as_ref().map(|ends| ends.get(index).is_none_or(|is_end| *is_end));
        write(&mut recorder, &mut wheels, row, is_end)?;
    }
    Ok(Summary { remarks: wheels.into_remarks(), ..recorder.finish()? })
}

/// Writes a row. `is_end` says whether it ends its cycle, where rows hold a part of the ring each; none where they are whole sweeps.
fn write(recorder: &mut Recorder, wheels: &mut WheelCheck, row: &Row, is_end: Option<bool>) -> Result<(), ImportError> {
    let ticks = row.ticks.map(Option::unwrap_or_default);
    let ranges_m: Vec<Option<f64>> =
        row.readings.iter().map(|reading| Some(*reading).filter(|reading| !reading.is_nan())).collect();
    let has_readings = ranges_m.iter().any(Option::is_some);
    recorder.advance(row.t_s);
    wheels.row(row.line, recorder.at(), ticks);
    match is_end {
        _ if !has_readings && is_end != Some(true) => recorder.encoders(ticks)?,
        Some(is_end) => recorder.part(ticks, &ranges_m, is_end)?,
        None => recorder.sonar(ticks, &ranges_m)?,
    }
    Ok(())
}

const TICKS: &str = "a whole number of encoder ticks, or nothing";
const LEADING: [&str; 3] = ["t_s", "left_ticks", "right_ticks"];

fn check_header(line: SourceLine<'_>, fields: &[&str], sensors: usize) -> Result<(), ImportError> {
    let names = LEADING.iter().map(ToString::to_string).chain((0..sensors).map(|sensor| format!("r{sensor}")));
    for (column, name) in names.enumerate() {
        let field = fields.get(column).copied().unwrap_or_default().trim();
        if field != name {
            let expected = format!("`{name}` (the header of {sensors} sensors: t_s,left_ticks,right_ticks,r0,r1,...)");
            return Err(line.error(field, column, &expected));
        }
    }
    check_end(line, fields, sensors)
}

fn check_end(line: SourceLine<'_>, fields: &[&str], sensors: usize) -> Result<(), ImportError> {
    let columns = LEADING.len() + sensors;
    match fields.get(columns) {
        Some(field) => Err(line.error(field, columns, &format!("the end of the line: the ring has {sensors} sensors"))),
        None if fields.len() < columns => {
            Err(line.error("", fields.len(), &format!("{columns} fields: the ring has {sensors} sensors")))
        }
        None => Ok(()),
    }
}

fn row(line: SourceLine<'_>, fields: &[&str], sensors: usize) -> Result<Row, ImportError> {
    check_end(line, fields, sensors)?;
    let t_s = line.number(fields, 0, "seconds")?;
    let ticks = [ticks(line, fields, 1)?, ticks(line, fields, 2)?];
    let readings = (LEADING.len()..fields.len()).map(|column| reading(line, fields, column));
    Ok(Row { line: line.number, t_s, ticks, readings: readings.collect::<Result<_, _>>()? })
}

fn ticks(line: SourceLine<'_>, fields: &[&str], column: usize) -> Result<Option<i32>, ImportError> {
    if is_empty(fields, column) { Ok(None) } else { line.value(fields, column, TICKS).map(Some) }
}

const READING: &str = "metres, at least 0, `inf` for no echo, or nothing or `nan` for no measurement";

fn reading(line: SourceLine<'_>, fields: &[&str], column: usize) -> Result<f64, ImportError> {
    if is_empty(fields, column) { Ok(f64::NAN) } else { line.value(fields, column, READING) }
}

/// Negative readings mean something only where they fill the place of sensors that have not answered.
fn check_readings(line: SourceLine<'_>, row: &Row) -> Result<(), ImportError> {
    match row.readings.iter().position(|reading| *reading < 0.0) {
        Some(sensor) => {
            let found = row.readings.get(sensor).map(ToString::to_string).unwrap_or_default();
            Err(line.error(&found, LEADING.len() + sensor, READING))
        }
        None => Ok(()),
    }
}

fn is_empty(fields: &[&str], column: usize) -> bool {
    fields.get(column).is_none_or(|field| field.trim().is_empty())
}
