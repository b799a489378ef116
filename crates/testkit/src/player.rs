//! A simulated robot at a pseudo-terminal, in real time.

use crate::haste::Haste;
use crate::mock_port::{Terminal, simulation};
use slamd_capture::Record;
use slamd_core::Timestamp;
use slamd_sim::link::LinkFaults;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Plays the board until it is stopped: `speed` 2 is twice real time.
#[expect(clippy::disallowed_methods, reason = "a board in real time is a clock")]
pub fn play(mut terminal: Terminal, speed: u32, end: &AtomicBool) {
    let mut simulation = simulation(1, LinkFaults::default(), 36_000.0);
    let mut haste = (speed == 2).then(Haste::default);
    let begin = Instant::now();
    while !end.load(Ordering::Relaxed) {
        let now = Timestamp::default() + speed * begin.elapsed();
        while let Some(record) = simulation.poll(now) {
            let record = match &mut haste {
                Some(haste) => haste.halve(record),
                None => Some(record),
            };
            if let Some(Record::Received { bytes, .. }) = record {
                terminal.write(&bytes);
            }
        }
        let heard = terminal.read();
        if heard.is_empty() {
            std::thread::sleep(Duration::from_millis(1));
        } else {
            simulation.hear(now, &heard);
        }
    }
}
