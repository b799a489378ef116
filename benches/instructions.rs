//! `cargo bench --bench instructions`: how many instructions each stage takes, and whether any takes more than it did.
//!
//! Valgrind counts, so a busy machine changes nothing. More than 5 % above `benches/instructions.toml` fails. A figure that changes for a reason
//! is accepted with `cargo bench --bench performance -- --accept`. Needs valgrind and `gungraun-runner` of the library's version.

#![allow(missing_docs, reason = "what the macros make has none")]

mod workload;

use gungraun::prelude::*;
use gungraun::{Callgrind, EventKind};
use slamd_core::Method;
use std::hint::black_box;
use workload::Drive;

/// What was accepted: instructions per capture.
const ACCEPTED: &str = include_str!("instructions.toml");
/// A stage may take this much more than was accepted: compilers differ a little.
const TOLERANCE: f64 = 1.05;

/// Fails a bench that takes more than was accepted; one that has no figure yet is only counted.
fn accepted(bench: &str) -> LibraryBenchmarkConfig {
    let table: toml::Table = ACCEPTED.parse().expect("benches/instructions.toml is TOML");
    let mut config = LibraryBenchmarkConfig::default();
    // The caches of a simulated processor say little of a real one, and take half the time.
    let mut callgrind = Callgrind::with_args(["--cache-sim=no"]);
    if let Some(instructions) = table.get(bench).and_then(toml::Value::as_integer) {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count")]
        let most = (instructions as f64 * TOLERANCE) as u64;
        callgrind.hard_limits([(EventKind::Ir, most)]);
    }
    config.tool(callgrind);
    config
}

fn walls() -> Drive {
    Drive::load(workload::CAPTURES[1], Method::Walls)
}

/// One bench per stage, over the shorter capture.
macro_rules! stage {
    ($($name:ident),*) => {$(
        #[library_benchmark(config = accepted(stringify!($name)))]
        #[bench::walls(setup = walls)]
        fn $name(drive: Drive) -> Drive {
            black_box(drive.$name());
            drive
        }
    )*};
}

stage!(decode, align, pca, faults, hough, ekf, grid, publish);

#[library_benchmark]
#[bench::walls(args = (workload::CAPTURES[1], Method::Walls), setup = Drive::load, config = accepted("pipeline_walls"))]
#[bench::faults(args = (workload::CAPTURES[0], Method::Walls), setup = Drive::load, config = accepted("pipeline_faults"))]
#[bench::paper(args = (workload::CAPTURES[1], Method::Paper), setup = Drive::load, config = accepted("pipeline_paper"))]
fn pipeline(drive: Drive) -> Drive {
    black_box(drive.pipeline());
    drive
}

library_benchmark_group!(name = stages, benchmarks = [decode, align, pca, faults, hough, ekf, grid, publish, pipeline]);

main!(library_benchmark_groups = stages);
