//! A recording that has been read and checked, whatever its format, and can be written as a capture.

use super::ranges::Readings;
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
        let mut readings = Readings::new(config, sound_m_s);
        for row in &rows {
            row.readings.iter().enumerate().for_each(|(sensor, reading)| readings.add(sensor, *reading));
        }
        doubts.extend(readings.check(file)?);
        let clipped = readings.clipped(sensors);
        let stamps = stamps::repair(&mut rows, wheel, options.run)
            .map_err(|problem| ImportError::Problem { file: file.into(), problem })?;
        remarks.extend(stamps.remarks);
        let filled = rows::fill_ticks(&mut rows, file)?;
        let ends = filler.map(|filler| rows::cycle_ends(&rows, filler));
        let max_range_m = config.ring.max_range_m;
        let nothing_from_m = clipped.as_ref().map_or(max_range_m, |(from_m, _)| from_m.min(max_range_m)) - ROUNDING_M;
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
            notes: format!("imported from {kind} {file}"),
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

/// The speed of sound at the configured temperature, as the STATUS of the capture gives it.
pub(super) fn sound_m_s(config: &Config) -> f64 {
    331.3 + 0.606 * config.ring.temperature_c
}
