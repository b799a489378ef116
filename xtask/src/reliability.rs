//! `cargo xtask reliability`: tries every promise, first by its test, then by its long run, and writes `docs/reliability.md`.
//!
//! One promise that is not kept makes it fail.

use indicatif::ProgressBar;
use slamd_testkit::promises::{LONG, PROMISES, Promise};
use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::Instant;

/// Test every promise and write docs/reliability.md
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Part of the long runs' full length
    #[arg(long, default_value_t = 1.0)]
    part: f64,
    /// Only the tests; print the table, write nothing
    #[arg(long)]
    short: bool,
    /// Run nothing: rewrite the promises and the names of their tests, and leave verdicts and figures as they are
    #[arg(long, conflicts_with_all = ["part", "short"])]
    names: bool,
}

/// A program's output, and whether it succeeded.
struct Outcome {
    is_kept: bool,
    said: String,
    seconds: f64,
}

#[expect(clippy::disallowed_methods, reason = "a long run is timed")]
fn outcome(command: &mut Command) -> Outcome {
    let begin = Instant::now();
    let output = command.stderr(Stdio::inherit()).output().expect("it runs");
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    Outcome { is_kept: output.status.success(), said, seconds: begin.elapsed().as_secs_f64() }
}

/// The arguments of `cargo test` that choose a promise's test.
fn chosen(promise: &Promise) -> String {
    let (file, name) = promise.test;
    let mut folders = file.trim_end_matches(".rs").split('/').collect::<Vec<_>>();
    let module = folders.pop().unwrap_or_default();
    match folders[..] {
        ["tests", executable] => format!("-p slamd --test {executable} {module}::{name}"),
        ["crates", package, "tests", executable] => {
            format!("-p slamd-{package} --test {executable} {module}::{name}")
        }
        _ => panic!("{file}: a test is in tests/EXECUTABLE/ or crates/CRATE/tests/EXECUTABLE/"),
    }
}

/// A promise's test, in the profile that CI tests in. What needs the viewer is built with it.
fn test(promise: &Promise) -> Outcome {
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(["test", "--quiet", "--locked"]).current_dir(slamd_testkit::root());
    if !promise.test.0.ends_with("/viewer.rs") {
        cargo.arg("--no-default-features");
    }
    cargo.args(chosen(promise).split(' ')).args(["--", "--exact", "--nocapture"]);
    let mut outcome = outcome(&mut cargo);
    // A name that no test has would pass, too.
    outcome.is_kept &= outcome.said.contains(" 1 passed");
    outcome
}

/// The figure that a test has printed, as one table cell: its last line that is not the harness's, where it is short enough. A row of
/// a table becomes `name: value`.
fn figure(said: &str) -> String {
    let is_harness =
        |line: &str| line.is_empty() || ["running ", "test ", "."].iter().any(|word| line.starts_with(word));
    let line = said.lines().map(str::trim).rfind(|line| !is_harness(line)).filter(|line| line.len() < 100);
    line.unwrap_or("").trim_matches(['|', ' ']).replace(" | ", ": ")
}

const HEAD: &str = "| promise | kept by `cargo test` | for longer | | figure |\n|---|---|---|---|---|\n";

fn row(promise: &Promise, verdict: &str, figure: &str) -> String {
    let longer = promise.long_run.map_or_else(String::new, |task| format!("[{task}](#{task})"));
    format!("| {} | `{}` | {longer} | {verdict} | {figure} |\n", promise.says, chosen(promise))
}

fn table(outcomes: &[Outcome]) -> String {
    let rows = PROMISES.iter().zip(outcomes).map(|(promise, outcome)| {
        let verdict = if outcome.is_kept { "kept" } else { "**broken**" };
        row(promise, verdict, &figure(&outcome.said))
    });
    HEAD.to_owned() + &rows.collect::<String>()
}

/// The long runs, each with what it printed.
fn longer(part: f64) -> (String, bool) {
    let (mut text, mut are_kept) = (String::new(), true);
    for (name, options) in LONG {
        let mut arguments = vec![name.to_owned()];
        for (option, full) in options {
            arguments.extend([(*option).to_owned(), format!("{}", (full * part).ceil())]);
        }
        let line = format!("cargo xtask {}", arguments.join(" "));
        eprintln!("{line}");
        let outcome = outcome(Command::new(std::env::current_exe().expect("a program has a path")).args(arguments));
        are_kept &= outcome.is_kept;
        let verdict = if outcome.is_kept { "Kept" } else { "**Broken**" };
        let _ = writeln!(
            text,
            "\n## {name}\n\n`{line}`: {verdict}, in {:.0} s.\n\n{}",
            outcome.seconds,
            outcome.said.trim()
        );
    }
    (text, are_kept)
}

fn page() -> PathBuf {
    slamd_testkit::root().join("docs/reliability.md")
}

/// The page with the promises and their tests rewritten. The order of [`PROMISES`] is that of the rows.
fn with_names(page: &str) -> String {
    let (before, rest) = page.split_once("| promise |").expect("the page has its table");
    let (rows, after) = rest.split_once("\n\n").expect("the long runs follow");
    let told: Vec<&str> = rows.lines().skip(2).collect();
    assert_eq!(told.len(), PROMISES.len(), "promises came or went: only a whole run can tell how they fare");
    let rows = PROMISES.iter().zip(told).map(|(promise, told)| {
        let cells: Vec<&str> = told.trim_matches('|').split(" | ").map(str::trim).collect();
        let [.., verdict, figure] = cells[..] else { panic!("not a row: {told}") };
        row(promise, verdict, figure)
    });
    format!("{before}{HEAD}{}\n{after}", rows.collect::<String>())
}

pub(crate) fn run(options: &Options) {
    if options.names {
        let text = std::fs::read_to_string(page()).expect("docs/reliability.md");
        return std::fs::write(page(), with_names(&text)).expect("docs/ can be written");
    }
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
    if !options.short {
        let part = options.part;
        let (longer, are_kept_longer) = longer(part);
        are_kept &= are_kept_longer;
        let text = format!(
            "# Reliability\n\nEach promise, the test that keeps it, and the result. Written by `cargo xtask reliability --part {part}`, \
             which ran the tests in {seconds:.0} s (CI runs them at each change) and the long runs at {part} of their full \
             length. Promises about access from outside are in [SECURITY.md](../SECURITY.md).\n\n{table}{longer}"
        );
        std::fs::write(page(), text).expect("docs/ can be written");
    }
    assert!(are_kept, "a promise is broken");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_written_anew_and_verdicts_stay() {
        let outcomes = || Outcome { is_kept: true, said: "12 of 13\n".into(), seconds: 1.0 };
        let page = format!("# Head\n\n{}\n## soak\n", table(&PROMISES.iter().map(|_| outcomes()).collect::<Vec<_>>()));
        assert_eq!(with_names(&page), page);
        assert_eq!(with_names(&page.replace(PROMISES[0].test.1, "an_older_name")), page);
    }

    #[test]
    fn a_test_is_chosen_by_its_file() {
        let at = |file| chosen(&Promise { says: "", test: (file, "holds"), long_run: None });
        assert_eq!(at("tests/wire/link.rs"), "-p slamd --test wire link::holds");
        assert_eq!(at("crates/core/tests/estimator/lock.rs"), "-p slamd-core --test estimator lock::holds");
    }
}
