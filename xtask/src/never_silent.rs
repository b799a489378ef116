//! `cargo xtask never-silent`: is slamd ever wrong without saying so?
//!
//! Every seed is another random home. Robots that differ from their configuration, and robots that are carried or pushed, drive through it;
//! the judge compares what slamd said with the truth. Prints Markdown tables and a command for each drive that failed.

mod drive;
mod judge;
mod kind;
mod moved;
mod table;

use crate::seeds::Seeds;
use drive::Case;
use indicatif::{ProgressBar, ProgressStyle};
use judge::Verdict;
use kind::Kind;
use std::collections::BTreeMap;
use std::fs::OpenOptions;
use std::io::Write as _;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Look for drives through random homes in which slamd is wrong without saying so
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Seeds of the homes: tune on 1-60, report on 101-160
    #[arg(long, default_value = "101-160")]
    seeds: Seeds,
    /// Length of each drive
    #[arg(long, default_value_t = 180.0)]
    seconds: f64,
    /// Drives at the same time; one per core if absent
    #[arg(long)]
    jobs: Option<usize>,
    /// Only these kinds, separated by commas
    #[arg(long, value_delimiter = ',')]
    only: Vec<Kind>,
    /// Numbers of sensors, separated by commas
    #[arg(long, value_delimiter = ',', default_value = "8,16,32")]
    rings: Vec<u8>,
    /// Write the tables to this new file too
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Print each drive, not only those that failed
    #[arg(long)]
    verbose: bool,
    /// Print what was said in each drive, with the error at that time
    #[arg(long)]
    events: bool,
}

pub(crate) fn run(options: &Options) {
    let mut file = options.out.as_ref().map(|path| {
        // A page of an earlier run is not overwritten.
        let opened = OpenOptions::new().write(true).create_new(true).open(path);
        opened.unwrap_or_else(|error| panic!("{}: {error}; name a new file", path.display()))
    });
    let kinds = if options.only.is_empty() { Kind::ALL.to_vec() } else { options.only.clone() };
    let mut cases = Vec::new();
    for &kind in &kinds {
        for &sensors in &options.rings {
            let of_seed = |seed| Case { kind, sensors, seed, seconds: options.seconds };
            cases.extend(options.seeds.0.clone().map(of_seed));
        }
    }
    let verdicts = drive_all(&cases, options);
    let judged: Vec<(Case, Verdict)> = cases.into_iter().zip(verdicts).collect();
    let mut page = table::tables(&judged);
    page += &table::drives(&judged, options.verbose);
    print!("{page}");
    if let (Some(file), Some(path)) = (&mut file, &options.out) {
        file.write_all(page.as_bytes()).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    }
}

/// Drives and judges every case, in their order.
fn drive_all(cases: &[Case], options: &Options) -> Vec<Verdict> {
    let style =
        ProgressStyle::with_template("{bar:40} {pos} of {len} drives, {eta} left {msg}").expect("a valid template");
    let (next, bar) = (AtomicUsize::new(0), ProgressBar::new(cases.len() as u64).with_style(style));
    let verdicts = Mutex::new(BTreeMap::new());
    let jobs = options.jobs.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
    std::thread::scope(|scope| {
        for _ in 0..jobs.max(1) {
            scope.spawn(|| {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let Some(case) = cases.get(index) else { break };
                    let trace = drive::drive(case);
                    if options.events {
                        bar.suspend(|| print!("{}\n{}", case.command(), judge::events(&trace)));
                    }
                    let verdict = judge::judge(case, &trace);
                    if verdict.silent_s.is_some() {
                        bar.println(format!("silent: {}", case.command()));
                    }
                    verdicts.lock().expect("no drive panics").insert(index, verdict);
                    bar.inc(1);
                }
            });
        }
    });
    bar.finish_and_clear();
    verdicts.into_inner().expect("no drive panics").into_values().collect()
}
