//! `cargo xtask strangers`: those that may not drive try, thousands of times.

use indicatif::ProgressBar;
use slamd_testkit::driving::strangers;

/// Try to drive without the right: readers, wrong tokens, malformed and replayed lines, browsers, MQTT
#[derive(clap::Args)]
pub(crate) struct Options {
    /// How many tries
    #[arg(long, default_value_t = 10_000)]
    tries: u64,
    /// Seed of the tries
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

pub(crate) fn run(options: &Options) {
    let bar = ProgressBar::new(options.tries);
    let came = strangers(options.tries, options.seed, || bar.inc(1));
    bar.finish_and_clear();
    let [strangers_m_s, owner_m_s] = came.peak_m_s;
    println!("| tries | answered with ERROR | DRIVE frames sent | a wheel turned, m/s | the owner afterwards, m/s |");
    println!("|---|---|---|---|---|");
    println!("| {} | {} | {} | {strangers_m_s} | {owner_m_s:.2} |", came.tries, came.refused, came.drives);
    assert!(strangers_m_s == 0.0 && came.drives == 0, "a stranger moved a wheel");
}
