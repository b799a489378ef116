//! The program killed at fifty random moments; `cargo xtask kill` does it a thousand times, and checks the 100 ms on an idle machine.

use slamd_testkit::killing;

#[test]
fn what_was_recorded_before_a_kill_can_be_read() {
    let killed = killing::kill(50, 4, 1, || ());
    let recorded: Vec<f64> = killed.iter().filter_map(|killed| killed.lost_ms).collect();
    let worst = recorded.iter().copied().fold(0.0, f64::max);
    println!("{} of {} had recorded; at most {worst:.0} ms were lost", recorded.len(), killed.len());
    assert!(recorded.len() > 25, "{killed:?}");
    // A loaded machine wakes threads late; that is not what is tested here.
    assert!(worst < 10.0 * killing::MAX_LOST_MS, "{worst} ms");
}
