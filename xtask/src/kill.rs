//! `cargo xtask kill`: SIGKILL at random moments of a recording. Run it on an idle machine.

use indicatif::ProgressBar;
use slamd_testkit::killing;

/// Kill a recording slamd at random moments and read what it left
#[derive(clap::Args)]
pub(crate) struct Options {
    /// How many times
    #[arg(long, default_value_t = 1000)]
    kills: u64,
}

pub(crate) fn run(options: &Options) {
    let kills = options.kills;
    let bar = ProgressBar::new(kills);
    let killed = killing::kill(kills, 2, 1, || bar.inc(1));
    bar.finish_and_clear();
    let mut lost: Vec<f64> = killed.iter().filter_map(|killed| killed.lost_ms).collect();
    lost.sort_by(f64::total_cmp);
    let at = |percent: usize| lost[(lost.len() - 1) * percent / 100];
    println!("| kills | of them while recording | could be opened | lost ms, median | p99 | worst |");
    println!("|---|---|---|---|---|---|");
    println!("| {kills} | {} | {} | {:.0} | {:.0} | {:.0} |", lost.len(), killed.len(), at(50), at(99), at(100));
    assert!(at(100) <= killing::MAX_LOST_MS, "more than {} ms were lost", killing::MAX_LOST_MS);
}
