//! CARMEN text logs: `ODOM`, `FLASER` and `SONAR` lines; all others are skipped.
//!
//! ```text
//! ODOM x y theta tv rv accel t host t
//! FLASER n r1 .. rn x y theta odom_x odom_y odom_theta t host t
//! SONAR n r1 .. rn x y theta odom_x odom_y odom_theta t host t
//! ```
//!
//! Each sensor of the configured ring gets the laser beam nearest to its bearing or, where it has a cone, the least of those within its
//! half-angle. Beams span the front half turn, from right to
//! left: for an odd n beam i points at −90° + i · 180°/(n − 1), for an even n at −90° + (i + ½) · 180°/n. Sensors that look
//! further back than 90.5° are left out, and so are beams of 0 m. SONAR readings belong to the sensors in order. The first kind of ranges in the log
//! is used, the other skipped. Line order is the order of acquisition.

use super::recorder::{Recorder, Summary};
use super::{ImportError, SourceLine, WheelTicks};
use slamd_core::{Config, Pose2};
use std::io::BufRead;
use std::path::Path;

/// From here on a range is a laser's word for "nothing", whatever the configured range.
const NOTHING_M: f64 = 80.0;
/// Sensors that look further back than this see no beam, degrees.
const FARTHEST_DEG: f64 = 90.5;
/// More beams than any laser has: a longer line is an error.
const MAX_BEAMS: usize = 100_000;

/// Writes the log `input`, called `file` in errors, as a capture.
///
/// # Errors
/// When the log cannot be read, a field is not what it should be, the configuration lacks the ring or `robot.ticks_per_turn`, or
/// the capture cannot be written.
pub fn import(input: impl BufRead, file: &str, config: &Config, capture: &Path) -> Result<Summary, ImportError> {
    let mut log = Log::new(config, Recorder::create(capture, config, format!("imported from the CARMEN log {file}"))?)?;
    for (number, line) in (1..).zip(input.lines()) {
        let text = line.map_err(|source| ImportError::Io { file: file.into(), source })?;
        let fields: Vec<&str> = text.split_whitespace().collect();
        log.line(SourceLine { file, number }, &fields)?;
    }
    if log.recorder.summary.rows == 0 {
        return Err(ImportError::Empty { file: file.into(), expected: "FLASER or SONAR lines" });
    }
    Ok(log.recorder.finish()?)
}

struct Log {
    recorder: Recorder,
    wheels: WheelTicks,
    /// Bearing and half-angle of each sensor.
    looks_deg: Vec<(f64, f64)>,
    max_range_m: f64,
    /// The kind of ranges that is used.
    kind: Option<String>,
}

impl Log {
    fn new(config: &Config, recorder: Recorder) -> Result<Self, ImportError> {
        let mountings = config.ring.ring().unwrap_or_default().mountings;
        Ok(Self {
            recorder,
            wheels: WheelTicks::new(&config.robot).ok_or(ImportError::Config("robot.ticks_per_turn"))?,
            looks_deg: mountings
                .iter()
                .map(|m| (m.robot_from_sensor.theta_rad.to_degrees(), m.half_angle_rad.to_degrees()))
                .collect(),
            max_range_m: config.ring.max_range_m,
            kind: None,
        })
    }

    fn line(&mut self, line: SourceLine<'_>, fields: &[&str]) -> Result<(), ImportError> {
        match fields.first() {
            Some(&"ODOM") => {
                let ticks = self.wheels.at(pose(line, fields, 1)?);
                self.recorder.advance(line.number(fields, 7, SECONDS)?);
                self.recorder.encoders(ticks)?;
            }
            Some(&kind @ ("FLASER" | "SONAR")) if self.kind.get_or_insert_with(|| kind.into()) == kind => {
                self.ranges(line, fields, kind == "SONAR")?;
            }
            Some(comment) if comment.starts_with('#') => {}
            Some(_) => self.recorder.summary.skipped += 1,
            None => {}
        }
        Ok(())
    }

    fn ranges(&mut self, line: SourceLine<'_>, fields: &[&str], is_sonar: bool) -> Result<(), ImportError> {
        let expected = "the number of ranges, at least 1 (for SONAR that of the configured sensors)";
        let count: usize = line.value(fields, 1, expected)?;
        if count == 0 || count > MAX_BEAMS || (is_sonar && count != self.looks_deg.len()) {
            return Err(line.error(&count.to_string(), 1, expected));
        }
        let odometry = pose(line, fields, 2 + count + 3)?;
        let t_s = line.number(fields, 2 + count + 6, SECONDS)?;
        let beams: Vec<f64> =
            (2..2 + count).map(|column| line.number(fields, column, "a range in metres")).collect::<Result<_, _>>()?;
        let ranges_m: Vec<Option<f64>> = self
            .looks_deg
            .iter()
            .enumerate()
            .map(|(sensor, look)| if is_sonar { self.range(*beams.get(sensor)?) } else { self.least(&beams, *look) })
            .collect();
        let ticks = self.wheels.at(odometry);
        self.recorder.advance(t_s);
        Ok(self.recorder.sonar(ticks, &ranges_m)?)
    }

    /// The least range within a sensor's cone.
    fn least(&self, beams: &[f64], (bearing_deg, half_angle_deg): (f64, f64)) -> Option<f64> {
        let beam = |off_deg: f64| nearest_beam((bearing_deg + off_deg).clamp(-90.0, 90.0), beams.len());
        nearest_beam(bearing_deg, beams.len())?;
        let ranges_m = beams.get(beam(-half_angle_deg)?..=beam(half_angle_deg)?)?.iter();
        ranges_m.filter_map(|beam_m| self.range(*beam_m)).min_by(f64::total_cmp)
    }

    fn range(&self, beam_m: f64) -> Option<f64> {
        let is_nothing = beam_m > self.max_range_m || beam_m >= NOTHING_M;
        (beam_m > 0.0).then_some(if is_nothing { f64::INFINITY } else { beam_m })
    }
}

const SECONDS: &str = "a time stamp in seconds";

/// Three fields from `column`, from 0.
fn pose(line: SourceLine<'_>, fields: &[&str], column: usize) -> Result<Pose2, ImportError> {
    let field = |at, what| line.number(fields, column + at, what);
    Ok(Pose2::new(
        field(0, "the pose's x in metres")?,
        field(1, "the pose's y in metres")?,
        field(2, "the pose's theta in radians")?,
    ))
}

/// The beam of `count` nearest to a bearing; none behind the laser, and none of none.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the beams there are")]
fn nearest_beam(bearing_deg: f64, count: usize) -> Option<usize> {
    if bearing_deg.abs() > FARTHEST_DEG {
        return None;
    }
    let share = (bearing_deg + 90.0) / 180.0;
    let last = count.checked_sub(1)? as f64;
    let index = if count % 2 == 1 { share * last } else { share * count as f64 - 0.5 };
    Some(index.round().clamp(0.0, last) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn beams_are_the_nearest() {
        assert_eq!(nearest_beam(-90.0, 181), Some(0));
        assert_eq!(nearest_beam(0.0, 181), Some(90));
        assert_eq!(nearest_beam(11.25, 361), Some(203));
        assert_eq!(nearest_beam(90.0, 180), Some(179));
        assert_eq!(nearest_beam(-90.0, 360), Some(0));
        assert_eq!(nearest_beam(-89.7, 360), Some(0));
        assert_eq!(nearest_beam(101.25, 360), None);
        assert_eq!(nearest_beam(0.0, 1), Some(0));
    }
}
