//! CARMEN text logs: `ODOM`, and `SONAR`, `ROBOTLASER1` or `FLASER` lines; all others are skipped.
//!
//! ```text
//! ODOM x y theta tv rv accel t host t
//! SONAR cone n r1 .. rn x1 y1 theta1 .. xn yn thetan t host t
//! ROBOTLASER1 type start fov resolution max accuracy mode n r1 .. rn m i1 .. im laser_x y theta robot_x y theta tv rv 3 safety t host t
//! FLASER n r1 .. rn x y theta odom_x odom_y odom_theta t host t
//! SONAR n r1 .. rn x y theta odom_x odom_y odom_theta t host t
//! ```
//!
//! A SONAR line of CARMEN has no pose: its counts are interpolated between the ODOM lines around it. The second kind of SONAR is that of
//! converters. Readings belong to the sensors in order. The geometry is that of the configuration; where a SONAR line differs, it is said.
//!
//! Of a laser each sensor gets the beam nearest to its bearing or, where it has a cone, the least of those within its half-angle; sensors
//! that look past the beams are left out, and so are beams of 0 m. One kind of ranges is used, the others skipped: the first, or the
//! one that is asked for.

use super::broken::Broken;
use super::drive::{Drive, Found};
use super::rows::Row;
use super::{ImportError, Options, SourceLine, WheelTicks, sequence, text};
use slamd_core::{Config, Mounting, Pose2, wrap_angle};
use std::collections::BTreeMap;
use std::io::Read;
use std::str::FromStr;

/// A kind of ranges in a CARMEN log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Scan {
    /// `SONAR` lines.
    Sonar,
    /// `ROBOTLASER1` lines.
    Robotlaser1,
    /// `FLASER` lines.
    Flaser,
}

impl Scan {
    const ALL: [Self; 3] = [Self::Sonar, Self::Robotlaser1, Self::Flaser];

    /// The word at the beginning of its lines.
    const fn word(self) -> &'static str {
        match self {
            Self::Sonar => "SONAR",
            Self::Robotlaser1 => "ROBOTLASER1",
            Self::Flaser => "FLASER",
        }
    }

    fn of_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|scan| scan.word() == word)
    }
}

impl FromStr for Scan {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::of_word(&text.to_ascii_uppercase()).ok_or_else(|| "it must be sonar, robotlaser1 or flaser".into())
    }
}

/// From here on a range is a laser's word for "nothing", whatever the configured range.
const NOTHING_M: f64 = 80.0;
/// Sensors that look further past the beams see none, degrees.
const PAST_DEG: f64 = 0.5;
/// More ranges than any line has: a longer line is an error.
const MAX_RANGES: usize = 100_000;
/// The configuration has a sensor where the log has it, up to here.
const SAME_M: f64 = 0.1;
const SAME_DEG: f64 = 10.0;

/// Reads and checks the log `input`, called `file` in errors.
///
/// # Errors
/// When the log cannot be read, a field is not what it should be, or the configuration lacks the ring or `robot.ticks_per_turn`.
pub fn read(input: impl Read, file: &str, config: &Config, options: &Options) -> Result<Drive, ImportError> {
    let mut log = Log::new(config)?;
    let text = text::read(input, file)?;
    let kinds = kinds(&text.text);
    let first = kinds.iter().min_by_key(|(_, (first, _))| *first).map(|(scan, _)| *scan);
    let scan = options.scan.or(first).unwrap_or(Scan::Sonar);
    let mut found =
        Found { kind: "the CARMEN log", is_whole: text.is_whole, remarks: text.remarks, ..Found::default() };
    found.remarks.extend(several(&kinds, scan));
    let (count, mut broken) = (text.text.lines().count(), Broken::default());
    for (number, line) in (1..).zip(text.text.lines()) {
        let fields: Vec<&str> = line.split_whitespace().collect();
        match log.line(SourceLine { file, number }, &fields, scan) {
            Ok(is_used) => found.skipped += u64::from(!is_used),
            Err(_) if number == count && number > 1 && !text.text.ends_with('\n') => {
                found.is_whole = false;
                found
                    .remarks
                    .push(format!("line {number}: the last line is cut off and left out; what followed it is lost"));
            }
            Err(error) => broken.row(error),
        }
    }
    found.remarks.extend(broken.end(log.rows.len())?);
    if !log.has_ranges {
        return Err(no_ranges(options.scan, &kinds, &text.text, file));
    }
    found.doubts.append(&mut log.doubts);
    if log.rows.iter().all(|row| row.ticks.contains(&None)) {
        found.doubts.push("there is no ODOM line: the robot stands still".into());
    }
    found.clamped = sequence::clamp(&mut log.rows);
    Drive::new(log.rows, found, file, config, options)
}

/// A log without the wanted ranges.
fn no_ranges(wanted: Option<Scan>, kinds: &BTreeMap<Scan, (usize, usize)>, text: &str, file: &str) -> ImportError {
    match wanted {
        Some(scan) if !kinds.is_empty() => {
            let lines = |(kind, (_, lines)): (&Scan, &(usize, usize))| {
                format!("{lines} {} lines (--scan {})", kind.word(), kind.word().to_ascii_lowercase())
            };
            let there: Vec<String> = kinds.iter().map(lines).collect();
            let problem = format!("the log has no {} line, but {}", scan.word(), there.join(" and "));
            ImportError::Problem { file: file.into(), problem }
        }
        _ if text.lines().take(20).any(|line| line.matches([',', ';', '\t']).count() > 2) && !text::is_carmen(text) => {
            ImportError::Foreign { file: file.into(), what: "no CARMEN log but a table; `slamd import ring` reads CSV" }
        }
        _ => ImportError::Empty { file: file.into(), expected: "SONAR, ROBOTLASER1 or FLASER lines" },
    }
}

/// By kind of ranges: its first line and the number of its lines.
fn kinds(text: &str) -> BTreeMap<Scan, (usize, usize)> {
    let mut kinds = BTreeMap::new();
    for (number, line) in text.lines().enumerate() {
        if let Some(scan) = line.split_whitespace().next().and_then(Scan::of_word) {
            kinds.entry(scan).or_insert((number, 0)).1 += 1;
        }
    }
    kinds
}

/// What is said where a log has several kinds of ranges.
fn several(kinds: &BTreeMap<Scan, (usize, usize)>, scan: Scan) -> Option<String> {
    let others: Vec<String> = kinds
        .iter()
        .filter(|(other, _)| **other != scan)
        .map(|(other, (_, lines))| {
            format!("{lines} {} lines (--scan {})", other.word(), other.word().to_ascii_lowercase())
        })
        .collect();
    let used = kinds.get(&scan).map_or(0, |(_, lines)| *lines);
    (!others.is_empty())
        .then(|| format!("{used} {} lines are used; the log also has {}", scan.word(), others.join(" and ")))
}

struct Log {
    rows: Vec<Row>,
    wheels: WheelTicks,
    mountings: Vec<Mounting>,
    max_range_m: f64,
    has_ranges: bool,
    doubts: Vec<String>,
}

impl Log {
    fn new(config: &Config) -> Result<Self, ImportError> {
        Ok(Self {
            rows: Vec::new(),
            wheels: WheelTicks::new(&config.robot).ok_or(ImportError::Config("robot.ticks_per_turn"))?,
            mountings: config.ring.ring().ok_or(ImportError::Config("ring.circle or ring.sensors"))?.mountings,
            max_range_m: config.ring.max_range_m,
            has_ranges: false,
            doubts: Vec::new(),
        })
    }

    /// Takes a line. Returns false if it is skipped.
    fn line(&mut self, line: SourceLine<'_>, fields: &[&str], wanted: Scan) -> Result<bool, ImportError> {
        match fields.first() {
            Some(&"ODOM") => {
                let (pose, t_s) = (pose(line, fields, 1)?, line.number(fields, 7, SECONDS)?);
                let readings = vec![f64::NAN; self.mountings.len()];
                self.push(line, t_s, Some(pose), readings);
                Ok(true)
            }
            Some(word) if Scan::of_word(word) == Some(wanted) => {
                match wanted {
                    Scan::Sonar => self.sonar(line, fields)?,
                    Scan::Robotlaser1 => self.robotlaser(line, fields)?,
                    Scan::Flaser => self.flaser(line, fields)?,
                }
                self.has_ranges = true;
                Ok(true)
            }
            Some(comment) => Ok(comment.starts_with('#')),
            None => Ok(true),
        }
    }

    fn push(&mut self, line: SourceLine<'_>, t_s: f64, pose: Option<Pose2>, readings: Vec<f64>) {
        let ticks = pose.map_or([None; 2], |pose| self.wheels.at(pose).map(Some));
        self.rows.push(Row { line: line.number, t_s, ticks, readings });
    }

    fn sonar(&mut self, line: SourceLine<'_>, fields: &[&str]) -> Result<(), ImportError> {
        let sensors = self.mountings.len();
        let whole = |column: usize| fields.get(column).and_then(|field| field.parse::<usize>().ok());
        let is_converted = whole(1).is_some_and(|count| count <= MAX_RANGES && fields.len() == 2 + count + 9);
        let at = if is_converted { 1 } else { 2 };
        let expected = format!("the number of ranges: the ring has {sensors} sensors");
        let count: usize = line.value(fields, at, &expected)?;
        if count != sensors {
            return Err(line.error(&count.to_string(), at, &expected));
        }
        let ranges = at + 1;
        let readings = self.ranges(line, fields, ranges, count)?;
        let after = ranges + count;
        let readings: Vec<f64> = readings.iter().map(|range_m| self.range(*range_m).unwrap_or(f64::NAN)).collect();
        if is_converted {
            let odometry = pose(line, fields, after + 3)?;
            self.push(line, line.number(fields, after + 6, SECONDS)?, Some(odometry), readings);
            return Ok(());
        }
        line.number(fields, 1, "the cone's angle in radians")?;
        if !self.has_ranges {
            self.compare(line, fields, after)?;
        }
        self.push(line, line.number(fields, after + 3 * count, SECONDS)?, None, readings);
        Ok(())
    }

    /// Compares the configured ring with the one that a SONAR line gives.
    fn compare(&mut self, line: SourceLine<'_>, fields: &[&str], column: usize) -> Result<(), ImportError> {
        let mut others = Vec::new();
        for (sensor, mounting) in self.mountings.iter().enumerate() {
            let (log, ring) = (pose(line, fields, column + 3 * sensor)?, mounting.robot_from_sensor);
            let off_deg = wrap_angle(log.theta_rad - ring.theta_rad).to_degrees().abs();
            if (log.position() - ring.position()).norm() > SAME_M || off_deg > SAME_DEG {
                others.push((sensor, log));
            }
        }
        if let Some((sensor, log)) = others.first() {
            self.doubts.push(format!(
                "line {}: {} of {} sensors are elsewhere than in the configuration; sensor {sensor} is at x {:.3}, y {:.3} m, {:.1} degrees: ring.sensors",
                line.number,
                others.len(),
                self.mountings.len(),
                log.x_m,
                log.y_m,
                log.theta_rad.to_degrees()
            ));
        }
        Ok(())
    }

    fn flaser(&mut self, line: SourceLine<'_>, fields: &[&str]) -> Result<(), ImportError> {
        let count: usize = line.value(fields, 1, COUNT)?;
        if count == 0 || count > MAX_RANGES {
            return Err(line.error(&count.to_string(), 1, COUNT));
        }
        let odometry = pose(line, fields, 2 + count + 3)?;
        let ranges_m = self.ranges(line, fields, 2, count)?;
        let readings = self.seen(&Beams::half_turn(count), &ranges_m, f64::INFINITY);
        self.push(line, line.number(fields, 2 + count + 6, SECONDS)?, Some(odometry), readings);
        Ok(())
    }

    fn robotlaser(&mut self, line: SourceLine<'_>, fields: &[&str]) -> Result<(), ImportError> {
        let number = |column, what| line.number(fields, column, what);
        let first_deg = number(2, "the first beam's angle in radians")?.to_degrees();
        let step_deg = number(4, "the step between beams in radians")?.to_degrees();
        let most_m = number(5, "the greatest range in metres")?;
        let count: usize = line.value(fields, 8, COUNT)?;
        let ranges_m = self.ranges(line, fields, 9, count)?;
        let remissions: usize = line.value(fields, 9 + count, "the number of remission values")?;
        if remissions > MAX_RANGES {
            return Err(line.error(&remissions.to_string(), 9 + count, "the number of remission values"));
        }
        let poses = 10 + count + remissions;
        let readings = self.seen(&Beams { first_deg, step_deg, count }, &ranges_m, most_m);
        let odometry = pose(line, fields, poses + 3)?;
        // Speeds, two safety distances and the turn axis are between the pose and the time.
        self.push(line, line.number(fields, poses + 11, SECONDS)?, Some(odometry), readings);
        Ok(())
    }

    fn ranges(
        &self,
        line: SourceLine<'_>,
        fields: &[&str],
        column: usize,
        count: usize,
    ) -> Result<Vec<f64>, ImportError> {
        if count == 0 || count > MAX_RANGES {
            return Err(line.error(&count.to_string(), column.saturating_sub(1), COUNT));
        }
        (column..column + count).map(|column| line.number(fields, column, "a range in metres")).collect()
    }

    fn seen(&self, beams: &Beams, ranges_m: &[f64], most_m: f64) -> Vec<f64> {
        let cut = |range_m: &f64| if *range_m >= most_m { f64::INFINITY } else { *range_m };
        seen(&self.mountings, beams, &ranges_m.iter().map(cut).collect::<Vec<_>>(), self.max_range_m)
    }

    fn range(&self, range_m: f64) -> Option<f64> {
        range(range_m, self.max_range_m)
    }
}

/// What each sensor of a ring would have seen of a laser's beams; NaN for nothing.
pub(super) fn seen(mountings: &[Mounting], beams: &Beams, ranges_m: &[f64], max_range_m: f64) -> Vec<f64> {
    let least = |mounting: &Mounting| -> Option<f64> {
        let bearing_deg = mounting.robot_from_sensor.theta_rad.to_degrees();
        let half_deg = mounting.half_angle_rad.to_degrees();
        beams.nearest(bearing_deg)?;
        let ends = [beams.clamped(bearing_deg - half_deg)?, beams.clamped(bearing_deg + half_deg)?];
        // A laser may count from left to right.
        let seen = ranges_m.get(*ends.iter().min()?..=*ends.iter().max()?)?;
        seen.iter().filter_map(|range_m| range(*range_m, max_range_m)).min_by(f64::total_cmp)
    };
    mountings.iter().map(|mounting| least(mounting).unwrap_or(f64::NAN)).collect()
}

/// A beam's range; infinity for nothing in range, none for no measurement.
fn range(range_m: f64, max_range_m: f64) -> Option<f64> {
    let is_nothing = range_m > max_range_m || range_m >= NOTHING_M;
    (range_m > 0.0).then_some(if is_nothing { f64::INFINITY } else { range_m })
}

const SECONDS: &str = "a time stamp in seconds";
const COUNT: &str = "the number of ranges, at least 1";

/// Three fields from `column`, from 0.
fn pose(line: SourceLine<'_>, fields: &[&str], column: usize) -> Result<Pose2, ImportError> {
    let field = |at, what| line.number(fields, column + at, what);
    Ok(Pose2::new(
        field(0, "the pose's x in metres")?,
        field(1, "the pose's y in metres")?,
        field(2, "the pose's theta in radians")?,
    ))
}

/// The directions of a laser's beams, from right to left.
pub(super) struct Beams {
    pub(super) first_deg: f64,
    pub(super) step_deg: f64,
    pub(super) count: usize,
}

impl Beams {
    /// FLASER: beams span the front half turn. For an odd n beam i points at −90° + i · 180°/(n − 1), for an even n at
    /// −90° + (i + ½) · 180°/n.
    fn half_turn(count: usize) -> Self {
        let (first_deg, steps) = if count % 2 == 1 { (-90.0, count - 1) } else { (-90.0 + 90.0 / count as f64, count) };
        Self { first_deg, step_deg: 180.0 / steps.max(1) as f64, count }
    }

    /// The beam nearest to a bearing; none if it is past the beams.
    pub(super) fn nearest(&self, bearing_deg: f64) -> Option<usize> {
        let last_deg = self.first_deg + self.step_deg * self.count.checked_sub(1)? as f64;
        let past_deg = PAST_DEG + 0.5 * self.step_deg.abs();
        let is_seen = (self.first_deg.min(last_deg) - past_deg..=self.first_deg.max(last_deg) + past_deg)
            .contains(&bearing_deg)
            || self.count == 1;
        if is_seen { self.clamped(bearing_deg) } else { None }
    }

    /// The same, with the outermost beams for everything past them.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the beams there are")]
    pub(super) fn clamped(&self, bearing_deg: f64) -> Option<usize> {
        let last = self.count.checked_sub(1)? as f64;
        let index = if self.step_deg == 0.0 { 0.0 } else { (bearing_deg - self.first_deg) / self.step_deg };
        Some(index.round().clamp(0.0, last) as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn beams_are_the_nearest() {
        let nearest = |bearing_deg, count| Beams::half_turn(count).nearest(bearing_deg);
        assert_eq!(nearest(-90.0, 181), Some(0));
        assert_eq!(nearest(0.0, 181), Some(90));
        assert_eq!(nearest(11.25, 361), Some(203));
        assert_eq!(nearest(90.0, 180), Some(179));
        assert_eq!(nearest(-90.0, 360), Some(0));
        assert_eq!(nearest(-89.7, 360), Some(0));
        assert_eq!(nearest(101.25, 360), None);
        assert_eq!(nearest(0.0, 1), Some(0));
        let whole = Beams { first_deg: -135.0, step_deg: 0.25, count: 1081 };
        assert_eq!((whole.nearest(-135.2), whole.nearest(135.0), whole.nearest(150.0)), (Some(0), Some(1080), None));
    }
}
