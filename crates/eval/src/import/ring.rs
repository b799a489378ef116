//! The ring CSV: one row per sweep, `t_s,left_ticks,right_ticks,r0,r1,…`.
//!
//! Seconds, absolute encoder ticks (empty: 0) and metres per sensor: empty is no measurement, `inf` is no echo. Ranges are taken
//! as they stand; what exceeds the configured range is the pipeline's affair.

use super::recorder::{Recorder, Summary};
use super::wheel_check::WheelCheck;
use super::{ImportError, SourceLine};
use slamd_core::Config;
use std::io::BufRead;
use std::path::Path;

/// Writes the recording `input`, called `file` in errors, as a capture.
///
/// # Errors
/// When the recording cannot be read, a field is not what it should be, the configuration lacks the ring or
/// `robot.ticks_per_turn`, or the capture cannot be written.
pub fn import(input: impl BufRead, file: &str, config: &Config, capture: &Path) -> Result<Summary, ImportError> {
    let sensors = config.ring.ring().map_or(0, |ring| ring.len());
    let mut recorder = Recorder::create(capture, config, format!("imported from the ring CSV {file}"))?;
    let mut wheels = WheelCheck::new(&config.robot);
    for (number, line) in (1..).zip(input.lines()) {
        let text = line.map_err(|source| ImportError::Io { file: file.into(), source })?;
        let line = SourceLine { file, number };
        let fields: Vec<&str> = text.trim_end().split(',').collect();
        if number == 1 {
            check_header(line, &fields, sensors)?;
        } else if !text.trim().is_empty() {
            row(&mut recorder, &mut wheels, line, &fields, sensors)?;
        }
    }
    if recorder.summary.rows == 0 {
        return Err(ImportError::Empty { file: file.into(), expected: "a header line and rows" });
    }
    Ok(Summary { remarks: wheels.into_remarks(), ..recorder.finish()? })
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

fn row(
    recorder: &mut Recorder,
    wheels: &mut WheelCheck,
    line: SourceLine<'_>,
    fields: &[&str],
    sensors: usize,
) -> Result<(), ImportError> {
    check_end(line, fields, sensors)?;
    let t_s = line.number(fields, 0, "seconds")?;
    let ticks = [ticks(line, fields, 1)?, ticks(line, fields, 2)?];
    let ranges_m: Vec<Option<f64>> =
        (LEADING.len()..fields.len()).map(|column| range(line, fields, column)).collect::<Result<_, _>>()?;
    recorder.advance(t_s);
    wheels.row(line.number, recorder.at(), ticks);
    Ok(recorder.sonar(ticks, &ranges_m)?)
}

fn ticks(line: SourceLine<'_>, fields: &[&str], column: usize) -> Result<i32, ImportError> {
    if is_empty(fields, column) { Ok(0) } else { line.value(fields, column, TICKS) }
}

fn range(line: SourceLine<'_>, fields: &[&str], column: usize) -> Result<Option<f64>, ImportError> {
    const EXPECTED: &str = "metres, at least 0, `inf` for no echo, or nothing for no measurement";
    if is_empty(fields, column) {
        return Ok(None);
    }
    let range_m: f64 = line.value(fields, column, EXPECTED)?;
    if range_m >= 0.0 { Ok(Some(range_m)) } else { Err(line.error(&range_m.to_string(), column, EXPECTED)) }
}

fn is_empty(fields: &[&str], column: usize) -> bool {
    fields.get(column).is_none_or(|field| field.trim().is_empty())
}
