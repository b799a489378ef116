//! `cargo xtask replug`: the cable is pulled and put back, on the real program.

use indicatif::ProgressBar;
use slamd_testkit::mock_port;

/// Pull the cable and put it back, many times
#[derive(clap::Args)]
pub(crate) struct Options {
    /// How many times
    #[arg(long, default_value_t = 1000)]
    cycles: u64,
}

pub(crate) fn run(options: &Options) {
    let cycles = options.cycles;
    let bar = ProgressBar::new(cycles);
    let measured = mock_port::replug::replug(cycles, || bar.inc(1));
    bar.finish_and_clear();
    let [median, p99, worst] = [0.5, 0.99, 1.0].map(|share| measured.quantile_ms(share));
    println!("| cycles | recovered ms, median | p99 | worst | descriptors | resident KiB | CPU while absent |");
    println!("|---|---|---|---|---|---|---|");
    println!(
        "| {cycles} | {median:.0} | {p99:.0} | {worst:.0} | {:?} | {:?} | {:.2} % |",
        measured.descriptors,
        measured.resident_kib,
        100.0 * measured.absent_cpu
    );
    measured.check();
}
