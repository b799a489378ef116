//! `cargo bench --bench simulation [-- --seeds 2000 --first 1000]`: the whole daemon in a simulated world, seed after seed; the first that breaks a
//! promise ends it.

mod options;

use indicatif::ProgressBar;
use slamd_testkit::simulating;
use std::time::Instant;

#[expect(clippy::disallowed_methods, reason = "a benchmark has a clock")]
fn main() {
    let (seeds, first) = (options::number("--seeds", 2_000_u64), options::number("--first", 1_000_u64));
    let bar = ProgressBar::new(seeds);
    let begin = Instant::now();
    let met = simulating::simulate_all(first..first + seeds, || bar.inc(1));
    bar.finish_and_clear();
    let elapsed_s = begin.elapsed().as_secs_f64();
    println!("seeds {first} to {}, no promise broken", first + seeds - 1);
    println!("{met}");
    println!("{elapsed_s:.0} s, {:.0} times as fast as real time", met.seconds() / elapsed_s);
}
