//! `cargo xtask dead-man`: slamd killed, hung or cut off at random moments while it drives. Run it on an idle machine.

use indicatif::ProgressBar;
use slamd_testkit::driving::{Ended, STANDSTILL, dead_man};

/// Kill, hang or cut off a driving slamd at random moments and measure until the robot stands
#[derive(clap::Args)]
pub(crate) struct Options {
    /// How many times
    #[arg(long, default_value_t = 1000)]
    stops: u64,
    /// Seed of the moments
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

pub(crate) fn run(options: &Options) {
    let bar = ProgressBar::new(options.stops);
    let stops = dead_man(options.stops, options.seed, || bar.inc(1));
    bar.finish_and_clear();
    println!(
        "| the drive ended by | times | wheels turned on for ms, median | p99 | worst | board late by ms, worst |"
    );
    println!("|---|---|---|---|---|---|");
    for (ended, word) in [(Ended::Killed, "kill -9"), (Ended::Wedged, "a hang"), (Ended::Cut, "a cut cable")] {
        let of = stops.iter().filter(|stop| stop.ended == ended);
        let mut ms: Vec<u128> = of.clone().map(|stop| stop.turned.as_millis()).collect();
        let late = of.map(|stop| stop.late.as_millis()).max().unwrap_or(0);
        ms.sort_unstable();
        let at = |percent: usize| ms.get(ms.len().saturating_sub(1) * percent / 100).copied().unwrap_or(0);
        println!("| {word} | {} | {} | {} | {} | {late} |", ms.len(), at(50), at(99), at(100));
    }
    let worst = stops.iter().find(|stop| stop.turned > STANDSTILL + stop.late);
    assert!(worst.is_none(), "later than {STANDSTILL:?}: {worst:?}");
}
