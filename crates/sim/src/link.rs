//! The serial line: sends bytes at the baud rate, delivers them in chunks with jitter, and corrupts
//! some of them.

use super::random::Random;
use slamd_core::Timestamp;
use std::collections::VecDeque;

/// Transmission errors, as probabilities per byte.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LinkFaults {
    /// One bit of the byte is flipped.
    pub bit_flips: f64,
    /// The byte is lost.
    pub drops: f64,
    /// A random byte is added before it.
    pub insertions: f64,
}

/// Bits per second.
pub const BAUD: u64 = 115_200;
/// Bits per byte on the line: start bit, eight data bits, stop bit.
const BITS_PER_BYTE: u64 = 10;
/// Maximum delay in the USB bridge, microseconds.
const JITTER_US: f64 = 4_000.0;

/// One direction of the line, from the board to the host.
#[derive(Debug)]
pub struct Link {
    faults: LinkFaults,
    random: Random,
    free_us: u64,
    last_us: u64,
    chunks: VecDeque<(Timestamp, Vec<u8>)>,
}

impl Link {
    /// An idle line.
    #[must_use]
    pub fn new(faults: LinkFaults, random: Random) -> Self {
        Self { faults, random, free_us: 0, last_us: 0, chunks: VecDeque::new() }
    }

    /// Sends bytes; the board's transmitter gets them at `at`.
    pub fn send(&mut self, at: Timestamp, bytes: &[u8]) {
        let begin_us = self.free_us.max(at.us());
        self.free_us = begin_us + bytes.len() as u64 * BITS_PER_BYTE * 1_000_000 / BAUD;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most the jitter")]
        let jitter_us = self.random.uniform(500.0, JITTER_US) as u64;
        self.last_us = self.last_us.max(self.free_us + jitter_us);
        let arrived = self.corrupt(bytes);
        self.chunks.push_back((Timestamp::from_us(self.last_us), arrived));
    }

    /// Arrival time of the next chunk.
    #[must_use]
    pub fn next_at(&self) -> Option<Timestamp> {
        self.chunks.front().map(|(at, _)| *at)
    }

    /// The next chunk, if it has arrived by `now`.
    pub fn receive(&mut self, now: Timestamp) -> Option<(Timestamp, Vec<u8>)> {
        self.chunks.pop_front_if(|(at, _)| *at <= now)
    }

    fn corrupt(&mut self, bytes: &[u8]) -> Vec<u8> {
        if self.faults == LinkFaults::default() {
            return bytes.to_vec();
        }
        let mut arrived = Vec::with_capacity(bytes.len());
        for &byte in bytes {
            if self.random.chance(self.faults.insertions) {
                arrived.push(self.random.bits().to_le_bytes()[0]);
            }
            if self.random.chance(self.faults.drops) {
                continue;
            }
            let flipped = if self.random.chance(self.faults.bit_flips) { 1 << self.random.below(8) } else { 0 };
            arrived.push(byte ^ flipped);
        }
        arrived
    }
}
