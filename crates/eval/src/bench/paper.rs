//! The paper's experiment by the paper's method: its Figures 1-5, its processing time, and where the method holds and where it breaks.

use super::case::Case;
use super::fleet::drive_all;
use super::machine;
use super::raw::raw_map;
use super::run::{Drive, Run, follow, simulate};
use crate::plot::{Curve, Plot, to_png};
use slamd_core::{Estimate, Method, Point, Pose2, wrap_angle};
use slamd_metrics::Pair;
use slamd_metrics::quantile;
use std::fmt::Write as _;
use std::io;

/// The paper's mean time per scan on its 2.6 GHz Core i7, milliseconds.
const PAPERS_MS: f64 = 2.95;
/// The drive of the figures.
const FIGURE_SEED: u64 = 101;
const FIGURE_SECONDS: f64 = 120.0;

/// The page and its pictures: names and PNG files.
#[derive(Debug)]
pub struct Page {
    /// The page, Markdown; its pictures are in the folder `folder`.
    pub markdown: String,
    /// File names and contents.
    pub pictures: Vec<(&'static str, Vec<u8>)>,
}

/// The drives behind the table of the page: every world, beam and odometry by both methods.
#[must_use]
pub fn cases() -> Vec<Case> {
    let choices = ["world=room,home,flat", "beam=point,cone", "odometry=0,1,3"];
    let choices = choices.map(|text| text.parse().expect("valid choices"));
    let cases = Case::rows(None, &choices).into_iter().flat_map(|case| {
        [Method::Paper, Method::Walls].map(|method| Case { method, seconds: FIGURE_SECONDS, ..case.clone() })
    });
    cases.collect()
}

/// Drives, draws and writes. Calls `done` after each drive; `folder` is where the page finds its pictures.
///
/// # Errors
/// Where a picture cannot be made.
pub fn page(seeds: &[u64], folder: &str, command: &str, done: impl Fn() + Sync) -> io::Result<Page> {
    let cases = cases();
    let runs = drive_all(&cases, seeds, |_, _| done()).map_err(io::Error::other)?;
    let room = figure_case("room");
    let world = room.load_world(FIGURE_SEED).map_err(io::Error::other)?;
    let (records, faults) = simulate(&room, &world, FIGURE_SEED);
    let (drive, _) = follow(&room, &world, &records, faults);
    let raw = drive.pipeline().ring().map(|ring| raw_map(&records, ring)).unwrap_or_default();
    let mut pictures = figures(&drive, raw)?;

    let home = figure_case("home");
    let world = home.load_world(FIGURE_SEED).map_err(io::Error::other)?;
    let (records, faults) = simulate(&home, &world, FIGURE_SEED);
    let (broken, _) = follow(&home, &world, &records, faults);
    pictures.push(("figure-6-breaks.png", to_png(&[map_plot("The same in the flat of 12 x 10 m", &broken)])?));
    let mut markdown = head(command, &drive, folder);
    markdown += &verdicts(&cases, &runs);
    Ok(Page { markdown, pictures })
}

fn figure_case(world: &str) -> Case {
    let choices = [format!("world={world}"), "beam=point".into()].map(|text| text.parse().expect("valid choices"));
    let case = Case::rows(None, &choices).swap_remove(0);
    Case { method: Method::Paper, seconds: FIGURE_SECONDS, ..case }
}

fn figures(drive: &Drive, raw: Vec<Point>) -> io::Result<Vec<(&'static str, Vec<u8>)>> {
    let raw = Plot {
        title: "Raw map: every reading, by the encoders alone".into(),
        x_label: "x [m]",
        y_label: "y [m]",
        dots: Some(("reading", raw)),
        ..Plot::default()
    };
    Ok(vec![
        ("figure-1-raw-map.png", to_png(&[raw])?),
        ("figure-2-theta.png", to_png(&[over_time("Heading", "theta [deg]", turned(drive))])?),
        ("figure-3-x.png", to_png(&[over_time("Position along x", "x [m]", series(drive, |pose| pose.x_m))])?),
        ("figure-4-y.png", to_png(&[over_time("Position along y", "y [m]", series(drive, |pose| pose.y_m))])?),
        ("figure-5-final-map.png", to_png(&[map_plot("Final map", drive)])?),
    ])
}

/// Poses of one pair in the frame of the first: true, estimated, measured by the encoders.
fn poses(first: &Pair<Estimate>, pair: &Pair<Estimate>) -> [Pose2; 3] {
    [
        first.truth.inverse() * pair.truth,
        first.estimate.pose.inverse() * pair.estimate.pose,
        first.estimate.odometry.inverse() * pair.estimate.odometry,
    ]
}

fn series(drive: &Drive, of: fn(Pose2) -> f64) -> [Vec<Point>; 3] {
    let mut series = [const { Vec::new() }; 3];
    for pair in &drive.pairs {
        for (points, pose) in series.iter_mut().zip(poses(&drive.pairs[0], pair)) {
            points.push(Point::new(pair.at.seconds(), of(pose)));
        }
    }
    series
}

/// Headings in degrees that go on beyond half a turn.
fn turned(drive: &Drive) -> [Vec<Point>; 3] {
    series(drive, |pose| pose.theta_rad).map(|points| {
        let (mut last_rad, mut sum_rad) = (0.0, 0.0);
        let unwrapped = points.into_iter().map(|point| {
            sum_rad += wrap_angle(point.y - last_rad);
            last_rad = point.y;
            Point::new(point.x, sum_rad.to_degrees())
        });
        unwrapped.collect()
    })
}

fn over_time(title: &str, y_label: &'static str, [truth, estimated, measured]: [Vec<Point>; 3]) -> Plot {
    Plot {
        title: title.into(),
        x_label: "time [s]",
        y_label,
        curves: vec![
            Curve { name: "measured (encoders)", rgb: MEASURED, is_dashed: false, points: measured },
            Curve { name: "estimated", rgb: ESTIMATED, is_dashed: false, points: estimated },
            Curve { name: "true", rgb: TRUE, is_dashed: true, points: truth },
        ],
        ..Plot::default()
    }
}

fn map_plot(title: &str, drive: &Drive) -> Plot {
    let mut path = [const { Vec::new() }; 2];
    for pair in &drive.pairs {
        let [truth, estimated, _] = poses(&drive.pairs[0], pair);
        path[0].push(truth.position());
        path[1].push(estimated.position());
    }
    let [truth, estimated] = path;
    Plot {
        title: title.into(),
        x_label: "x [m]",
        y_label: "y [m]",
        map: Some(drive.pipeline().raster()),
        curves: vec![
            Curve { name: "estimated path", rgb: ESTIMATED, is_dashed: false, points: estimated },
            Curve { name: "true path", rgb: TRUE, is_dashed: true, points: truth },
        ],
        ..Plot::default()
    }
}

/// What the page says before its table.
fn head(command: &str, drive: &Drive, folder: &str) -> String {
    let mean_ms = drive.sweeps_us.iter().sum::<f64>() / drive.sweeps_us.len() as f64 / 1000.0;
    let p99_ms = quantile(&drive.sweeps_us, 0.99) / 1000.0;
    let ratio = PAPERS_MS / mean_ms;
    let (sweeps, cpu) = (drive.sweeps_us.len(), machine::cpu());
    format!(
        "\
# The paper's experiment

Written by `{command}`; a change made by hand is lost.

32 ultrasonic sensors with point beams that saturate at 300 cm, 2 cm of noise; of these two always saturated, two without a measurement and
four with 20 to 80 cm of noise. A simulated room of 4.8 x 3.4 m with wheels off by 1 %, base by 2 % and slip; seed {FIGURE_SEED}, {FIGURE_SECONDS:.0} s.
`method = \"paper\"`: PCA over three instants, Hough heading, EKF position, binary grid of 1 cm. The paper gives neither its room nor its
path, so these are figures in its form, not copies of them.

**Time.** {mean_ms:.3} ms per sweep (99 %: {p99_ms:.3} ms) over {sweeps} sweeps on one core of {cpu}, from the bytes to the map; the paper
states {PAPERS_MS} ms per scan on a Core i7 of 2.6 GHz. That is {ratio:.1} times as fast, on another machine.

| Figure | |
|---|---|
| 1 raw map: saturated sensors draw arcs at 3 m, noisy ones a haze | ![raw map]({folder}/figure-1-raw-map.png) |
| 2 heading | ![theta over time]({folder}/figure-2-theta.png) |
| 3 x | ![x over time]({folder}/figure-3-x.png) |
| 4 y | ![y over time]({folder}/figure-4-y.png) |
| 5 final map | ![final map]({folder}/figure-5-final-map.png) |
| 6 the same method and beams in the flat of 12 x 10 m | ![final map of the flat]({folder}/figure-6-breaks.png) |

"
    )
}

/// Where the method holds and where it breaks: a table, and its words.
fn verdicts(cases: &[Case], runs: &[Vec<Run>]) -> String {
    let mut text = String::from(
        "\
## Where it holds and where it breaks

Odometry: scale of the wheels' errors, 0 is perfect, 1 usual. Lost: some position is more than 0.5 m off. The position is aligned at the
first pose only. \"Holds\": no drive is lost.

| world | beam | odometry | paper: ATE m, median / worst | heading RMSE deg, median | lost | faults, precision / recall | `walls`: ATE m, median / worst | lost | the paper's method |
|---|---|---|---|---|---|---|---|---|---|
",
    );
    let (mut holds, mut breaks) = (Vec::new(), Vec::new());
    for (cases, runs) in cases.chunks(2).zip(runs.chunks(2)) {
        let (case, [paper, walls]) = (&cases[0], [&runs[0], &runs[1]]);
        let all = |runs: &[Run], f: fn(&Run) -> f64| runs.iter().map(f).collect::<Vec<f64>>();
        let ate = |runs: &[Run], share| quantile(&all(runs, |run| run.accuracy.ate_m), share);
        let lost = |runs: &[Run]| runs.iter().filter(|run| run.is_ever_lost()).count();
        let faults = super::table::pooled(paper);
        let words = ["world", "beam", "odometry"].map(|key| case.value(key));
        let setting = format!("{} with {} beams and odometry {}", words[0], words[1], words[2]);
        let verdict = if lost(paper) == 0 { ("holds", &mut holds) } else { ("breaks", &mut breaks) };
        verdict.1.push(setting);
        let _ = writeln!(
            text,
            "| {} | {:.2} / {:.2} | {:.1} | {} of {} | {:.2} / {:.2} | {:.2} / {:.2} | {} of {} | {} |",
            words.join(" | "),
            ate(paper, 0.5),
            ate(paper, 1.0),
            quantile(&all(paper, |run| run.accuracy.heading_rmse_deg), 0.5),
            lost(paper),
            paper.len(),
            faults.precision().unwrap_or(f64::NAN),
            faults.recall().unwrap_or(f64::NAN),
            ate(walls, 0.5),
            ate(walls, 1.0),
            lost(walls),
            walls.len(),
            verdict.0,
        );
    }
    let list = |settings: &[String]| if settings.is_empty() { "nowhere".into() } else { settings.join("; ") };
    let _ = write!(text, "\nIt holds: {}.\n\nIt breaks: {}.\n{REASONS}", list(&holds), list(&breaks));
    text
}

/// Properties of the method itself, each kept by a test in `crates/paper/tests/paper.rs` or said where the code is.
const REASONS: &str = "
Why, as far as the method itself tells:

- The heading comes from lines alone, the encoders have no say in it, and the line that needs the least turn wins. Where a room is
  larger than the sensors reach, or a door opens another, there are sweeps with too few lines, and a turn that was missed is never made up for.
- An endpoint is taken to lie on the beam's axis. In a cone it lies wherever the nearest surface is, so that walls bend into arcs and
  lines are found where there are none.
- A sensor that always saturates is a row that never changes: it has no residual and is not found (recall of such sensors is 0).
- Healthy readings that jump from one surface to another look like noise to three instants: that is the low precision.
- Neither wheel ratio nor wheel base is estimated.

`walls`, the default, is what was made of this: see [accuracy.md](accuracy.md).
";

const MEASURED: [u8; 3] = [224, 140, 52];
const ESTIMATED: [u8; 3] = [38, 118, 204];
const TRUE: [u8; 3] = [24, 24, 32];
