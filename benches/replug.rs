//! `cargo bench --bench replug [-- --cycles 1000]`: the cable pulled and put back, on the real program.

mod options;

use indicatif::ProgressBar;
use slamd_testkit::mock_port;

fn main() {
    let cycles: u64 = options::number("--cycles", 1000);
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
