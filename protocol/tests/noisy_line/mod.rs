//! Sends real messages through a line that changes, loses and adds bytes. The decoder must accept
//! only frames that were sent, in their order.

#![allow(dead_code, unreachable_pub, reason = "each test uses its part")]

use crate::messages::message_of;
use slamd_protocol::{FrameDecoder, FrameEncoder, Message};
use std::collections::VecDeque;

/// The line's errors, in events per million bytes.
#[derive(Clone, Copy, Debug)]
pub struct Line {
    /// A byte changes its value.
    pub errors_per_million: u64,
    /// A byte is lost or added.
    pub slips_per_million: u64,
}

/// The result.
#[derive(Clone, Copy, Debug, Default)]
pub struct Outcome {
    pub bytes: u64,
    pub sent: u64,
    pub accepted: u64,
    pub wrong: u64,
    pub crc_errors: u64,
}

impl std::ops::AddAssign for Outcome {
    fn add_assign(&mut self, other: Self) {
        self.bytes += other.bytes;
        self.sent += other.sent;
        self.accepted += other.accepted;
        self.wrong += other.wrong;
        self.crc_errors += other.crc_errors;
    }
}

/// SplitMix64 (Steele, Lea and Flood, 2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn byte(&mut self) -> u8 {
        self.next().to_le_bytes()[0]
    }

    fn is_hit(&mut self, per_million: u64) -> bool {
        self.next() % 1_000_000 < per_million
    }

    /// The bytes that arrive for one byte sent.
    fn suffer(&mut self, line: Line, byte: u8) -> [Option<u8>; 2] {
        if self.is_hit(line.slips_per_million) {
            return if self.next().is_multiple_of(2) { [None, None] } else { [Some(self.byte()), Some(byte)] };
        }
        if self.is_hit(line.errors_per_million) {
            let change = if self.next().is_multiple_of(2) { 1 << (self.next() % 8) } else { 1 + self.byte() % 255 };
            return [Some(byte ^ change), None];
        }
        [Some(byte), None]
    }
}

/// Sends `bytes` bytes of frames from a new sender to a new receiver.
pub fn send(line: Line, seed: u64, bytes: u64) -> Outcome {
    let mut random = Random(seed);
    let (mut encoder, mut decoder) = (FrameEncoder::new(), FrameDecoder::new());
    let mut in_flight: VecDeque<(u8, u8, Vec<u8>)> = VecDeque::new();
    let mut outcome = Outcome::default();
    let mut seq = 0u8;
    while outcome.bytes < bytes {
        let message: Message = message_of(outcome.sent, &mut || random.byte());
        let mut payload = slamd_protocol::PayloadBuf::new();
        message.emit(&mut payload);
        in_flight.push_back((message.kind(), seq, payload.to_vec()));
        seq = seq.wrapping_add(1);
        outcome.sent += 1;
        for byte in encoder.encode(&message) {
            for byte in random.suffer(line, byte).into_iter().flatten() {
                outcome.bytes += 1;
                let Some(frame) = decoder.push(byte) else { continue };
                let is_it = |sent: &(u8, u8, Vec<u8>)| {
                    (sent.0, sent.1, sent.2.as_slice()) == (frame.kind, frame.seq, frame.payload)
                };
                match in_flight.iter().position(is_it) {
                    Some(place) => {
                        in_flight.drain(..=place);
                        outcome.accepted += 1;
                    }
                    None => outcome.wrong += 1,
                }
            }
        }
    }
    outcome.crc_errors = decoder.counters().crc_errors;
    outcome
}

/// The same on all cores, in parts of a million bytes with separate seeds; calls `done` after each
/// part.
pub fn send_in_parallel(line: Line, bytes: u64, done: impl Fn(u64) + Sync) -> Outcome {
    const PART: u64 = 1_000_000;
    let next = std::sync::atomic::AtomicU64::new(0);
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let work = || {
        let mut outcome = Outcome::default();
        loop {
            let part = next.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            if part * PART >= bytes {
                return outcome;
            }
            outcome += send(line, part + 1, PART.min(bytes - part * PART));
            done(outcome.bytes.min(PART));
        }
    };
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..cores).map(|_| scope.spawn(work)).collect();
        let mut outcome = Outcome::default();
        workers.into_iter().for_each(|worker| outcome += worker.join().expect("no worker panics"));
        outcome
    })
}
