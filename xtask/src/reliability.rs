//! `cargo xtask reliability`: tries every promise, first by its test, then by the long runs, and writes `docs/reliability.md`.
//!
//! The tests and each long run are a part. What a part gave is a file of `docs/reliability/`, with the commit that it was run at, and the
//! page is written from these files: parts can be run apart. One promise that is not kept makes it fail.

use indicatif::ProgressBar;
use serde_json::{Value, json};
use slamd_testkit::promises::{LONG, LongRun, PROMISES, Promise};
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
    /// Only these, of tests, simulation, fuzz, coverage, kill, soak and laps; the page keeps what it says of the others
    #[arg(long, value_delimiter = ',', value_name = "NAMES", value_parser = NAMES)]
    only: Vec<String>,
    /// Only the tests; print the table, write nothing
    #[arg(long)]
    short: bool,
    /// Run nothing: write the page from the files in docs/reliability/
    #[arg(long, conflicts_with_all = ["part", "only", "short"])]
    page: bool,
}

const TESTS: &str = "tests";
const NAMES: [&str; LONG.len() + 1] = {
    let mut names = [TESTS; LONG.len() + 1];
    let mut i = 0;
    while i < LONG.len() {
        names[i + 1] = LONG[i].name;
        i += 1;
    }
    names
};

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

/// The commit that is checked out, and whether anything but the pages differs from it.
fn commit() -> String {
    let git = |arguments: &[&str]| {
        let mut command = Command::new("git");
        command.args(arguments).current_dir(slamd_testkit::root()).stderr(Stdio::inherit());
        command.output().expect("git runs")
    };
    let name = git(&["rev-parse", "--short=10", "HEAD"]);
    let is_changed = !git(&["diff", "--quiet", "HEAD", "--", ".", ":!docs"]).status.success();
    let name = String::from_utf8_lossy(&name.stdout).trim().to_owned();
    if is_changed { format!("{name} with changes") } else { name }
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

fn root() -> PathBuf {
    slamd_testkit::root().join("docs")
}

fn file(part: &str) -> PathBuf {
    root().join("reliability").join(part).with_extension("json")
}

fn keep(part: &str, value: &Value) {
    std::fs::create_dir_all(root().join("reliability")).expect("docs/ can be written");
    let text = serde_json::to_string_pretty(value).expect("JSON") + "\n";
    std::fs::write(file(part), text).expect("docs/ can be written");
}

fn text<'a>(value: &'a Value, key: &str) -> &'a str {
    value[key].as_str().unwrap_or_else(|| panic!("no {key} in {value}"))
}

fn is_kept(value: &Value) -> bool {
    value["kept"].as_bool().unwrap_or(false)
}

/// Every promise's test.
fn tests() -> Value {
    let commit = commit();
    let bar = ProgressBar::new(PROMISES.len() as u64);
    let (mut seconds, mut told) = (0.0, Vec::new());
    for promise in &PROMISES {
        let outcome = test(promise);
        bar.inc(1);
        seconds += outcome.seconds;
        told.push(json!({"test": promise.test.1, "kept": outcome.is_kept, "figure": figure(&outcome.said)}));
    }
    bar.finish_and_clear();
    let are_kept = told.iter().all(is_kept);
    json!({"commit": commit, "seconds": seconds.round(), "kept": are_kept, "tests": told})
}

/// A long run; what it printed is kept whole.
fn longer(run: &LongRun, part: f64, commit: &str) -> Value {
    let mut arguments = vec![run.task.to_owned()];
    for (option, full) in run.options {
        arguments.extend([(*option).to_owned(), format!("{}", (full * part).ceil())]);
    }
    let line = format!("cargo xtask {}", arguments.join(" "));
    eprintln!("{line}");
    let mut command = Command::new(std::env::current_exe().expect("a program has a path"));
    let outcome = outcome(command.arg("--as-built").args(arguments));
    json!({
        "commit": commit,
        "command": line,
        "part": part,
        "seconds": outcome.seconds.round(),
        "kept": outcome.is_kept,
        "said": outcome.said.trim().lines().collect::<Vec<_>>(),
    })
}

const HEAD: &str = "| promise | kept by `cargo test` | for longer | | figure |\n|---|---|---|---|---|\n";

/// The table of the promises. The order of [`PROMISES`] is that of the rows.
fn table(told: &Value) -> String {
    let told = told["tests"].as_array().expect("a list of tests");
    assert_eq!(told.len(), PROMISES.len(), "promises came or went: run `cargo xtask reliability --only tests`");
    let rows = PROMISES.iter().zip(told).map(|(promise, told)| {
        let longer = promise.long_run.map_or_else(String::new, |task| format!("[{task}](#{task})"));
        let verdict = if is_kept(told) { "kept" } else { "**broken**" };
        let figure = text(told, "figure");
        format!("| {} | `{}` | {longer} | {verdict} | {figure} |\n", promise.says, chosen(promise))
    });
    HEAD.to_owned() + &rows.collect::<String>()
}

/// The page from the files of its parts.
fn page() -> String {
    let read = |part: &str| {
        let text = std::fs::read_to_string(file(part)).ok();
        text.map(|text| serde_json::from_str::<Value>(&text).unwrap_or_else(|error| panic!("{part}: {error}")))
    };
    let tests = read(TESTS).expect("docs/reliability/tests.json: run `cargo xtask reliability --only tests`");
    let mut page = format!(
        "# Reliability\n\nEach promise, the test that keeps it, and the result. Written by `cargo xtask reliability` from the files in \
         [reliability/](reliability/), which it writes, too. The tests were run at {} in {} s; CI runs them at each change. Promises about \
         access from outside are in [SECURITY.md](../SECURITY.md).\n\n{}",
        text(&tests, "commit"),
        tests["seconds"],
        table(&tests)
    );
    for run in &LONG {
        let _ = write!(page, "\n## {}\n\n", run.name);
        let Some(told) = read(run.name) else {
            let _ = writeln!(page, "Not run.");
            continue;
        };
        let part = told["part"].as_f64().unwrap_or_default();
        let length = if part < 1.0 { format!("{part} of the full length") } else { "the full length".into() };
        let said: Vec<_> = told["said"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
        let verdict = if is_kept(&told) { "Kept" } else { "**Broken**" };
        let _ = writeln!(
            page,
            "`{}`, {length}, at {}: {verdict}, in {} s.\n\n{}",
            text(&told, "command"),
            text(&told, "commit"),
            told["seconds"],
            said.join("\n")
        );
        // What became of a finding is written into the part's file by hand.
        if let Some(mended) = told["mended"].as_str() {
            let _ = writeln!(page, "\n{mended}");
        }
    }
    page
}

pub(crate) fn run(options: &Options, as_built: bool) {
    let &Options { part, short, page: is_page_only, .. } = options;
    if short {
        let told = tests();
        print!("{}", table(&told));
        assert!(is_kept(&told), "a promise is broken");
        return;
    }
    let is_wanted = |name: &str| !is_page_only && (options.only.is_empty() || options.only.iter().any(|n| n == name));
    let mut are_kept = true;
    let mut done = |name: &str, told: &Value| {
        keep(name, told);
        are_kept &= is_kept(told);
    };
    if is_wanted(TESTS) {
        done(TESTS, &tests());
    }
    // What is built now is run to the end, whatever is checked out meanwhile.
    let commit = commit();
    if is_wanted("coverage") && !as_built {
        crate::coverage::build();
    }
    for run in LONG.iter().filter(|run| is_wanted(run.name)) {
        done(run.name, &longer(run, part, &commit));
    }
    // A part that is run first has no page to be on yet.
    if file(TESTS).exists() {
        std::fs::write(root().join("reliability.md"), page()).expect("docs/ can be written");
    } else {
        eprintln!("no page is written: docs/reliability/tests.json is missing");
    }
    assert!(are_kept, "a promise is broken");
}
