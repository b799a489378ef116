//! Dozens of seeds of the whole daemon in a simulated world; `cargo xtask simulation` runs thousands.

use slamd_testkit::simulating;

/// The first seeds; every kind of disturbance is among them.
const SEEDS: u64 = 24;

#[test]
fn no_fault_breaks_a_promise() {
    let met = simulating::simulate_all(0..SEEDS, || ());
    println!("{met}");
    let kinds =
        [met.hang_ups, met.resets, met.silences, met.stalls, met.sleeps, met.deaths, met.slips, met.disk_errors];
    assert!(kinds.iter().all(|count| *count > 0) && met.rejected > 0 && met.sweeps > 100 * SEEDS, "{met}");
}
