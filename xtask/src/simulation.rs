//! `cargo xtask simulation`: the whole daemon in a simulated world, seed after seed; the first that breaks a promise ends it.

use indicatif::ProgressBar;
use slamd_testkit::simulating;
use std::time::Instant;

/// Run the whole daemon in simulated worlds
#[derive(clap::Args)]
pub(crate) struct Options {
    /// How many worlds
    #[arg(long, default_value_t = 2000)]
    seeds: u64,
    /// The first seed
    #[arg(long, default_value_t = 1000)]
    first: u64,
}

#[expect(clippy::disallowed_methods, reason = "a long run is timed")]
pub(crate) fn run(options: &Options) {
    let &Options { seeds, first } = options;
    let bar = ProgressBar::new(seeds);
    let begin = Instant::now();
    let met = simulating::simulate_all(first..first + seeds, || bar.inc(1));
    bar.finish_and_clear();
    let elapsed_s = begin.elapsed().as_secs_f64();
    println!("seeds {first} to {}, no promise broken", first + seeds - 1);
    println!("{met}");
    println!("{elapsed_s:.0} s, {:.0} times as fast as real time", met.seconds() / elapsed_s);
}
