//! `cargo xtask coverage`: the fuzz targets of `fuzz/`, guided by coverage.
//!
//! Each target begins with its seeds and with what earlier runs found. What reaches new code is minimised and kept in `fuzz/found/`, where
//! `tests/wire/fuzz.rs` tries it again at each change. A crash or a leak leaves its input in `target/fuzz/artifacts/` and makes the task fail.

use slamd_testkit::fuzzing::{Corpus, found};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;

/// Fuzz what reads foreign bytes, guided by coverage; needs cargo-fuzz and a nightly compiler
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Minutes, of all targets together
    #[arg(long, default_value_t = 120.0)]
    minutes: f64,
    /// Targets that run at the same time
    #[arg(long, default_value_t = 2)]
    at_once: usize,
    /// Only these targets
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    only: Vec<String>,
}

/// Limit of what is kept of a target, bytes.
const MAX_KEPT_BYTES: usize = 150_000;
/// libFuzzer's limits of an input: seconds and memory. `cargo xtask fuzz` tests the time that an input takes; on a busy computer an input
/// under a sanitizer took 10 s.
const LIMITS: [&str; 2] = ["-timeout=60", "-rss_limit_mb=2048"];

fn folder() -> PathBuf {
    slamd_testkit::root().join("target/fuzz")
}

/// Builds the targets with their sanitizer.
pub(crate) fn build() {
    let mut cargo = Command::new("cargo");
    cargo.args(["+nightly", "fuzz", "build", "--fuzz-dir", "fuzz", "--target-dir"]).arg(folder());
    let status = cargo.current_dir(slamd_testkit::root()).status();
    assert!(
        status.is_ok_and(|status| status.success()),
        "the fuzz targets were not built: `cargo install --locked cargo-fuzz` and `rustup toolchain install nightly`"
    );
}

/// What a target's run gave.
struct Report {
    row: String,
    is_sound: bool,
}

/// The number behind a word in libFuzzer's lines, of the last line that has it.
fn number(said: &str, word: &str) -> u64 {
    let mut lines = said.lines().rev().filter_map(|line| line.split_once(word));
    let digits = lines.next().map_or("", |(_, rest)| rest.trim_start());
    digits.split(|c: char| !c.is_ascii_digit()).next().unwrap_or_default().parse().unwrap_or_default()
}

fn write(folder: &Path, inputs: &[Vec<u8>]) {
    std::fs::create_dir_all(folder).expect("target/ can be written");
    for (i, input) in inputs.iter().enumerate() {
        std::fs::write(folder.join(format!("{i:05}")), input).expect("target/ can be written");
    }
}

fn read(folder: &Path) -> Vec<Vec<u8>> {
    let entries = std::fs::read_dir(folder).expect("a folder");
    let mut inputs: Vec<_> =
        entries.map(|entry| std::fs::read(entry.expect("an entry").path()).expect("an input")).collect();
    inputs.sort_by(|a, b| a.len().cmp(&b.len()).then_with(|| a.cmp(b)));
    inputs
}

fn fuzz(target: &str, seeds: &[Vec<u8>], seconds: f64) -> Report {
    let program = folder().join("x86_64-unknown-linux-gnu/release").join(target);
    let of_target = |kind: &str| folder().join(kind).join(target);
    let (corpus, start, merged) = (of_target("corpus"), of_target("start"), of_target("merged"));
    for old in [&corpus, &start, &merged] {
        let _ = std::fs::remove_dir_all(old);
        std::fs::create_dir_all(old).expect("target/ can be written");
    }
    std::fs::create_dir_all(of_target("artifacts")).expect("target/ can be written");
    let kept = found(target);
    write(&start, &[seeds, &kept[..]].concat());
    let run = |arguments: &[String], folders: &[&Path]| {
        let mut command = Command::new(&program);
        command.args(LIMITS).arg(format!("-artifact_prefix={}/", of_target("artifacts").display()));
        let output = command.args(arguments).args(folders).stdin(Stdio::null()).output();
        let output = output.unwrap_or_else(|error| panic!("{}: {error}: not built", program.display()));
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        let _ = std::fs::write(of_target("artifacts").join("said.txt"), &said);
        (output.status.success(), said)
    };
    let limit = format!("-max_total_time={}", seconds.ceil());
    let (is_sound, said) = run(&[limit, "-print_final_stats=1".into()], &[&corpus, &start]);
    let first = said.lines().find(|line| line.contains("INITED")).unwrap_or_default();
    let (before, after) = (number(first, "cov: "), number(&said, " cov: "));
    let _ = run(&["-merge=1".into()], &[&merged, &start, &corpus]);
    let mut inputs: Vec<_> = read(&merged).into_iter().filter(|input| !seeds.contains(input)).collect();
    let mut bytes = 0;
    inputs.retain(|input| {
        bytes += input.len() + 4;
        bytes <= MAX_KEPT_BYTES
    });
    let size = slamd_testkit::fuzzing::keep(target, &inputs);
    let row = format!(
        "| {target} | {:.0} | {} | {before} | {after} | {} | {size} | {} |",
        seconds / 60.0,
        number(&said, "stat::number_of_executed_units:"),
        inputs.len(),
        if is_sound { "none" } else { "**yes**" }
    );
    Report { row, is_sound }
}

pub(crate) fn run(options: &Options, as_built: bool) {
    if !as_built {
        build();
    }
    let mut waiting = Corpus::build().seeds().to_vec();
    waiting.retain(|(target, _)| options.only.is_empty() || options.only.iter().any(|name| name == target));
    let seconds = 60.0 * options.minutes / waiting.len().max(1) as f64;
    waiting.reverse();
    let (waiting, reports) = (Mutex::new(waiting), Mutex::new(Vec::new()));
    std::thread::scope(|scope| {
        for _ in 0..options.at_once {
            scope.spawn(|| {
                loop {
                    let Some((target, seeds)) = waiting.lock().expect("no panic").pop() else { return };
                    let report = fuzz(target, &seeds, seconds);
                    eprintln!("{}", report.row);
                    reports.lock().expect("no panic").push(report);
                }
            });
        }
    });
    let reports = reports.into_inner().expect("no panic");
    println!("{} targets at once\n", options.at_once);
    println!("| target | minutes | executions | edges at first | edges | inputs kept | bytes | crashes |");
    println!("|---|---|---|---|---|---|---|---|");
    reports.iter().for_each(|report| println!("{}", report.row));
    assert!(reports.iter().all(|report| report.is_sound), "an input crashes: target/fuzz/artifacts/");
}
