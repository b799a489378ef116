//! Errors of a drive through a recording.

use slamd_capture::CaptureReader;
use slamd_core::stages::Params;
use slamd_core::{Config, Driver, Event, Pipeline, Pose2, SensorState, Start, Update};
use slamd_eval::import::{Options, carmen};
use slamd_files::OutputGuard;
use slamd_metrics::{Relation, RelationError, relation_error};
use std::collections::BTreeSet;
use std::error::Error;
use std::f64::consts::{FRAC_PI_2, PI};
use std::fmt::Write as _;
use std::io::Read as _;
use std::path::Path;
use std::process::Command;

pub(crate) type Failure = Box<dyn Error>;

/// Poses with their times, seconds, in the order of time.
type Trajectory = Vec<(f64, Pose2)>;

/// A recording of a laser and odometry.
pub(crate) struct Recording {
    pub(crate) name: &'static str,
    /// CARMEN text.
    log: String,
    relations: Vec<Relation>,
    /// Poses by laser SLAM with all beams, at most one per stamp.
    reference: Trajectory,
    /// The laser's position ahead of the wheels, metres.
    ahead_m: f64,
}

/// How well a trajectory fits.
#[derive(Debug)]
pub(crate) struct Figures {
    pub(crate) relations: Option<RelationError>,
    /// Root mean square distance from the reference, metres, aligned at the first pose.
    pub(crate) ate_first_m: Option<f64>,
    /// The same after the best rigid fit.
    pub(crate) ate_rigid_m: Option<f64>,
    /// Cells of 10 cm that a thousand returns of the laser occupy: the fewer, the sharper is the map.
    pub(crate) cells: f64,
    /// Sensors declared faulty, mean over the sweeps.
    pub(crate) faulty: f64,
    /// Times that the pose was declared lost or doubtful.
    pub(crate) doubts: usize,
}

/// The recordings in `data`, those that are there.
pub(crate) fn load(data: &Path) -> Result<Vec<Recording>, Failure> {
    let mut recordings = Vec::new();
    for (name, log, relations, reference) in [
        ("freiburg_079", "fr079_raw.clf.gz", "fr079.relations.gz", "fr079_reference.txt.gz"),
        ("intel_lab", "intel_raw.clf.gz", "intel.relations.gz", "intel_reference.txt.gz"),
    ] {
        let folder = data.join(name);
        if !folder.exists() {
            continue;
        }
        let reference = gunzip(&folder.join(reference))?;
        recordings.push(Recording {
            name,
            log: gunzip(&folder.join(log))?,
            relations: gunzip(&folder.join(relations))?.lines().filter_map(Relation::parse).collect(),
            reference: sorted(reference.lines().filter_map(stamped_pose).collect()),
            ahead_m: 0.0,
        });
    }
    for (name, log) in [("wean_hall 1", "robotdata1.log.xz"), ("wean_hall 4", "robotdata4.log.xz")] {
        let file = data.join("wean_hall").join(log);
        if file.exists() {
            let output = Command::new("xz").arg("-dc").arg(&file).output()?;
            let log = carmen_of_wean_hall(&String::from_utf8(output.stdout)?)?;
            recordings.push(Recording { name, log, relations: Vec::new(), reference: Vec::new(), ahead_m: 0.25 });
        }
    }
    Ok(recordings)
}

impl Recording {
    /// The odometry's figures.
    pub(crate) fn odometry(&self) -> Result<Figures, Failure> {
        let lines = lines(&self.log)?;
        let poses: Vec<Pose2> = lines.iter().map(|line| line.odometry).collect();
        Ok(self.figures(&lines, &poses, &Run::default()))
    }

    /// The figures of the default method with a ring of 17 beams, or of 17 cones.
    pub(crate) fn slamd(&self, half_angle_deg: f64, params: &Params) -> Result<Figures, Failure> {
        let (run, lines) = (self.replay(half_angle_deg, params)?, lines(&self.log)?);
        let poses = poses_at_lines(&run, &lines);
        let first = lines.len() - poses.len();
        Ok(self.figures(&lines[first..], &poses, &run))
    }

    fn figures(&self, lines: &[OdometryLine], poses: &[Pose2], run: &Run) -> Figures {
        let (mut cells, mut returns) = (BTreeSet::new(), 0.0);
        for (line, pose) in lines.iter().zip(poses) {
            for (beam, range_m) in line.ranges_m.iter().enumerate().filter(|(_, range_m)| **range_m < SHARP_M) {
                let bearing_rad = (PI / line.ranges_m.len() as f64).mul_add(beam as f64 + 0.5, -FRAC_PI_2);
                let laser = *pose * Pose2::new(self.ahead_m, 0.0, bearing_rad);
                let end = laser * Pose2::new(*range_m, 0.0, 0.0);
                #[expect(clippy::cast_possible_truncation, reason = "a cell's index")]
                cells.insert(((end.x_m * 10.0).floor() as i64, (end.y_m * 10.0).floor() as i64));
                returns += 1.0;
            }
        }
        let trajectory = sorted(lines.iter().zip(poses).map(|(line, pose)| (line.stamp_s, *pose)).collect());
        let paired = |(at_s, truth): &(f64, Pose2)| Some((pose_at(&trajectory, *at_s)?, *truth));
        let pairs: Vec<(Pose2, Pose2)> = self.reference.iter().filter_map(paired).collect();
        Figures {
            relations: relation_error(&trajectory, &self.relations),
            ate_first_m: ate_first(&pairs),
            ate_rigid_m: ate_rigid(&pairs),
            cells: 1000.0 * cells.len() as f64 / returns,
            faulty: run.faulty / run.sweeps.len().max(1) as f64,
            doubts: run.doubts,
        }
    }

    /// Imports the log as a capture and runs it.
    fn replay(&self, half_angle_deg: f64, params: &Params) -> Result<Run, Failure> {
        let mut config = Config::from_toml(include_str!("../../../configs/carmen17.toml"))?;
        for sensor in &mut config.ring.sensors {
            sensor.half_angle_deg = half_angle_deg;
            sensor.x_m = self.ahead_m;
        }
        let folder = tempfile::tempdir()?;
        let capture = folder.path().join("log.mcap");
        let output = OutputGuard::new(true).output(&capture)?;
        carmen::read(self.log.as_bytes(), self.name, &config, &Options::default())?.write(output)?;
        let pipeline = Pipeline::with_params(&config, Start::Fresh, slamd_paper::methods, params.clone())?;
        let (mut driver, mut run) = (Driver::new(pipeline), Run::default());
        for record in CaptureReader::open(&capture)? {
            driver.feed(&record?, |_, update| run.see(update));
        }
        driver.end(|_, update| run.see(update));
        Ok(run)
    }
}

/// Returns up to here tell how sharp a map is, metres.
const SHARP_M: f64 = 8.0;

/// What a replay says.
#[derive(Default)]
struct Run {
    sweeps: Vec<(f64, Pose2)>,
    faulty_now: BTreeSet<usize>,
    faulty: f64,
    doubts: usize,
}

impl Run {
    fn see(&mut self, update: Update<'_>) {
        match update {
            Update::Event(Event::Estimate(estimate)) => {
                self.faulty += self.faulty_now.len() as f64;
                self.sweeps.push((estimate.at.seconds(), estimate.pose));
            }
            Update::Event(Event::Fault(fault)) => {
                if fault.state == SensorState::Healthy {
                    self.faulty_now.remove(&fault.sensor);
                } else {
                    self.faulty_now.insert(fault.sensor);
                }
            }
            Update::Event(Event::Localization(change)) => self.doubts += usize::from(change.is_lost()),
            _ => {}
        }
    }
}

/// A log line with an odometry pose.
struct OdometryLine {
    /// The log's stamp, seconds, which may step back.
    stamp_s: f64,
    /// Time in the capture, seconds, which never steps back.
    capture_s: f64,
    odometry: Pose2,
    /// The laser's, from right to left; none in a line of odometry alone.
    ranges_m: Vec<f64>,
}

/// The odometry lines of a CARMEN log, in file order, with the same capture times as in the import.
fn lines(log: &str) -> Result<Vec<OdometryLine>, Failure> {
    let (mut lines, mut last_s): (Vec<OdometryLine>, f64) = (Vec::new(), 0.0);
    for line in log.lines() {
        let fields: Vec<&str> = line.split_whitespace().collect();
        let number = |column: usize| -> Result<f64, Failure> { Ok(fields.get(column).ok_or("a short line")?.parse()?) };
        let (pose, stamp) = match fields.first() {
            Some(&"ODOM") => (1, 7),
            Some(&"FLASER") => (fields.len().saturating_sub(6), fields.len().saturating_sub(3)),
            _ => continue,
        };
        let stamp_s = number(stamp)?;
        let since_s = stamp_s - lines.first().map_or(stamp_s, |first| first.stamp_s);
        last_s = if since_s < last_s { last_s + 1e-3 } else { since_s };
        let odometry = Pose2::new(number(pose)?, number(pose + 1)?, number(pose + 2)?);
        let ranges_m = match fields.get(2..pose.saturating_sub(3)).filter(|_| pose > 1) {
            Some(ranges) => ranges.iter().map(|field| field.parse()).collect::<Result<_, _>>()?,
            None => Vec::new(),
        };
        lines.push(OdometryLine { stamp_s, capture_s: last_s, odometry, ranges_m });
    }
    Ok(lines)
}

/// The pose at each line from the first sweep on: the pose of the last sweep plus the odometry since.
fn poses_at_lines(run: &Run, lines: &[OdometryLine]) -> Vec<Pose2> {
    const SAME_S: f64 = 5e-4;
    let mut base: Option<(usize, Pose2)> = None;
    let mut poses = Vec::new();
    for line in lines {
        let after = run.sweeps.partition_point(|(at_s, _)| *at_s < line.capture_s + SAME_S);
        let Some((_, pose)) = after.checked_sub(1).and_then(|last| run.sweeps.get(last)) else { continue };
        if base.is_none_or(|(known, _)| known != after) {
            base = Some((after, *pose * line.odometry.inverse()));
        }
        if let Some((_, map_from_odometry)) = base {
            poses.push(map_from_odometry * line.odometry);
        }
    }
    poses
}

/// CARMEN text of the corridors' own format: centimetres, and beams at −90, −89 … 89 degrees.
fn carmen_of_wean_hall(log: &str) -> Result<String, Failure> {
    let mut text = String::new();
    for line in log.lines() {
        let fields: Vec<f64> = line.split_whitespace().skip(1).map(str::parse).collect::<Result<_, _>>()?;
        let ([x_cm, y_cm, theta_rad, ..], Some(t_s)) = (&fields[..], fields.last()) else { continue };
        let pose = format!("{:.5} {:.5} {theta_rad:.6}", 0.01 * x_cm, 0.01 * y_cm);
        if line.starts_with('L') {
            let ranges = fields.get(6..186).ok_or("a laser line without 180 ranges")?;
            write!(text, "FLASER 181")?;
            ranges.iter().try_for_each(|range_cm| write!(text, " {:.3}", 0.01 * range_cm))?;
            // A line of an odd number of beams has one at each end.
            writeln!(text, " {:.3} {pose} {pose} {t_s:.6} log {t_s:.6}", 0.01 * ranges[179])?;
        } else {
            writeln!(text, "ODOM {pose} 0 0 0 {t_s:.6} log {t_s:.6}")?;
        }
    }
    Ok(text)
}

fn ate_first(pairs: &[(Pose2, Pose2)]) -> Option<f64> {
    let (pose, truth) = pairs.first()?;
    let truth_from_map = *truth * pose.inverse();
    let square = |(pose, truth): &(Pose2, Pose2)| (truth_from_map * *pose).position() - truth.position();
    Some((pairs.iter().map(|pair| square(pair).norm_squared()).sum::<f64>() / pairs.len() as f64).sqrt())
}

/// Horn's closed form in the plane.
fn ate_rigid(pairs: &[(Pose2, Pose2)]) -> Option<f64> {
    let count = pairs.len() as f64;
    let mean = |of: &dyn Fn(&(Pose2, Pose2)) -> f64| pairs.iter().map(of).sum::<f64>() / count;
    let centre =
        [mean(&|pair| pair.0.x_m), mean(&|pair| pair.0.y_m), mean(&|pair| pair.1.x_m), mean(&|pair| pair.1.y_m)];
    let apart = |(pose, truth): &(Pose2, Pose2)| {
        [pose.x_m - centre[0], pose.y_m - centre[1], truth.x_m - centre[2], truth.y_m - centre[3]]
    };
    let (mut sin, mut cos) = (0.0, 0.0);
    for [x, y, u, v] in pairs.iter().map(apart) {
        sin += x * v - y * u;
        cos += x * u + y * v;
    }
    let (sin, cos) = libm::sincos(libm::atan2(sin, cos));
    let square = |[x, y, u, v]: [f64; 4]| (cos * x - sin * y - u).powi(2) + (sin * x + cos * y - v).powi(2);
    (!pairs.is_empty()).then(|| (pairs.iter().map(|pair| square(apart(pair))).sum::<f64>() / count).sqrt())
}

/// The interpolated pose at a time; none before the first and after the last.
fn pose_at(poses: &Trajectory, at_s: f64) -> Option<Pose2> {
    let after = poses.partition_point(|(t_s, _)| *t_s < at_s);
    let (next_s, next) = poses.get(after)?;
    let Some((last_s, last)) = after.checked_sub(1).and_then(|before| poses.get(before)) else {
        return (*next_s <= at_s).then_some(*next);
    };
    let (part, moved) = ((at_s - last_s) / (next_s - last_s), last.inverse() * *next);
    Some(*last * Pose2::new(part * moved.x_m, part * moved.y_m, part * moved.theta_rad))
}

fn stamped_pose(line: &str) -> Option<(f64, Pose2)> {
    let numbers: Vec<f64> = line.split_whitespace().map(|word| word.parse().ok()).collect::<Option<_>>()?;
    match numbers[..] {
        [t_s, x, y, theta] => Some((t_s, Pose2::new(x, y, theta))),
        _ => None,
    }
}

fn sorted(mut poses: Trajectory) -> Trajectory {
    poses.sort_by(|a, b| a.0.total_cmp(&b.0));
    poses
}

fn gunzip(path: &Path) -> Result<String, Failure> {
    let mut text = String::new();
    let file = std::fs::File::open(path).map_err(|error| format!("{}: {error}", path.display()))?;
    flate2::read::GzDecoder::new(file).read_to_string(&mut text)?;
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rigid_fit_leaves_what_is_not_rigid() {
        let moved = Pose2::new(3.0, -2.0, 1.0);
        let truths = [Pose2::default(), Pose2::new(4.0, 0.0, 0.0), Pose2::new(4.0, 2.0, 0.0)];
        let mut pairs: Vec<(Pose2, Pose2)> = truths.iter().map(|truth| (moved * *truth, *truth)).collect();
        assert!(ate_rigid(&pairs).unwrap() < 1e-9 && ate_first(&pairs).unwrap() < 1e-9);
        pairs[2].0 = moved * Pose2::new(4.0, 2.3, 0.0);
        let (first, rigid) = (ate_first(&pairs).unwrap(), ate_rigid(&pairs).unwrap());
        assert!((first - (0.09f64 / 3.0).sqrt()).abs() < 1e-9 && rigid < first && rigid > 0.05, "{first} {rigid}");
        assert_eq!(ate_rigid(&[]), None);
    }

    #[test]
    fn corridors_become_a_carmen_log() {
        let ranges = vec!["150"; 180].join(" ");
        let text = format!("L 100 200 0.5 120 200 0.5 {ranges} 1.25\nO 101 200 0.5 1.5\n");
        let lines = lines(&carmen_of_wean_hall(&text).unwrap()).unwrap();
        assert_eq!((lines.len(), lines[0].ranges_m.len(), lines[1].ranges_m.len()), (2, 181, 0));
        assert!((lines[0].ranges_m[180] - 1.5).abs() < 1e-9 && (lines[1].odometry.x_m - 1.01).abs() < 1e-9);
        assert!((lines[1].stamp_s - 1.5).abs() < 1e-9);
    }
}
