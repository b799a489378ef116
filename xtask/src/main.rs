//! The long runs: what the tests try briefly, tried for minutes or hours; two of them write pages of `docs/`.
//!
//! `cargo xtask --help` lists them, `cargo xtask TASK --help` their options. Each prints Markdown on standard output and its progress on
//! standard error, and fails where a promise is broken.

mod coverage;
mod dead_man;
mod explore;
mod fuzz;
mod kill;
mod localize;
mod never_silent;
mod recordings;
mod reliability;
mod replug;
mod seeds;
mod sensor_faults;
mod simulation;
mod soak;
mod strangers;

use clap::{Parser, Subcommand};
use std::process::Command;

/// slamd's long runs
#[derive(Parser)]
#[command(bin_name = "cargo xtask")]
struct Arguments {
    #[command(subcommand)]
    task: Task,
    /// Take the programs that a task starts as they were built
    #[arg(long, global = true)]
    as_built: bool,
}

#[derive(Subcommand)]
enum Task {
    Kill(kill::Options),
    DeadMan(dead_man::Options),
    Strangers(strangers::Options),
    Replug(replug::Options),
    Fuzz(fuzz::Options),
    Coverage(coverage::Options),
    Simulation(simulation::Options),
    Soak(soak::Options),
    SensorFaults(sensor_faults::Options),
    Localize(localize::Options),
    NeverSilent(never_silent::Options),
    Explore(explore::Options),
    Reliability(reliability::Options),
    Recordings(recordings::Options),
}

/// Builds the program that a task starts, in this program's own profile, without the viewer.
fn build_slamd() {
    build_slamd_with(&[]);
}

/// The same with these options of Cargo.
fn build_slamd_with(options: &[&str]) {
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(["build", "--locked", "--no-default-features", "--package", "slamd", "--bin", "slamd"]).args(options);
    if !cfg!(debug_assertions) {
        cargo.arg("--release");
    }
    let root = slamd_testkit::root();
    let status = cargo.current_dir(root).status().expect("cargo runs");
    assert!(status.success(), "slamd was not built: {status}");
}

fn main() {
    let Arguments { task, as_built } = Arguments::parse();
    match &task {
        _ if as_built => {}
        Task::Kill(_) | Task::Replug(_) | Task::Soak(_) | Task::Reliability(_) => build_slamd(),
        // One build for both.
        Task::DeadMan(_) | Task::Strangers(_) => build_slamd_with(&["--features", "mqtt"]),
        _ => {}
    }
    match task {
        Task::Kill(options) => kill::run(&options),
        Task::DeadMan(options) => dead_man::run(&options),
        Task::Strangers(options) => strangers::run(&options),
        Task::Replug(options) => replug::run(&options),
        Task::Soak(options) => soak::run(&options),
        Task::Fuzz(options) => fuzz::run(&options),
        Task::Coverage(options) => coverage::run(&options, as_built),
        Task::Simulation(options) => simulation::run(&options),
        Task::SensorFaults(options) => sensor_faults::run(&options),
        Task::Localize(options) => localize::run(&options),
        Task::Explore(options) => explore::run(&options),
        Task::NeverSilent(options) => never_silent::run(&options),
        Task::Reliability(options) => reliability::run(&options, as_built),
        Task::Recordings(options) => recordings::run(&options),
    }
}
