//! Runs the methods on recordings of real robots: `cargo run --release --example real_data -- [DATA] [DOCS]`
//!
//! Reads the recordings in DATA (`../shared/data`), runs them through import and pipeline, and writes `real-data.md` and
//! `corridor.png` into DOCS (`docs`). Needs the program `xz`.

mod convert;

use convert::Failure;
use flate2::read::GzDecoder;
use slamd::source::replay::replay;
use slamd::source::session::Session;
use slamd_capture::CaptureReader;
use slamd_core::{Config, Driver, Event, Method, Pose2, Update, wrap_angle};
use slamd_eval::import::{Options, carmen, ring};
use slamd_files::OutputGuard;
use slamd_metrics::{Relation, RelationError, relation_error};
use std::fmt::Write as _;
use std::io::Read;
use std::path::Path;

fn main() -> Result<(), Failure> {
    let mut arguments = std::env::args().skip(1);
    let data = arguments.next().unwrap_or_else(|| "../shared/data".into());
    let docs = arguments.next().unwrap_or_else(|| "docs".into());
    let (data, docs) = (Path::new(&data), Path::new(&docs));
    let mut page = String::from(HEAD);
    page += RELATIONS;
    for (name, log, relations, reference) in [
        ("freiburg_079", "fr079_raw.clf.gz", "fr079.relations.gz", "fr079_reference.txt.gz"),
        ("intel_lab", "intel_raw.clf.gz", "intel.relations.gz", "intel_reference.txt.gz"),
    ] {
        let folder = data.join(name);
        let [log, relations, reference] = [log, relations, reference].map(|file| gunzip(&folder.join(file)));
        building(name, &log?, &relations?, &reference?, &mut page)?;
    }
    page += CLOSING;
    closing(data, &mut page)?;
    corridor(data, docs, &mut page)?;
    page += REASONS;
    std::fs::write(docs.join("real-data.md"), page)?;
    Ok(())
}

/// The estimated pose and the odometry pose at each sweep, with seconds on the capture's clock.
#[derive(Default)]
struct Run {
    poses: Vec<(f64, Pose2)>,
    odometry: Vec<(f64, Pose2)>,
}

impl Run {
    fn of(capture: &Path, config: &Config, method: Method) -> Result<Self, Failure> {
        let pipeline = slamd_paper::pipeline(&Config { method, ..config.clone() }, slamd_core::Start::Fresh)
            .expect("a fresh start has no saved state that could be refused");
        let (mut driver, mut run) = (Driver::new(pipeline), Self::default());
        for record in CaptureReader::open(capture)? {
            driver.feed(&record?, |_, update| run.see(update));
        }
        driver.end(|_, update| run.see(update));
        Ok(run)
    }

    fn see(&mut self, update: Update<'_>) {
        if let Update::Event(Event::Estimate(estimate)) = update {
            self.poses.push((estimate.at.seconds(), estimate.pose));
            self.odometry.push((estimate.at.seconds(), estimate.odometry));
        }
    }
}

/// Compares a laser log, as a ring of 17 single beams and of 17 cones, with its benchmark's relations.
fn building(name: &str, log: &str, relations: &str, reference: &str, page: &mut String) -> Result<(), Failure> {
    let relations: Vec<Relation> = relations.lines().filter_map(Relation::parse).collect();
    let lines = lines(log)?;
    let reference: Vec<(f64, Pose2)> = reference
        .lines()
        .filter_map(|line| match numbers(line)?[..] {
            [t_s, x, y, theta] => Some((t_s, Pose2::new(x, y, theta))),
            _ => None,
        })
        .collect();
    let mut row = |what: &str, error: Option<RelationError>| -> Result<(), Failure> {
        let error = error.ok_or("no relation is spanned")?;
        let ([metres, median_m], [degrees, median_deg]) = (error.translation_m, error.rotation_deg);
        writeln!(
            page,
            "| {name} | {what} | {} | {metres:.3} ({median_m:.3}) | {degrees:.2} ({median_deg:.2}) |",
            error.relations
        )?;
        Ok(())
    };
    for half_angle_deg in [0.0, 7.5] {
        let mut config = Config::from_toml(include_str!("../configs/carmen17.toml"))?;
        for sensor in &mut config.ring.sensors {
            sensor.half_angle_deg = half_angle_deg;
        }
        let folder = tempfile::tempdir()?;
        let capture = folder.path().join("log.mcap");
        let output = OutputGuard::new(true).output(&capture)?;
        let summary = carmen::read(log.as_bytes(), name, &config, &Options::default())?.write(output)?;
        eprintln!("{name}: {summary}");
        let cone = if half_angle_deg > 0.0 { "cones of ±7.5 degrees" } else { "single beams" };
        for method in [Method::Walls, Method::Paper] {
            let run = Run::of(&capture, &config, method)?;
            if half_angle_deg == 0.0 && matches!(method, Method::Walls) {
                let raw = sorted(lines.iter().map(|line| (line.stamp_s, line.odometry)).collect());
                row("raw odometry", relation_error(&raw, &relations))?;
                row("laser SLAM (GMapping), for scale", relation_error(&sorted(reference.clone()), &relations))?;
            }
            let poses = poses_at_lines(&run, &lines);
            row(&format!("{method:?}, {cone}"), relation_error(&poses, &relations))?;
        }
    }
    Ok(())
}

/// A log line with an odometry pose.
struct OdometryLine {
    /// The log's stamp, seconds, which may step back.
    stamp_s: f64,
    /// Time in the capture, seconds, which never steps back.
    capture_s: f64,
    odometry: Pose2,
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
        lines.push(OdometryLine { stamp_s, capture_s: last_s, odometry });
    }
    Ok(lines)
}

/// The pose at each line, on the log's clock: the pose of the last sweep plus the odometry since.
fn poses_at_lines(run: &Run, lines: &[OdometryLine]) -> Vec<(f64, Pose2)> {
    const SAME_S: f64 = 5e-4;
    let mut base: Option<(usize, Pose2)> = None;
    let mut poses = Vec::new();
    for line in lines {
        let sweep = run.poses.partition_point(|(at_s, _)| *at_s < line.capture_s + SAME_S);
        let Some((_, pose)) = sweep.checked_sub(1).and_then(|last| run.poses.get(last)) else { continue };
        if base.is_none_or(|(known, _)| known != sweep) {
            base = Some((sweep, *pose * line.odometry.inverse()));
        }
        if let Some((_, map_from_odometry)) = base {
            poses.push((line.stamp_s, map_from_odometry * line.odometry));
        }
    }
    sorted(poses)
}

fn sorted(mut poses: Vec<(f64, Pose2)>) -> Vec<(f64, Pose2)> {
    poses.sort_by(|a, b| a.0.total_cmp(&b.0));
    poses
}

/// The mines rover: the distance between start and end.
fn closing(data: &Path, page: &mut String) -> Result<(), Failure> {
    let file = data.join("mines_rover_exp1/exp1.dat.xz");
    let output = std::process::Command::new("xz").arg("-dc").arg(file).output()?;
    let mut csv = Vec::new();
    convert::mines(&String::from_utf8(output.stdout)?, &mut csv)?;
    let config = Config::from_toml(include_str!("../configs/mines21.toml"))?;
    let folder = tempfile::tempdir()?;
    let capture = folder.path().join("mines.mcap");
    let output = OutputGuard::new(true).output(&capture)?;
    ring::read(csv.as_slice(), "mines.csv", &config, &Options::default())?.write(output)?;
    let mut row = |what: String, poses: &[(f64, Pose2)]| -> Result<(), Failure> {
        let ([.., (_, end)], [(_, start), ..]) = (poses, poses) else { return Err("no poses".into()) };
        let moved = start.inverse() * *end;
        let (metres, degrees) = (libm::hypot(moved.x_m, moved.y_m), wrap_angle(moved.theta_rad).to_degrees());
        writeln!(page, "| {what} | {:.2}, {:.2} | {metres:.2} | {degrees:.1} |", moved.x_m, moved.y_m)?;
        Ok(())
    };
    for method in [Method::Walls, Method::Paper] {
        let run = Run::of(&capture, &config, method)?;
        if matches!(method, Method::Walls) {
            row("raw odometry".into(), &run.odometry)?;
        }
        row(format!("{method:?}"), &run.poses)?;
    }
    Ok(())
}

/// The corridor: its map.
fn corridor(data: &Path, docs: &Path, page: &mut String) -> Result<(), Failure> {
    let text = |file: &str| std::fs::read_to_string(data.join("corridor_sonar8").join(file));
    let mut csv = Vec::new();
    convert::corridor(&text("measurement.txt")?, &text("poses.txt")?, &mut csv)?;
    let config = Config::from_toml(include_str!("../configs/corridor8.toml"))?;
    let folder = tempfile::tempdir()?;
    let capture = folder.path().join("corridor.mcap");
    let output = OutputGuard::new(true).output(&capture)?;
    ring::read(csv.as_slice(), "corridor.csv", &config, &Options::default())?.write(output)?;
    let run = Run::of(&capture, &config, Method::Walls)?;
    let apart_m = run.poses.iter().zip(&run.odometry).map(|((_, pose), (_, odometry))| {
        let first = run.poses[0].1 * run.odometry[0].1.inverse();
        let moved = (first * *odometry).position() - pose.position();
        libm::hypot(moved.x, moved.y)
    });
    let farthest_m = apart_m.fold(0.0, f64::max);
    let mut session = Session::new(
        slamd_paper::pipeline(&config, slamd_core::Start::Fresh)
            .expect("a fresh start holds nothing that could be refused"),
        &folder.path().join("out"),
    )?;
    replay(&mut CaptureReader::open(&capture)?, &mut session, |_| {})?;
    session.finish()?;
    std::fs::copy(folder.path().join("out/map.png"), docs.join("corridor.png"))?;
    write!(page, "{CORRIDOR}")?;
    writeln!(page, "{} sweeps; the pose is never farther than {farthest_m:.2} m from the encoders'.", run.poses.len())?;
    Ok(())
}

fn gunzip(path: &Path) -> Result<String, Failure> {
    let mut text = String::new();
    let file = std::fs::File::open(path).map_err(|error| format!("{}: {error}", path.display()))?;
    GzDecoder::new(file).read_to_string(&mut text)?;
    Ok(text)
}

fn numbers(line: &str) -> Option<Vec<f64>> {
    line.split_whitespace().map(|word| word.parse().ok()).collect()
}

const HEAD: &str = "# Recordings of real robots\n
`cargo run --release --example real_data` makes this page and its picture from recordings that are not part of the project.\n";
const RELATIONS: &str = "\n## Two buildings: real odometry, rings cut from a real laser\n
The front half of a ring of 32 (17 sensors, the rear 15 are missing) is cut from the laser's beams and capped at 4 m: single beams, or as a model
of cones the least of the beams within ±7.5 degrees. **These are laser ranges, not sonar**: no beam is reflected away, none is echoed twice.
The error is that of the benchmark's relations: mean (median) of what is left of the motion between two instants. There are 17 ranges 4.5 times a second
(Freiburg) or 1.3 times a second (Intel) where the robot of this project has 32 ranges 10 times a second.\n
| recording | trajectory | relations | translation, m | rotation, degrees |\n|---|---|---|---|---|\n";
const CLOSING: &str = "\n## The mines rover: raw wheel ticks, 21 beams of a laser at 10 Hz\n
Where the robot is at the end, seen from the start. Nobody measured it; a robot that came back to its start would have 0.\n
| trajectory | x, y, m | distance, m | turn, degrees |\n|---|---|---|---|\n";
const CORRIDOR: &str = "\n## A corridor: eight sonars\n
![The corridor](corridor.png)\n
Real sonars and poses that look like plain odometry, from which the ticks are made. There is no truth. ";
const REASONS: &str = "\n## Why\n
What a comparison with the laser SLAM's poses and a look at the maps shows; where the cause is a guess, it says so.\n
- **Freiburg**: over short distances (the medians) the motion is as good as the encoders'; the position is lost early and stays wrong by what was lost,
  because nothing recognises a place that was seen before.
- **Intel** is lost in the first minutes: the robot turns round on the spot with less than two scans a second and comes out of it with a heading that
  is farther off than the check of the heading admits. Stamps that step back are not the reason: in the log's own order
  the raw odometry has the error that its benchmark has.
- Both hang by a thread: seeking the axis every 25, 50 or 100 sweeps, or in doubt only, moves the translational error between 2 and 5 m (Freiburg,
  cones) and between 3 and 12 m (Intel, single beams), with no order in it. One drive each says that the method is not made for them,
  not which setting is better.
- **The mines rover**: nobody knows where it ended, so that the table says how the trajectories differ and not which is right. They differ
  by metres from one setting to the next, too.
- **The corridor**: the first leg and the right angle come out; in the second leg, where hardly a beam meets a wall squarely, the path leans to one side. A third
  of the readings are new in each row, the others repeat an older one. Leaving the repeated ones out makes healthy sensors look dead.
- The paper's method is lost on all of them, as with wheels and beams that are not ideal.\n";
