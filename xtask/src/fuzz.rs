//! `cargo xtask fuzz`: hostile bytes and files. A panic ends it; the slowest file is named by its kind and seed.

use indicatif::ProgressBar;
use slamd_testkit::fuzzing;
use slamd_testkit::fuzzing::{Corpus, Kind};
use std::time::{Duration, Instant};

/// Feed damaged bytes and files to everything that reads them
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Bytes on the serial line
    #[arg(long, default_value_t = 1_000_000_000)]
    bytes: u64,
    /// Files, of all kinds together
    #[arg(long, default_value_t = 1_000_000)]
    files: u64,
}

const AT_ONCE: u64 = 10_000_000;
const MAX_TIME: Duration = Duration::from_secs(1);

#[expect(clippy::disallowed_methods, reason = "a long run is timed")]
pub(crate) fn run(options: &Options) {
    let &Options { bytes, files } = options;
    let corpus = Corpus::build();
    let bar = ProgressBar::new(bytes / AT_ONCE);
    let (mut sweeps, mut frames) = (0, 0);
    let begin = Instant::now();
    for seed in 0..bytes.div_ceil(AT_ONCE) {
        let outcome = corpus.bytes(AT_ONCE, 1_000 + seed);
        (sweeps, frames) = (sweeps + outcome.sweeps, frames + outcome.frames);
        bar.inc(1);
    }
    bar.finish_and_clear();
    println!(
        "{bytes} bytes in {:.0} s: {frames} good frames, {sweeps} sweeps, no panic",
        begin.elapsed().as_secs_f64()
    );
    println!("| kind | files | accepted | mean ms | slowest ms | its seed |");
    println!("|---|---|---|---|---|---|");
    let folder = tempfile::tempdir().expect("a folder");
    let mut slowest_of_all = Duration::ZERO;
    for kind in Kind::ALL {
        let count = files.div_ceil(Kind::ALL.len() as u64);
        let bar = ProgressBar::new(count);
        let (mut accepted, mut slowest, begin) = (0, (Duration::ZERO, 0), Instant::now());
        for seed in 1_000_000..1_000_000 + count {
            let begin = Instant::now();
            accepted += u64::from(corpus.file(kind, seed, folder.path()).accepted);
            slowest = slowest.max((begin.elapsed(), seed));
            bar.inc(1);
        }
        bar.finish_and_clear();
        let mean_ms = 1e3 * begin.elapsed().as_secs_f64() / count as f64;
        let slowest_ms = 1e3 * slowest.0.as_secs_f64();
        println!("| {kind:?} | {count} | {accepted} | {mean_ms:.2} | {slowest_ms:.0} | {} |", slowest.1);
        slowest_of_all = slowest_of_all.max(slowest.0);
    }
    println!("most memory: {} MiB", fuzzing::most_resident_kib() >> 10);
    assert!(slowest_of_all < MAX_TIME, "a file took {slowest_of_all:?}");
}
