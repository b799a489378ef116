//! `cargo xtask sensor-faults`: what broken sensors and encoders cost.
//!
//! Each drive is compared with the drive of the same seed without faults. Prints Markdown tables.

use crate::seeds::Seeds;
use indicatif::ProgressBar;
use slamd_core::{EncoderState, SensorState};
use slamd_metrics::quantile;
use slamd_sim::fault::SensorFault;
use slamd_testkit::broken::{Drive, Outcome, Slip};
use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Measure what broken sensors and encoders cost
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Seeds of the drives: tune on 1-20, report on 101-120
    #[arg(long, default_value = "101-120")]
    seeds: Seeds,
    /// Length of each drive
    #[arg(long, default_value_t = 120.0)]
    seconds: f64,
    /// Only one of the three parts
    #[arg(long)]
    only: Option<Part>,
    /// Only rows whose names contain this text
    #[arg(long, default_value = "")]
    row: String,
    /// Print each drive
    #[arg(long)]
    verbose: bool,
}

/// A part of the tables.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Part {
    /// Broken sensors.
    Sensors,
    /// Broken encoders.
    Encoders,
    /// Whole encoders, on which every verdict is false.
    Ordinary,
}

/// A row of a table: what it is called, and its drives.
struct Row {
    name: String,
    drives: Vec<Drive>,
}

/// From when on what breaks in the middle is broken, seconds.
const LATE_S: f64 = 40.0;
const KINDS: [&str; 4] = ["saturated", "missing", "noisy", "stuck"];

pub(crate) fn run(options: &Options) {
    let (seeds, seconds) = (options.seeds.0.clone(), options.seconds);
    let is_asked = |part: Part| options.only.is_none_or(|only| only == part);
    let drives = |world, sensors, odometry_errors| {
        let drive = |seed: u64| Drive { world, sensors, odometry_errors, ..Drive::flat(seed, seconds) };
        seeds.clone().map(drive).collect::<Vec<Drive>>()
    };
    for sensors in [32, 16] {
        let whole = drives("flat", sensors, 1.0);
        if is_asked(Part::Sensors) {
            println!("\n{sensors} sensors in the flat, drives of {seconds:.0} s\n");
            compare(&whole, &asked(sensor_rows(&whole), options), options.verbose);
        }
        if is_asked(Part::Encoders) {
            println!("\nEncoders, {sensors} sensors in the flat, drives of {seconds:.0} s\n");
            compare(&whole, &asked(encoder_rows(&whole), options), options.verbose);
        }
    }
    if is_asked(Part::Ordinary) {
        println!("\nWhole encoders, drives of {seconds:.0} s\n");
        ordinary(&drives);
    }
}

/// The rows whose names contain what `--row` says.
fn asked(mut rows: Vec<Row>, options: &Options) -> Vec<Row> {
    rows.retain(|row| row.name.contains(&options.row));
    rows
}

/// Numbers without a pattern that follow from a seed.
fn shuffled(sensors: u8, seed: u64) -> Vec<u8> {
    let mut left: Vec<u8> = (0..sensors).collect();
    let mut state = seed;
    let mut draw = |below: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        usize::try_from(state >> 33).unwrap_or_default() % below
    };
    std::iter::from_fn(|| (!left.is_empty()).then(|| left.swap_remove(draw(left.len())))).collect()
}

fn sensor_rows(whole: &[Drive]) -> Vec<Row> {
    let mut rows = Vec::new();
    let mut row = |name: String, broken: &dyn Fn(&Drive) -> Vec<(u8, &'static str)>, from_s: f64| {
        let breaks = |drive: &Drive| {
            let faults = broken(drive).into_iter().map(|(sensor, kind)| fault(sensor, kind, from_s)).collect();
            Drive { sensor_faults: faults, ..drive.clone() }
        };
        rows.push(Row { name, drives: whole.iter().map(breaks).collect() });
    };
    for kind in KINDS {
        let one = |drive: &Drive| vec![(shuffled(drive.sensors, drive.seed)[0], kind)];
        row(format!("one {kind}"), &one, LATE_S);
    }
    for kind in KINDS {
        let eight = |drive: &Drive| shuffled(drive.sensors, drive.seed)[..8].iter().map(|&s| (s, kind)).collect();
        row(format!("8 {kind}"), &eight, LATE_S);
    }
    let mixed = |drive: &Drive| {
        let sensors = shuffled(drive.sensors, drive.seed);
        sensors[..8].iter().zip(KINDS.iter().cycle()).map(|(&sensor, &kind)| (sensor, kind)).collect()
    };
    row("8 of all kinds".into(), &mixed, LATE_S);
    row("8 of all kinds, from the start".into(), &mixed, 0.0);
    for (from_s, when) in [(LATE_S, ""), (0.0, ", from the start")] {
        for kind in KINDS {
            let half = |drive: &Drive| (1..drive.sensors / 2).map(|sensor| (sensor, kind)).collect();
            row(format!("left side {kind}{when}"), &half, from_s);
        }
    }
    rows
}

fn fault(sensor: u8, kind: &str, from_s: f64) -> SensorFault {
    SensorFault { sensor, kind: kind.parse().expect("a kind"), from_s, until_s: f64::INFINITY }
}

fn encoder_rows(whole: &[Drive]) -> Vec<Row> {
    let mut rows = Vec::new();
    for (from_s, when) in [(LATE_S, ""), (0.0, ", from the start")] {
        for (wheel, kind) in [("left", "dead"), ("right", "dead"), ("left", "reversed"), ("right", "reversed")] {
            let fault = format!("{wheel}:{kind}@{from_s}").parse().expect("a fault");
            let breaks = |drive: &Drive| Drive { encoder_faults: vec![fault], ..drive.clone() };
            rows.push(Row { name: format!("{wheel} {kind}{when}"), drives: whole.iter().map(breaks).collect() });
        }
    }
    rows
}

/// Runs all drives on all cores.
fn run_all(drives: &[&Drive]) -> Vec<Outcome> {
    let (next, bar) = (AtomicUsize::new(0), ProgressBar::new(drives.len() as u64));
    let outcomes = Mutex::new(BTreeMap::new());
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..cores {
            scope.spawn(|| {
                loop {
                    let place = next.fetch_add(1, Ordering::Relaxed);
                    let Some(drive) = drives.get(place) else { break };
                    let outcome = drive.run();
                    outcomes.lock().expect("no drive panics").insert(place, outcome);
                    bar.inc(1);
                }
            });
        }
    });
    bar.finish_and_clear();
    outcomes.into_inner().expect("no drive panics").into_values().collect()
}

fn compare(whole: &[Drive], rows: &[Row], is_verbose: bool) {
    let drives: Vec<&Drive> = whole.iter().chain(rows.iter().flat_map(|row| &row.drives)).collect();
    let mut outcomes = run_all(&drives);
    let broken = outcomes.split_off(whole.len());
    println!(
        "| broken | found | latency s, median / p90 | ATE m, median | error m, median / p90 / worst | ratio to whole, median / p90 | worse | of their sweeps that are off, said | false alarms |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for (row, outcomes_of) in rows.iter().zip(broken.chunks(whole.len())) {
        print_row(row, outcomes_of, &outcomes, is_verbose);
    }
    let of = |error: fn(&Outcome) -> f64| outcomes.iter().map(error).collect::<Vec<f64>>();
    let (ates, errors) = (of(|outcome| outcome.ate_m), of(|outcome| outcome.rms_m));
    println!("\nwhole: ATE {:.3} m, median, error {}", quantile(&ates, 0.5), quantiles(&errors));
}

fn print_row(row: &Row, broken: &[Outcome], whole: &[Outcome], is_verbose: bool) {
    let (mut latencies_s, mut faults, mut alarms, mut worse) = (Vec::new(), 0, 0, 0);
    let (mut ratios, mut shares) = (Vec::new(), Vec::new());
    for ((drive, outcome), whole) in row.drives.iter().zip(broken).zip(whole) {
        faults += drive.sensor_faults.len() + drive.encoder_faults.len();
        latencies_s.extend(found_s(drive, outcome));
        alarms += false_alarms(drive, outcome);
        let ratio = outcome.rms_m / whole.rms_m;
        ratios.push(ratio);
        if outcome.is_worse_than(whole) {
            worse += 1;
            shares.extend(outcome.covered(whole));
        }
        if is_verbose {
            eprintln!("{} {}: ratio {ratio:.2}, covered {:?}", row.name, drive.seed, outcome.covered(whole));
            let words = |lock: &slamd_core::LocalizationEvent| format!("{:.1} {:?}", lock.at.seconds(), lock.change);
            eprintln!("    {:?}", outcome.locks.iter().map(words).collect::<Vec<_>>());
            let words = |e: &slamd_core::EncoderEvent| format!("{:.1} {:?} {:?}", e.at.seconds(), e.wheel, e.state);
            eprintln!("    {:?}", outcome.encoders.iter().map(words).collect::<Vec<_>>());
        }
    }
    let of = |error: fn(&Outcome) -> f64| broken.iter().map(error).collect::<Vec<f64>>();
    let said = if shares.is_empty() {
        "-".into()
    } else {
        format!("{:.2} / {:.2}", quantile(&shares, 0.0), quantile(&shares, 0.5))
    };
    println!(
        "| {} | {} of {faults} | {:.1} / {:.1} | {:.3} | {} | {:.2} / {:.2} | {worse} of {} | {said} | {alarms} |",
        row.name,
        latencies_s.len(),
        quantile(&latencies_s, 0.5),
        quantile(&latencies_s, 0.9),
        quantile(&of(|outcome| outcome.ate_m), 0.5),
        quantiles(&of(|outcome| outcome.rms_m)),
        quantile(&ratios, 0.5),
        quantile(&ratios, 0.9),
        broken.len(),
    );
}

/// Median, p90 and worst.
fn quantiles(errors_m: &[f64]) -> String {
    let [median, p90, worst] = [0.5, 0.9, 1.0].map(|share| quantile(errors_m, share));
    format!("{median:.3} / {p90:.3} / {worst:.3}")
}

/// Seconds from each fault until it was reported, of those that were.
fn found_s(drive: &Drive, outcome: &Outcome) -> Vec<f64> {
    let sensors = drive.sensor_faults.iter().filter_map(|fault| {
        let is_it = |sensor: usize| sensor == usize::from(fault.sensor);
        let told = outcome.faults.iter().filter(|told| is_it(told.sensor) && told.state != SensorState::Healthy);
        told.map(|told| told.at.seconds() - fault.from_s).find(|latency_s| *latency_s >= 0.0)
    });
    let encoders = drive.encoder_faults.iter().filter_map(|fault| {
        let told = outcome.encoders.iter().find(|told| is_right(drive, told))?;
        Some(told.at.seconds() - fault.from_s)
    });
    sensors.chain(encoders).collect()
}

/// Whether an encoder's verdict names what is broken.
fn is_right(drive: &Drive, told: &slamd_core::EncoderEvent) -> bool {
    drive.encoder_faults.iter().any(|fault| {
        let words = format!("{:?} {:?}", fault.wheel, fault.kind);
        told.state != EncoderState::Healthy
            && words == format!("{:?} {:?}", told.wheel, told.state)
            && told.at.seconds() >= fault.from_s
    })
}

fn false_alarms(drive: &Drive, outcome: &Outcome) -> usize {
    let is_broken = |sensor: usize| drive.sensor_faults.iter().any(|fault| usize::from(fault.sensor) == sensor);
    let sensors =
        outcome.faults.iter().filter(|told| told.state != SensorState::Healthy && !is_broken(told.sensor)).count();
    sensors + outcome.encoders.iter().filter(|told| !is_right(drive, told)).count()
}

/// Drives on whole encoders: every verdict is a false one.
fn ordinary(drives: &dyn Fn(&'static str, u8, f64) -> Vec<Drive>) {
    println!("| world | sensors | odometry | drives | verdicts on encoders |");
    println!("|---|---|---|---|---|");
    let report = |name: &str, sensors: u8, odometry: &str, drives: &[Drive]| {
        let outcomes = run_all(&drives.iter().collect::<Vec<_>>());
        let verdicts: usize = outcomes.iter().map(|outcome| outcome.encoders.len()).sum();
        for (drive, outcome) in drives.iter().zip(&outcomes).filter(|(_, outcome)| !outcome.encoders.is_empty()) {
            eprintln!("{name} {}: {:?}", drive.seed, outcome.encoders);
        }
        println!("| {name} | {sensors} | {odometry} | {} | {verdicts} |", drives.len());
    };
    for world in ["flat", "office", "furnished", "home", "room"] {
        for (sensors, odometry_errors) in [(32, 1.0), (32, 3.0), (16, 1.0), (8, 1.0)] {
            report(world, sensors, &odometry_errors.to_string(), &drives(world, sensors, odometry_errors));
        }
    }
    let slips = [("both wheels slip 0.5 m", [0.5, 0.5]), ("left wheel slips 0.5 m", [0.5, 0.0])];
    for (name, metres) in slips {
        let slip = Some(Slip { at_s: LATE_S, metres });
        let drives: Vec<Drive> = drives("flat", 32, 1.0).into_iter().map(|drive| Drive { slip, ..drive }).collect();
        report(name, 32, "1", &drives);
    }
}
