//! The line between board and host, with all that happens to bytes on it, and the host's end of it.

use bytes::Bytes;
use slamd_sim::link::LinkFaults;
use slamd_sim::random::Random;
use std::collections::VecDeque;

/// Times are true microseconds.
pub struct Cable {
    random: Random,
    noise: (LinkFaults, u64),
    dead_until: u64,
    clogged_until: u64,
    unplugged_until: u64,
    busy_until: u64,
    /// The rate that the board speaks at, and the one that the host has set.
    baud: [u32; 2],
    /// What has arrived and was not read yet.
    buffer: VecDeque<u8>,
    room: usize,
    /// Bytes flipped, lost or added, and bytes that found no room.
    pub slips: u64,
    pub overrun: u64,
}

pub const BAUD: u32 = 115_200;

impl Cable {
    pub fn new(random: Random, room: usize) -> Self {
        Self {
            random,
            noise: (LinkFaults::default(), 0),
            dead_until: 0,
            clogged_until: 0,
            unplugged_until: 0,
            busy_until: 0,
            baud: [BAUD; 2],
            buffer: VecDeque::new(),
            room,
            slips: 0,
            overrun: 0,
        }
    }

    pub fn noise(&mut self, faults: LinkFaults, until: u64) {
        self.noise = (faults, until);
    }

    pub fn dead(&mut self, until: u64) {
        self.dead_until = self.dead_until.max(until);
    }

    pub fn clogged(&mut self, until: u64) {
        self.clogged_until = self.clogged_until.max(until);
    }

    pub fn unplugged(&mut self, until: u64, busy_until: u64) {
        self.unplugged_until = self.unplugged_until.max(until);
        self.busy_until = self.busy_until.max(busy_until);
        self.buffer.clear();
    }

    /// Another rate throws away what had arrived, and damage to half a frame of it stays.
    pub fn set_baud(&mut self, baud: u32) {
        self.buffer.clear();
        self.baud[1] = baud;
    }

    pub fn is_unplugged(&self, at: u64) -> bool {
        at < self.unplugged_until
    }

    /// The port can be opened.
    pub fn is_free(&self, at: u64) -> bool {
        at >= self.unplugged_until && at >= self.busy_until
    }

    /// Opening throws away what had arrived, too.
    pub fn open(&mut self, baud: u32) {
        self.set_baud(baud);
    }

    pub fn burst(&mut self, count: usize) {
        let noise: Vec<u8> = (0..count).map(|_| self.random.bits().to_le_bytes()[0]).collect();
        self.slips += count as u64;
        self.arrive(&noise);
    }

    /// The board sends bytes.
    pub fn up(&mut self, at: u64, bytes: &[u8]) {
        if let Some(bytes) = self.pass(at, bytes) {
            self.arrive(&bytes);
        }
    }

    /// The host wrote bytes; returns what the board receives.
    pub fn down(&mut self, at: u64, bytes: &[u8]) -> Vec<u8> {
        self.pass(at, bytes).unwrap_or_default()
    }

    /// How many of `bytes` the port takes now; none where it takes none.
    pub fn takes(&mut self, at: u64, bytes: &[u8]) -> Option<usize> {
        let is_short = self.random.chance(0.1);
        (at >= self.clogged_until).then(|| if is_short { 1 + self.random.below(bytes.len()) } else { bytes.len() })
    }

    pub fn is_clogged(&self, at: u64) -> bool {
        at < self.clogged_until
    }

    pub fn has_bytes(&self) -> bool {
        !self.buffer.is_empty()
    }

    /// One read of the port.
    pub fn read(&mut self, most: usize) -> Bytes {
        let count = most.min(self.buffer.len());
        self.buffer.drain(..count).collect::<Vec<u8>>().into()
    }

    fn arrive(&mut self, bytes: &[u8]) {
        let room = self.room.saturating_sub(self.buffer.len()).min(bytes.len());
        self.buffer.extend(&bytes[..room]);
        self.overrun += (bytes.len() - room) as u64;
    }

    /// What becomes of bytes on the way.
    fn pass(&mut self, at: u64, bytes: &[u8]) -> Option<Vec<u8>> {
        if at < self.dead_until || self.is_unplugged(at) {
            return None;
        }
        if self.baud[0] != self.baud[1] {
            self.slips += bytes.len() as u64;
            return Some(bytes.iter().map(|_| self.random.bits().to_le_bytes()[0] | 1).collect());
        }
        let (faults, until) = self.noise;
        if at >= until {
            return Some(bytes.to_vec());
        }
        let mut arrived = Vec::with_capacity(bytes.len());
        for &byte in bytes {
            if self.random.chance(faults.insertions) {
                arrived.push(self.random.bits().to_le_bytes()[0]);
                self.slips += 1;
            }
            if self.random.chance(faults.drops) {
                self.slips += 1;
                continue;
            }
            let is_flipped = self.random.chance(faults.bit_flips);
            self.slips += u64::from(is_flipped);
            arrived.push(if is_flipped { byte ^ (1 << self.random.below(8)) } else { byte });
        }
        Some(arrived)
    }
}
