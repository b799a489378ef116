//! `slamd replay DIR`: replays all captures of a folder on all cores, each into its own folder.

use super::replay::{of_capture, open, outputs};
use super::terminal::{progress_over, say};
use super::{Failure, Kind, OutputArgs};
use crate::source::replay::replay;
use slamd_publish::Summary;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};
use tracing::subscriber::{NoSubscriber, with_default};

/// The result of one capture.
struct Row {
    duration_s: f64,
    elapsed: Duration,
    summary: Summary,
    faulty: usize,
    damage: Option<String>,
}

type Outcome = Result<Row, Failure>;

/// Replays all captures of `folder` (`*.mcap`, without subfolders), `jobs` at a time.
///
/// # Errors
/// When there is no capture or when one failed; a failure does not stop the others.
pub(super) fn replay_folder(folder: &Path, jobs: Option<usize>, output: &OutputArgs) -> Result<(), Failure> {
    let captures = captures(folder)?;
    let cores = || std::thread::available_parallelism().map_or(1, usize::from);
    let outcomes = run_all(&captures, jobs.unwrap_or_else(cores), output);
    let named = || captures.iter().map(|capture| name(capture)).zip(&outcomes);
    if output.json {
        let rows = named().filter_map(|(name, outcome)| Some((name, outcome.as_ref().ok()?)));
        let object = |(name, row): (String, &Row)| serde_json::json!({ "capture": name, "duration_s": row.duration_s, "elapsed_s": row.elapsed.as_secs_f64(), "summary": row.summary });
        say(serde_json::Value::Array(rows.map(object).collect()));
    } else {
        say(HEAD);
        named().for_each(|(name, outcome)| say(line(&name, outcome)));
        say(format_args!("\noutput folders: {}", output.out().join("NAME").display()));
    }
    for (name, damage) in named().filter_map(|(name, outcome)| Some((name, outcome.as_ref().ok()?.damage.as_ref()?))) {
        tracing::warn!("{name}: {damage}; what was readable has been used");
    }
    for (name, remark) in
        named().filter_map(|(name, outcome)| Some((name, outcome.as_ref().ok()?.summary.remark.as_ref()?)))
    {
        tracing::warn!("{name}: {remark}");
    }
    let count = outcomes.len();
    let failures: Vec<Failure> =
        captures.iter().zip(outcomes).filter_map(|(capture, outcome)| failure(capture, outcome)).collect();
    failures.iter().for_each(|failure| tracing::error!("{failure}"));
    let failed = failures.iter().filter(|failure| failure.kind != Kind::NothingMapped).count();
    match failures.iter().find(|failure| failed == 0 || failure.kind != Kind::NothingMapped) {
        Some(first) if failed == 0 => {
            Err(Failure::new(first.kind, format!("nothing was mapped from {} of {count} captures", failures.len())))
        }
        Some(first) => Err(Failure::new(first.kind, format!("{failed} of {count} captures could not be replayed"))),
        None => Ok(()),
    }
}

/// What went wrong with a capture; none if it was mapped.
fn failure(capture: &Path, outcome: Outcome) -> Option<Failure> {
    let summary = match outcome {
        Ok(row) => row.summary,
        Err(failure) => return Some(failure),
    };
    let nothing = summary.nothing_mapped.as_ref()?;
    Some(of_capture(capture, &summary, Failure::new(Kind::NothingMapped, format!("nothing mapped: {nothing}"))))
}

fn captures(folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let unreadable = |error| Failure::new(Kind::NoInput, format!("{}: {error}", folder.display()));
    let mut captures = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        if path.extension().is_some_and(|extension| extension == "mcap") {
            captures.push(path);
        }
    }
    captures.sort();
    if captures.is_empty() {
        let text = format!("{}: there is no capture (*.mcap) in it; name a folder with some", folder.display());
        return Err(Failure::new(Kind::NoInput, text));
    }
    Ok(captures)
}

/// The outcomes in the order of the captures.
fn run_all(captures: &[PathBuf], jobs: usize, output: &OutputArgs) -> Vec<Outcome> {
    let bar = progress_over(captures.len());
    let next = AtomicUsize::new(0);
    let outcomes: Vec<Mutex<Option<Outcome>>> = captures.iter().map(|_| Mutex::new(None)).collect();
    std::thread::scope(|scope| {
        for _ in 0..jobs.clamp(1, captures.len()) {
            scope.spawn(|| {
                while let Some((capture, outcome)) = {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    captures.get(index).zip(outcomes.get(index))
                } {
                    bar.set_message(name(capture));
                    // No log here: the lines of several captures would be mixed. Each output folder lists its faults and localization events.
                    let done = with_default(NoSubscriber::default(), || run(capture, output));
                    *outcome.lock().unwrap_or_else(PoisonError::into_inner) = Some(done);
                    bar.inc(1);
                }
            });
        }
    });
    bar.finish_and_clear();
    let done = |outcome: Mutex<Option<Outcome>>| outcome.into_inner().unwrap_or_else(PoisonError::into_inner);
    outcomes.into_iter().filter_map(done).collect()
}

#[expect(clippy::disallowed_methods, reason = "the speed of a replay is reported, and changes nothing")]
fn run(file: &Path, output: &OutputArgs) -> Outcome {
    let begin = Instant::now();
    let folder = output.out().join(name(file));
    let outputs = outputs(file, &folder, &output.guard_of_recording(file, Some(&folder)))?;
    let (mut capture, mut session) = open(file, &super::state_args::StateArgs::default(), &output.how, outputs)?;
    replay(&mut capture, &mut session, |_| ())?;
    let duration_s = session.now().seconds();
    let (summary, faulty) = session.finish()?;
    let damage = capture.damage().map(str::to_owned);
    Ok(Row { duration_s, elapsed: begin.elapsed(), summary, faulty: faulty.len(), damage })
}

/// The name of the capture and of its output folder.
fn name(capture: &Path) -> String {
    capture.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

const HEAD: &str = "\
| capture | s | sweeps | frames lost | CRC errors | faulty sensors | ATE m | map m2 | x real time |
|---|---|---|---|---|---|---|---|---|";

fn line(name: &str, outcome: &Outcome) -> String {
    let Ok(Row { duration_s, elapsed, summary, faulty, .. }) = outcome else {
        return format!("| {name} | failed | | | | | | | |");
    };
    let ate_m = summary.accuracy.map_or_else(|| "-".into(), |accuracy| format!("{:.3}", accuracy.ate_m));
    format!(
        "| {name} | {duration_s:.0} | {} | {} | {} | {faulty} | {ate_m} | {:.0} | {:.0} |",
        summary.sweeps,
        summary.lost_frames,
        summary.crc_errors,
        summary.map_m2,
        duration_s / elapsed.as_secs_f64(),
    )
}
