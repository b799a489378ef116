//! A recording that has been read and checked, whatever its format, and can be written as a capture.

use super::mixed_units::{self, Limits};
use super::ranges::{RangeUnit, Readings};
use super::recorder::{Recorder, Summary};
use super::rows::{self, Filler, Row};
use super::stamps::{self, Wheel};
use super::wheel_check::WheelCheck;
use super::{ImportError, Options, ranges};
use slamd_core::Config;
use slamd_files::Output;
use std::f64::consts::TAU;

/// A drive, ready to be written as a capture.
#[derive(Debug)]
pub struct Drive {
    rows: Vec<Row>,
    /// By row, whether it ends its cycle, where rows hold a part of the ring each.
    ends: Option<Vec<bool>>,
    config: Config,
    notes: String,
    unix_zero_us: Option<u64>,
    /// Readings from here on are nothing in range, metres.
    nothing_from_m: f64,
    is_whole: bool,
    summary: Summary,
}

/// What a reader has found, besides the rows.
#[derive(Clone, Debug, Default)]
pub(super) struct Found {
    /// How the notes of the capture begin, for example `the ring CSV`.
    pub(super) kind: &'static str,
    /// False if the recording's end is missing.
    pub(super) is_whole: bool,
    /// The counts are ticks since the row before, already summed.
    pub(super) is_deltas: bool,
    /// Rows of a part of the ring each become one sweep.
    pub(super) collects: bool,
    pub(super) skipped: u64,
    pub(super) left_out: u64,
    /// Stamps that were put behind their predecessor.
    pub(super) clamped: u64,
    pub(super) remarks: Vec<String>,
    pub(super) doubts: Vec<String>,
}

/// Readings so much below the ring's greatest range are nothing in range, too: a driver that clips rounds. Metres.
const ROUNDING_M: f64 = 1e-3;

impl Drive {
    /// Checks the rows together: stamps, readings, counts.
    pub(super) fn new(
        mut rows: Vec<Row>,
        found: Found,
        file: &str,
        config: &Config,
        options: &Options,
    ) -> Result<Self, ImportError> {
        let sensors = config.ring.ring().ok_or(ImportError::Config("ring.circle or ring.sensors"))?.len();
        let ticks_per_turn = config.robot.ticks_per_turn.ok_or(ImportError::Config("robot.ticks_per_turn"))?;
        let Found { kind, is_whole, is_deltas, collects, skipped, left_out, clamped, mut remarks, mut doubts } = found;
        let metres_per_tick = TAU * config.robot.wheel_radius_m / f64::from(ticks_per_turn);
        let wheel = Wheel { max_ticks_per_s: config.robot.max_speed_m_s / metres_per_tick, is_deltas };
        let sound_m_s = sound_m_s(config);
        ranges::convert(&mut rows, options.range_unit, &options.no_echo, sound_m_s);
        let filler = if collects { Filler::find(&rows) } else { None };
        filler.unwrap_or_default().clear(&mut rows);
        let limits = Limits { min_m: config.ring.min_range_m, max_m: config.ring.max_range_m };
        doubts.extend(mixed_units::check(&mut rows, limits, file)?);
        let mut readings = Readings::new(config, options.range_unit.unwrap_or(RangeUnit::Metres), sound_m_s);
        for row in &rows {
            row.readings.iter().enumerate().for_each(|(sensor, reading)| readings.add(sensor, *reading));
        }
        doubts.extend(readings.check(file, options.range_unit.is_some() || !collects)?);
        let clipped = readings.clipped(sensors);
        let stamps = stamps::repair(&mut rows, wheel, options.run)
            .map_err(|problem| ImportError::Problem { file: file.into(), problem })?;
        remarks.extend(stamps.remarks);
        let filled = rows::fill_ticks(&mut rows, file)?;
        check_duration(&rows, file)?;
        let notes = format!("imported from {kind} {file}, {} rows", rows.len());
        let ends = filler.map(|filler| rows::cycle_ends(&rows, filler));
        let max_range_m = config.ring.max_range_m;
        let nothing_from_m = clipped.as_ref().map_or(max_range_m, |(from_m, _)| from_m.min(max_range_m)) - ROUNDING_M;
        doubts.extend(readings.pile(nothing_from_m, sensors));
        remarks.extend(clipped.map(|(_, sentence)| sentence));
        let summary = Summary {
            skipped,
            clamped,
            left_out: left_out + filled.rows_left_out,
            // Of several sources, only some rows have counts.
            filled_ticks: if collects { filled.cells } else { 0 },
            doubts,
            remarks,
            ..Summary::default()
        };
        Ok(Self {
            rows,
            ends,
            config: config.clone(),
            notes,
            unix_zero_us: stamps.unix_zero_us,
            nothing_from_m,
            is_whole,
            summary,
        })
    }

    /// What is doubtful of the recording, one sentence each.
    #[must_use]
    pub fn doubts(&self) -> &[String] {
        &self.summary.doubts
    }

    /// What was found and done, one sentence each.
    #[must_use]
    pub fn remarks(&self) -> &[String] {
        &self.summary.remarks
    }

    /// False if the end of the recording is missing.
    #[must_use]
    pub const fn is_whole(&self) -> bool {
        self.is_whole
    }

    /// The notes of the capture: what it is imported from. Another recording of the same name hardly has as many rows.
    #[must_use]
    pub fn notes(&self) -> &str {
        &self.notes
    }

    /// Writes the capture.
    ///
    /// # Errors
    /// When it cannot be written. Then nothing is left of it.
    pub fn write(self, output: Output) -> Result<Summary, ImportError> {
        let Self { rows, ends, config, notes, unix_zero_us, nothing_from_m, summary, .. } = self;
        let mut recorder = Recorder::create(output, &config, notes, unix_zero_us)?;
        recorder.summary = summary;
        let mut wheels = WheelCheck::new(&config.robot);
        let mut last: Option<(f64, [i32; 2])> = None;
        for (index, row) in rows.iter().enumerate() {
            let is_end = ends.as_ref().map(|ends| ends.get(index).is_none_or(|is_end| *is_end));
            let ticks = row.ticks.map(Option::unwrap_or_default);
            let range_m = |reading: f64| if reading >= nothing_from_m { f64::INFINITY } else { reading };
            let ranges_m: Vec<Option<f64>> =
                row.readings.iter().map(|reading| (!reading.is_nan()).then(|| range_m(*reading))).collect();
            let has_readings = ranges_m.iter().any(Option::is_some);
            if let Some((last_s, standing)) = last.replace((row.t_s, ticks)) {
                recorder.bridge(last_s, row.t_s, standing)?;
            }
            recorder.advance(row.t_s);
            wheels.row(row.line, recorder.at(), ticks);
            match is_end {
                _ if !has_readings && is_end != Some(true) => recorder.encoders(ticks)?,
                Some(is_end) => recorder.part(ticks, &ranges_m, is_end)?,
                None => recorder.sonar(ticks, &ranges_m)?,
            }
        }
        recorder.summary.remarks.extend(wheels.into_remarks());
        Ok(recorder.finish()?)
    }
}

/// A longer drive has a wrong stamp, seconds: 100 days. Pauses are filled with counts, one a minute, so a stamp far away would make the
/// import and its capture as long as it likes.
const MAX_DURATION_S: f64 = 8.64e6;

/// # Errors
/// If the rows are of more than [`MAX_DURATION_S`]. The longest pause is named.
fn check_duration(rows: &[Row], file: &str) -> Result<(), ImportError> {
    let times = || rows.iter().map(|row| row.t_s).filter(|t_s| !t_s.is_nan());
    let (first_s, last_s) = (times().fold(f64::INFINITY, f64::min), times().fold(f64::NEG_INFINITY, f64::max));
    if last_s - first_s <= MAX_DURATION_S || rows.len() < 2 {
        return Ok(());
    }
    let pauses = rows.windows(2).filter_map(|pair| {
        let (before, row) = (pair.first()?, pair.last()?);
        Some((row.t_s - before.t_s, row))
    });
    let longest = pauses.max_by(|(one, _), (other, _)| one.total_cmp(other));
    let (line, t_s, pause_s) = longest.map_or((0, last_s, 0.0), |(pause_s, row)| (row.line, row.t_s, pause_s));
    let problem = format!(
        "line {line}: the time {t_s} s is {pause_s} s after the row before, and the recording would last more than {:.0} days: \
         correct that stamp, or split the recording",
        MAX_DURATION_S / 86_400.0
    );
    Err(ImportError::Problem { file: file.into(), problem })
}

/// The speed of sound at the configured temperature, as the STATUS of the capture gives it.
pub(super) fn sound_m_s(config: &Config) -> f64 {
    331.3 + 0.606 * config.ring.temperature_c
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::{carmen, ring};

    const ROBOT: &str =
        "[robot]\nticks_per_turn = 1440\n\n[ring.circle]\ncount = 1\nradius_m = 0.15\nhalf_angle_deg = 12.5\n";

    fn config() -> Config {
        Config::from_toml(ROBOT).unwrap()
    }

    fn carmen_error(text: &str) -> String {
        carmen::read(text.as_bytes(), "a.log", &config(), &Options::default()).unwrap_err().to_string()
    }

    fn sonar(t_s: f64) -> String {
        format!("SONAR 1 1.2 0 0 0 0 0 0 {t_s} host {t_s}\n")
    }

    /// Fuzzing found the first: its pause was filled with counts until the disk was full.
    #[test]
    fn a_stamp_far_away_is_refused_with_its_line() {
        let error = carmen_error(&["ODOM 0 0 0 0 0 0 -1e308 host 0\n", &sonar(0.0)].concat());
        assert!(error.starts_with("a.log: line 2: the time 0 s is 1000000"), "{error}");
        assert!(error.contains("would last more than 100 days: correct that stamp"), "{error}");
        // So large that a minute more is the same number.
        let error = carmen_error(&[0.0, 1e18, 1e18 + 128.0].map(sonar).concat());
        assert!(
            error.starts_with("a.log: line 2: the time 1000000000000000000 s is 1000000000000000000 s "),
            "{error}"
        );
        let error = carmen_error(&[0.0, 1e9, 2e9].map(sonar).concat());
        assert!(error.starts_with("a.log: line "), "{error}");
    }

    #[test]
    fn a_ring_csv_with_a_stamp_far_away_is_refused_too() {
        for far_s in ["1e308", "1e18", "8640001"] {
            let text = format!("t_s,left_ticks,right_ticks,r0\n0,0,0,1\n{far_s},0,0,1\n");
            let read = ring::read(text.as_bytes(), "a.csv", &config(), &Options::default());
            assert!(read.unwrap_err().to_string().starts_with("a.csv: line 3: "), "{far_s}");
        }
    }

    #[test]
    fn long_pauses_are_bridged_within_bounds() {
        let folder = tempfile::tempdir().unwrap();
        let text = [1e18, 1e18 + 3584.0].map(sonar).concat();
        let drive = carmen::read(text.as_bytes(), "a.log", &config(), &Options::default()).unwrap();
        let output = slamd_files::OutputGuard::new(true).output(&folder.path().join("a.mcap")).unwrap();
        let summary = drive.write(output).unwrap();
        assert_eq!((summary.rows, summary.encoder_rows), (2, 0));
        assert!((summary.duration_s - 3584.0).abs() < 1e-6);
    }
}
