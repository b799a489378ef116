//! Accuracy over worlds and seeds: `cargo bench --bench accuracy -- [--seeds 101-120] [--seconds 300] [--method walls|paper] [key=value ...]`
//!
//! Prints a Markdown table. Tune on seeds 1-20, report on 101-120.

use slamd::capture::Record;
use slamd::config::{Config, Method};
use slamd::event::{Event, Input, Output};
use slamd::metrics::{AccuracyMeter, FaultMeter, TrueFault};
use slamd::pipeline::Pipeline;
use slamd::sim::fault::FaultMix;
use slamd::sim::link::LinkFaults;
use slamd::sim::simulation::{SimConfig, Simulation, session};
use slamd::sim::sonar::BeamShape;
use slamd::sim::world::World;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// One run's result.
struct Run {
    ate_m: f64,
    ate_max_m: f64,
    heading_deg: f64,
    precision: f64,
    recall: f64,
}

/// One row of the table.
#[derive(Clone)]
struct Case {
    world: &'static str,
    mix: FaultMix,
    beam: BeamShape,
    sensors: u8,
    odometry_errors: f64,
}

fn run(case: &Case, method: Method, seed: u64, duration_s: f64) -> Run {
    let simulation = Simulation::new(SimConfig {
        world: World::named(case.world).expect("a built-in world"),
        seed,
        duration_s,
        mix: case.mix,
        faults: Vec::new(),
        beam: case.beam,
        sensors: case.sensors,
        odometry_errors: case.odometry_errors,
        clock_drift_ppm: 300.0,
        link: LinkFaults::default(),
    });
    let truth = simulation
        .faults()
        .iter()
        .map(|fault| fault.to_string().parse::<TrueFault>().expect("the words of both sides are the same"));
    let mut faults = FaultMeter::new(truth.collect());
    let mut pipeline = Pipeline::new(&Config { method, ..Config::default() });
    let mut meter = AccuracyMeter::default();
    for record in session(simulation) {
        match &record {
            Record::Received { at, bytes } => pipeline.handle(Input::Received { at: *at, bytes }),
            Record::Sent { at, bytes } => pipeline.handle(Input::Sent { at: *at, bytes }),
            Record::Truth { at, pose } => meter.truth(*at, *pose),
        }
        while let Some(output) = pipeline.poll_output() {
            match output {
                Output::Event(Event::Estimate(estimate)) => {
                    meter.estimate(estimate.at, estimate.pose);
                    faults.estimate(estimate.at);
                }
                Output::Event(Event::Fault(event)) => faults.fault(&event),
                _ => {}
            }
        }
    }
    let accuracy = meter.accuracy().expect("a run has estimates");
    let score = faults.score();
    Run {
        ate_m: accuracy.ate_m,
        ate_max_m: accuracy.ate_max_m,
        heading_deg: accuracy.heading_rmse_deg,
        precision: score.fault_precision.unwrap_or(f64::NAN),
        recall: score.fault_recall.unwrap_or(f64::NAN),
    }
}

/// The value at a share of the sorted values.
fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.retain(|value| value.is_finite());
    values.sort_by(f64::total_cmp);
    let last = values.len().saturating_sub(1) as f64;
    let place = (0..values.len()).find(|&place| place as f64 >= (share * last).round());
    place.map_or(f64::NAN, |place| values[place])
}

fn print_row(case: &Case, runs: &[Run]) {
    let all = |f: fn(&Run) -> f64| runs.iter().map(f).collect::<Vec<f64>>();
    let ate = all(|run| run.ate_m);
    println!(
        "| {} | {:?} | {:?} | {} | {} | {:.2} / {:.2} | {:.3} / {:.3} | {:.2} | {} of {} | {:.2} / {:.2} |",
        case.world,
        case.beam,
        case.mix,
        case.sensors,
        case.odometry_errors,
        quantile(all(|run| run.heading_deg), 0.5),
        quantile(all(|run| run.heading_deg), 0.9),
        quantile(ate.clone(), 0.5),
        quantile(ate.clone(), 0.9),
        quantile(all(|run| run.ate_max_m), 1.0),
        ate.iter().filter(|ate| **ate > 0.5).count(),
        ate.len(),
        quantile(all(|run| run.precision), 0.5),
        quantile(all(|run| run.recall), 0.5),
    );
}

fn option<'a>(arguments: &'a [String], name: &str, default: &'a str) -> &'a str {
    let place = arguments.iter().position(|argument| argument == name);
    place.and_then(|place| arguments.get(place + 1)).map_or(default, String::as_str)
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let (first, last) = option(&arguments, "--seeds", "101-120").split_once('-').expect("--seeds FIRST-LAST");
    let seeds: Vec<u64> = (first.parse().expect("a seed")..=last.parse().expect("a seed")).collect();
    let duration_s: f64 = option(&arguments, "--seconds", "300").parse().expect("seconds");
    let method = if option(&arguments, "--method", "walls") == "paper" { Method::Paper } else { Method::Walls };
    let usual = Case { world: "flat", mix: FaultMix::Paper, beam: BeamShape::Cone, sensors: 32, odometry_errors: 1.0 };
    let mut cases: Vec<Case> = ["flat", "office", "furnished"].map(|world| Case { world, ..usual.clone() }).into();
    if arguments.iter().any(|argument| argument == "--all") {
        cases.push(Case { beam: BeamShape::Point, ..usual.clone() });
        cases.push(Case { world: "furnished", beam: BeamShape::Point, ..usual.clone() });
        cases.push(Case { mix: FaultMix::None, ..usual.clone() });
        cases.push(Case { sensors: 16, ..usual.clone() });
        cases.push(Case { sensors: 8, mix: FaultMix::None, ..usual.clone() });
        cases.push(Case { odometry_errors: 3.0, ..usual.clone() });
    }
    println!(
        "| world | beam | faults | sensors | odometry errors | heading RMSE deg, median / p90 | ATE m, median / p90 | worst m | lost | precision / recall |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for case in &cases {
        let next = AtomicUsize::new(0);
        let runs = Mutex::new(Vec::new());
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        std::thread::scope(|scope| {
            for _ in 0..cores {
                scope.spawn(|| {
                    while let Some(&seed) = seeds.get(next.fetch_add(1, Ordering::Relaxed)) {
                        let run = run(case, method, seed, duration_s);
                        if std::env::var_os("VERBOSE").is_some() {
                            eprintln!("seed {seed}: ATE {:.3} m, heading {:.2} deg", run.ate_m, run.heading_deg);
                        }
                        runs.lock().expect("no run panics").push(run);
                    }
                });
            }
        });
        print_row(case, &runs.into_inner().expect("no run panics"));
    }
}
