//! `cargo xtask localize`: each seed maps a building, then starts at an unknown place in it. Prints a Markdown table.

#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "shares of a list")]

use crate::seeds::Seeds;
use slamd_testkit::known_building::{Outcome, remember, seek};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Start at unknown places of a known map
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Seeds of the drives: tune on 1-20, report on 101-120
    #[arg(long, default_value = "101-120")]
    seeds: Seeds,
    /// Length of each drive in the known building
    #[arg(long, default_value_t = 120.0)]
    seconds: f64,
    /// Only the rows that map this building
    #[arg(long)]
    world: Option<String>,
    /// Print each drive
    #[arg(long)]
    verbose: bool,
}

/// The building mapped, seconds of mapping, the building driven in, whether the robot can know where it is.
type Case = (&'static str, f64, &'static str, bool);

const CASES: [Case; 5] = [
    ("flat", 300.0, "flat", true),
    ("furnished", 300.0, "furnished", true),
    ("office", 900.0, "office", true),
    ("symmetrical", 120.0, "symmetrical", false),
    ("flat", 300.0, "furnished", false),
];

fn row((mapped, _, driven, _): Case, outcomes: &[Outcome]) {
    let mut times: Vec<f64> = outcomes.iter().filter_map(|outcome| outcome.found_after_s).collect();
    times.sort_by(f64::total_cmp);
    let within = times.iter().filter(|seconds| **seconds <= 60.0).count();
    let wrong = outcomes.iter().filter(|outcome| outcome.is_wrong()).count();
    let words = |quantile: f64| {
        let place = (quantile * times.len().saturating_sub(1) as f64).round() as usize;
        times.get(place).map_or_else(|| "-".into(), |seconds| format!("{seconds:.0}"))
    };
    let sum: f64 = outcomes.iter().map(|outcome| outcome.square_sum_m2).sum();
    let sweeps: f64 = outcomes.iter().map(|outcome| outcome.sweeps).sum();
    let worst = outcomes.iter().map(|outcome| outcome.worst_m).fold(0.0, f64::max);
    let unknown = outcomes.iter().filter(|outcome| outcome.said.iter().any(|said| said.contains("still unknown")));
    println!(
        "| {mapped} | {driven} | {within} of {} | {wrong} | {} / {} | {} | {:.3} | {worst:.2} |",
        outcomes.len(),
        words(0.5),
        words(0.9),
        unknown.count(),
        (sum / sweeps).sqrt(),
    );
}

pub(crate) fn run(options: &Options) {
    let seeds: Vec<u64> = options.seeds.0.clone().collect();
    let duration_s = options.seconds;
    let is_asked = |case: &Case| options.world.as_ref().is_none_or(|world| world == case.0);
    println!(
        "| mapped | driven in | found within 60 s of driving | wrong | seconds, median / p90 | said that it does not know | RMS m once found | worst m |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for case in CASES.into_iter().filter(is_asked) {
        let (mapped, mapping_s, driven, _) = case;
        let next = AtomicUsize::new(0);
        let outcomes = Mutex::new(Vec::new());
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        std::thread::scope(|scope| {
            for _ in 0..cores {
                scope.spawn(|| {
                    while let Some(&seed) = seeds.get(next.fetch_add(1, Ordering::Relaxed)) {
                        let known = remember(mapped, seed, mapping_s);
                        let outcome = seek(&known, driven, seed, duration_s);
                        if options.verbose {
                            eprintln!(
                                "{mapped} {seed}: worst {:.2} m, {:.0} deg: {:?}",
                                outcome.worst_m, outcome.worst_deg, outcome.said
                            );
                        }
                        outcomes.lock().expect("no run panics").push(outcome);
                    }
                });
            }
        });
        row(case, &outcomes.into_inner().expect("no run panics"));
    }
}
