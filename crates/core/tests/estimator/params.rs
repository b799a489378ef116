//! The constants of each stage reach it: in an unknown building, after a resume and in a known map.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd_capture::Record;
use slamd_core::{Config, Event, Pipeline, Raster, SavedState, Start, built_in, stages::Params};
use slamd_metrics::AccuracyMeter;
use slamd_sim::simulation::{SimConfig, Simulation, session};
use slamd_testkit::known_building::{feed, world};
use std::sync::LazyLock;

/// The worst position error of a varied run, metres.
const MAX_ATE_M: f64 = 0.3;

/// A minute through the flat; some sensors fail.
static DRIVE: LazyLock<Vec<Record>> = LazyLock::new(|| {
    let faults = ["5:noisy@12s", "12:missing@15s", "19:stuck@15s", "26:saturated@20s"];
    session(Simulation::new(SimConfig {
        faults: faults.map(|fault| fault.parse().unwrap()).into(),
        ..SimConfig::usual(world("flat"), 1, 60.0, 32)
    }))
    .collect()
});

/// What the default constants save after the drive, with the robot carried back to where the drive began.
static SAVED: LazyLock<Box<SavedState>> = LazyLock::new(|| {
    let mut pipeline = pipeline(Start::Fresh, Params::default());
    let run = run(&mut pipeline);
    let mut saved = pipeline.saved_state().unwrap();
    let [_, pose @ ..] = run.poses[0].map(f64::from_bits);
    saved.filter.robot[..3].copy_from_slice(&pose);
    Box::new(saved)
});

/// All that a run gives.
#[derive(Debug, PartialEq)]
struct Run {
    /// Time, x, y and heading of each pose, as bits.
    poses: Vec<[u64; 4]>,
    events: Vec<String>,
    raster: Raster,
    saved: Option<Vec<u8>>,
    ate_m: Option<f64>,
}

fn pipeline(start: Start, params: Params) -> Pipeline {
    Pipeline::with_params(&Config::default(), start, built_in, params).unwrap()
}

fn run(pipeline: &mut Pipeline) -> Run {
    let (mut poses, mut events, mut meter) = (Vec::new(), Vec::new(), AccuracyMeter::default());
    for record in DRIVE.iter() {
        let truth = feed(pipeline, record, |event| match event {
            Event::Estimate(estimate) => {
                let pose = estimate.pose;
                meter.estimate(estimate.at, pose);
                poses.push([estimate.at.seconds(), pose.x_m, pose.y_m, pose.theta_rad].map(f64::to_bits));
            }
            event => events.push(format!("{event:?}")),
        });
        if let Some(pose) = truth {
            meter.truth(record.at(), pose);
        }
    }
    let saved = pipeline.saved_state().map(|saved| postcard::to_allocvec(&saved).unwrap());
    let ate_m = meter.accuracy().map(|accuracy| accuracy.ate_m);
    Run { poses, events, raster: pipeline.raster(), saved, ate_m }
}

type Vary = fn(&mut Params);

/// One constant of a stage, a fifth more or less.
const ALIGN: Vary = |params| params.align.window_s *= 0.8;
const FAULT: Vary = |params| params.fault.declare *= 1.2;
const ORIENTATION: Vary = |params| params.orientation.directions.rho_step_m *= 1.2;
const POSITION: Vary = |params| params.position.beam.edge_sigma_rad *= 1.2;
const MAPPING: Vary = |params| params.mapping.free = -29;
const CEILING: Vary = |params| params.mapping.ceiling = 320;
const WALL_SLAM: Vary = |params| params.wall_slam.axis_sigma_rad *= 1.2;
const RESUME: Vary = |params| params.wall_slam.resume_sigma_m *= 1.2;
const LOCALIZE: Vary = |params| params.localize.search_m *= 0.8;

/// A varied run differs from the one with the defaults, still maps, and tells whether its poses differ.
fn differs(start: &Start, default: &Run, name: &str, vary: Vary) -> bool {
    let mut params = Params::default();
    vary(&mut params);
    let varied = run(&mut pipeline(start.clone(), params));
    println!("{name}: ATE {:.3?} m instead of {:.3?} m", varied.ate_m, default.ate_m);
    assert!(varied != *default, "{name}: the value does not reach its stage");
    assert!(varied.poses.len() > 200, "{name}: {} poses", varied.poses.len());
    assert!(varied.ate_m.unwrap() < MAX_ATE_M, "{name}: {:?} m", varied.ate_m);
    varied.poses != default.poses
}

#[test]
fn the_default_constants_are_those_of_a_plain_pipeline() {
    let plain = run(&mut Pipeline::new(&Config::default(), Start::Fresh).unwrap());
    assert!(plain.poses.len() > 400, "{} poses", plain.poses.len());
    assert!(plain.events.iter().any(|event| event.contains("Faulty")), "{:?}", plain.events);
    assert_eq!(plain, run(&mut pipeline(Start::Fresh, Params::default())));
}

#[test]
fn each_stage_takes_its_constants_in_an_unknown_building() {
    let default = run(&mut pipeline(Start::Fresh, Params::default()));
    let differs = |name, vary| differs(&Start::Fresh, &default, name, vary);
    for (name, vary) in
        [("align", ALIGN), ("orientation", ORIENTATION), ("position", POSITION), ("wall_slam", WALL_SLAM)]
    {
        assert!(differs(name, vary), "{name}: the trajectory is the same");
    }
    // These decide when a fault is declared and what is drawn; that hardly ever moves the robot.
    differs("fault", FAULT);
    differs("mapping", MAPPING);
}

#[test]
fn each_stage_takes_its_constants_after_a_resume() {
    let start = Start::Resume(SAVED.clone());
    let default = run(&mut pipeline(start.clone(), Params::default()));
    for (name, vary) in
        [("fault", FAULT), ("position", POSITION), ("mapping", MAPPING), ("ceiling", CEILING), ("wall_slam", RESUME)]
    {
        differs(&start, &default, name, vary);
    }
}

#[test]
fn each_stage_takes_its_constants_in_a_known_map() {
    let start = Start::Localize(SAVED.clone());
    let default = run(&mut pipeline(start.clone(), Params::default()));
    for (name, vary) in [("position", POSITION), ("wall_slam", WALL_SLAM), ("ceiling", CEILING), ("localize", LOCALIZE)]
    {
        differs(&start, &default, name, vary);
    }
}
