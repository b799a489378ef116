//! `cargo bench --bench simulation [-- --seeds 2000 --first 1000]`: the whole daemon in a simulated world, seed after seed; the first that breaks a
//! promise ends it.

#[path = "../tests/faulty_disk/mod.rs"]
mod faulty_disk;
#[path = "../tests/simulating/mod.rs"]
mod simulating;

use indicatif::ProgressBar;
use std::time::Instant;

fn argument(name: &str, default: u64) -> u64 {
    let arguments: Vec<String> = std::env::args().collect();
    let place = arguments.iter().position(|argument| argument == name);
    let number = place.and_then(|place| arguments.get(place + 1)).map(|number| number.parse());
    number.unwrap_or(Ok(default)).expect("a number")
}

#[expect(clippy::disallowed_methods, reason = "a benchmark has a clock")]
fn main() {
    let (seeds, first) = (argument("--seeds", 2_000), argument("--first", 1_000));
    let bar = ProgressBar::new(seeds);
    let begin = Instant::now();
    let met = simulating::simulate_all(first..first + seeds, || bar.inc(1));
    bar.finish_and_clear();
    let elapsed_s = begin.elapsed().as_secs_f64();
    println!("seeds {first} to {}, no promise broken", first + seeds - 1);
    println!("{met}");
    println!("{elapsed_s:.0} s, {:.0} times as fast as real time", met.seconds() / elapsed_s);
}
