//! Map quality over worlds and seeds: `cargo bench --bench mapping -- [--seeds 101-120] [--seconds 300] [--worlds flat,office,furnished]`
//!
//! Prints a Markdown table of precision and coverage (see `slamd::metrics::MapMeter`), median and the tenth percentile over the seeds:
//! with the map aligned at the first pose as the metric has it, and aligned as suits it best, which leaves out the first heading's error.
//! Tune on seeds 1-20, report on 101-120.

use slamd::capture::Record;
use slamd::config::Config;
use slamd::event::{Event, Input, Output};
use slamd::geometry::{Point, Pose2};
use slamd::mapping::cone::{Target, draw, mark_wall};
use slamd::mapping::grid::{Facing, OccupancyGrid};
use slamd::mapping::raster::Raster;
use slamd::metrics::{AccuracyMeter, MapMeter, MapQuality};
use slamd::pipeline::Pipeline;
use slamd::sim::fault::FaultMix;
use slamd::sim::link::LinkFaults;
use slamd::sim::simulation::{SimConfig, Simulation, session};
use slamd::sim::sonar::{BeamShape, MAX_RANGE_M};
use slamd::sim::world::World;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

struct Run {
    quality: MapQuality,
    aligned: MapQuality,
    ate_m: f64,
}

/// The score at the alignment near `world_from_map` that suits the map best: what remains is not the first pose's fault.
fn best_score(map: &MapMeter, raster: &Raster, world_from_map: Pose2) -> MapQuality {
    let merit = |quality: &MapQuality| quality.precision.unwrap_or(0.0) + quality.coverage.unwrap_or(0.0);
    let (mut best, mut quality) = (world_from_map, map.score(raster, world_from_map));
    for step_m in [0.08, 0.04, 0.02, 0.01] {
        for _ in 0..3 {
            for (x, y, turn) in [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)] {
                let by = |steps: i32| step_m * f64::from(steps);
                let pose = best * Pose2::new(by(x), by(y), 0.2 * by(turn));
                let tried = map.score(raster, pose);
                if merit(&tried) > merit(&quality) {
                    (best, quality) = (pose, tried);
                }
            }
        }
    }
    quality
}

fn run(world: &str, beam: BeamShape, seed: u64, duration_s: f64) -> Run {
    let world = World::named(world).expect("a built-in world");
    let walls = world.segments.iter().map(|segment| [segment.from, segment.to]).collect();
    let simulation = Simulation::new(SimConfig {
        world,
        seed,
        duration_s,
        mix: FaultMix::Paper,
        faults: Vec::new(),
        beam,
        sensors: 32,
        odometry_errors: 1.0,
        clock_drift_ppm: 300.0,
        link: LinkFaults::default(),
    });
    let mut pipeline = Pipeline::new(&Config::default());
    let (mut accuracy, mut map) = (AccuracyMeter::default(), MapMeter::new(walls, MAX_RANGE_M));
    for record in session(simulation) {
        match &record {
            Record::Received { at, bytes } => pipeline.handle(Input::Received { at: *at, bytes }),
            Record::Sent { at, bytes } => pipeline.handle(Input::Sent { at: *at, bytes }),
            Record::Truth { at, pose } => {
                accuracy.truth(*at, *pose);
                map.truth(*pose);
            }
        }
        while let Some(output) = pipeline.poll_output() {
            if let Output::Event(Event::Estimate(estimate)) = output {
                accuracy.estimate(estimate.at, estimate.pose);
            }
        }
    }
    let world_from_map = accuracy.world_from_map().expect("a run has estimates");
    let raster = pipeline.raster();
    let quality = map.score(&raster, world_from_map);
    let aligned = best_score(&map, &raster, world_from_map);
    Run { quality, aligned, ate_m: accuracy.accuracy().map_or(f64::NAN, |accuracy| accuracy.ate_m) }
}

/// The value at a share of the sorted values.
fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let place = (share * (values.len() as f64 - 1.0)).round();
    values.iter().zip(0..).find(|(_, at)| f64::from(*at) >= place).map_or(f64::NAN, |(value, _)| *value)
}

fn option<'a>(arguments: &'a [String], name: &str, default: &'a str) -> &'a str {
    let place = arguments.iter().position(|argument| argument == name);
    place.and_then(|place| arguments.get(place + 1)).map_or(default, String::as_str)
}

/// Microseconds of drawing one sweep of 32 cones in a room of 4 by 4 m: the least of many batches, one sensor in four clears.
#[expect(clippy::disallowed_methods, reason = "the time is the result")]
fn drawing_us() -> f64 {
    let mut grid = OccupancyGrid::new(0.05);
    let mut least_us = f64::INFINITY;
    for batch in 0..50 {
        let begin = std::time::Instant::now();
        for sweep in 0..100 {
            grid.revise();
            let x_m = 0.005 * f64::from(sweep + batch % 2) - 0.25;
            for sensor in 0..32 {
                let pose = Pose2::new(x_m, 0.0, f64::from(sensor) * std::f64::consts::TAU / 32.0);
                let (is_turn, is_wall) = ((sensor + sweep) % 4 == 0, sensor % 8 != 4);
                let point = pose.ahead(2.0);
                match (is_wall, is_turn) {
                    (true, false) => mark_wall(&mut grid, Point::new(2.0, point.y), Facing::X),
                    (true, true) => draw(&mut grid, pose, 0.218, 2.0, Target::Wall(point, Facing::X)),
                    (false, _) => draw(&mut grid, pose, 0.218, 2.0, Target::Something),
                }
            }
        }
        least_us = least_us.min(begin.elapsed().as_secs_f64() * 1e4);
    }
    least_us
}

fn print_row(world: &str, beam: BeamShape, runs: &[Run]) {
    let pair = |f: fn(&Run) -> Option<f64>, low: f64| {
        let values: Vec<f64> = runs.iter().map(|run| f(run).unwrap_or(0.0)).collect();
        format!("{:.3} / {:.3}", quantile(values.clone(), 0.5), quantile(values, low))
    };
    println!(
        "| {world} | {beam:?} | {} | {} | {} | {} | {} |",
        pair(|run| run.quality.precision, 0.1),
        pair(|run| run.quality.coverage, 0.1),
        pair(|run| run.aligned.precision, 0.1),
        pair(|run| run.aligned.coverage, 0.1),
        pair(|run| Some(run.ate_m), 0.9),
    );
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let (first, last) = option(&arguments, "--seeds", "101-120").split_once('-').expect("--seeds FIRST-LAST");
    let seeds: Vec<u64> = (first.parse().expect("a seed")..=last.parse().expect("a seed")).collect();
    let duration_s: f64 = option(&arguments, "--seconds", "300").parse().expect("seconds");
    println!("Drawing a sweep of 32 cones takes {:.1} us.\n", drawing_us());
    println!(
        "| world | beam | precision, median / p10 | coverage, median / p10 | precision, best aligned | coverage, best aligned | ATE m, median / p90 |"
    );
    println!("|---|---|---|---|---|---|---|");
    for world in option(&arguments, "--worlds", "flat,office,furnished").split(',') {
        for beam in [BeamShape::Cone, BeamShape::Point] {
            let (next, runs) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
            std::thread::scope(|scope| {
                for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
                    scope.spawn(|| {
                        while let Some(&seed) = seeds.get(next.fetch_add(1, Ordering::Relaxed)) {
                            let run = run(world, beam, seed, duration_s);
                            runs.lock().expect("no run panics").push(run);
                        }
                    });
                }
            });
            print_row(world, beam, &runs.into_inner().expect("no run panics"));
        }
    }
}
