//! `cargo bench --no-default-features --bench reliability [-- --part 0.1]`: tries every promise, first by its test, then by its bench for longer, and
//! writes `docs/reliability.md`.
//!
//! `--part` is the part of the benches' full length to run; `-- --short` runs the tests only and prints the table. One promise
//! that is not kept makes it fail.

mod options;

use indicatif::ProgressBar;
use slamd_testkit::promises::{LONG, PROMISES, Promise};
use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;

/// What a run of cargo said, and whether it succeeded.
struct Outcome {
    is_kept: bool,
    said: String,
    seconds: f64,
}

#[expect(clippy::disallowed_methods, reason = "a bench has a clock")]
fn cargo(arguments: &[&str]) -> Outcome {
    let begin = Instant::now();
    let mut command = Command::new(env!("CARGO"));
    let output = command.args(arguments).stderr(Stdio::inherit()).output().expect("cargo runs");
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    Outcome { is_kept: output.status.success(), said, seconds: begin.elapsed().as_secs_f64() }
}

/// A promise's test, in the profile that CI tests in. What needs the viewer is built with it.
fn test(promise: &Promise) -> Outcome {
    let (file, name) = promise.test;
    let mut arguments = vec!["test", "--quiet", "--locked"];
    if file != "viewer" {
        arguments.push("--no-default-features");
    }
    arguments.extend(["--test", file, "--", "--exact", name, "--nocapture"]);
    let mut outcome = cargo(&arguments);
    // A name that no test has would pass, too.
    outcome.is_kept &= outcome.said.contains(" 1 passed");
    outcome
}

/// The figure that a test has printed: its last line that is not the harness's, where it is short enough for a table.
fn figure(said: &str) -> &str {
    let is_harness =
        |line: &str| line.is_empty() || ["running ", "test ", "."].iter().any(|word| line.starts_with(word));
    said.lines().map(str::trim).rfind(|line| !is_harness(line)).filter(|line| line.len() < 100).unwrap_or("")
}

fn table(outcomes: &[Outcome]) -> String {
    let mut text =
        String::from("| promise | kept by `cargo test --test` | for longer | | figure |\n|---|---|---|---|---|\n");
    for (promise, outcome) in PROMISES.iter().zip(outcomes) {
        let (file, name) = promise.test;
        let longer = promise.bench.map_or_else(String::new, |bench| format!("[{bench}](#{bench})"));
        let verdict = if outcome.is_kept { "kept" } else { "**broken**" };
        let figure = figure(&outcome.said);
        let _ = writeln!(text, "| {} | `{file} {name}` | {longer} | {verdict} | {figure} |", promise.says);
    }
    text
}

/// The benches for longer, each with what it printed.
fn longer(part: f64) -> (String, bool) {
    let (mut text, mut are_kept) = (String::new(), true);
    for (name, options) in LONG {
        let mut arguments = vec![String::from("--")];
        for (option, full) in options {
            arguments.extend([(*option).to_owned(), format!("{}", (full * part).ceil())]);
        }
        let mut command = vec!["bench", "--no-default-features", "--bench", name];
        command.extend(arguments.iter().map(String::as_str));
        eprintln!("cargo {}", command.join(" "));
        let outcome = cargo(&command);
        are_kept &= outcome.is_kept;
        let verdict = if outcome.is_kept { "Kept" } else { "**Broken**" };
        let _ = writeln!(
            text,
            "\n## {name}\n\n`cargo {}`: {verdict}, in {:.0} s.\n\n{}",
            command.join(" "),
            outcome.seconds,
            outcome.said.trim()
        );
    }
    (text, are_kept)
}

fn main() {
    let part: f64 = options::number("--part", 1.0);
    let bar = ProgressBar::new(PROMISES.len() as u64);
    let try_one = |promise: &Promise| {
        let outcome = test(promise);
        bar.inc(1);
        outcome
    };
    let outcomes: Vec<Outcome> = PROMISES.iter().map(try_one).collect();
    bar.finish_and_clear();
    let table = table(&outcomes);
    let seconds: f64 = outcomes.iter().map(|outcome| outcome.seconds).sum();
    print!("{table}");
    println!("{seconds:.0} s");
    let mut are_kept = outcomes.iter().all(|outcome| outcome.is_kept);
    if !options::has("--short") {
        let (longer, are_kept_longer) = longer(part);
        are_kept &= are_kept_longer;
        let text = format!(
            "# Reliability\n\nEach promise with what keeps it. Written by `cargo bench --no-default-features --bench reliability -- --part {part}`, which ran the \
             tests in {seconds:.0} s (CI runs them at each change) and the benches at {part} of their full length. What is promised of access from \
             outside is in [SECURITY.md](../SECURITY.md).\n\n{table}{longer}"
        );
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/reliability.md");
        std::fs::write(file, text).expect("docs/ can be written");
    }
    assert!(are_kept, "a promise is broken");
}
