//! Lines that wait to be taken by a client.

use bytes::{Buf as _, Bytes};
use slamd_core::Timestamp;
use std::collections::VecDeque;
use std::time::Duration;

/// Lines that wait; of the first, what is left.
#[derive(Debug)]
pub(super) struct Outbox {
    lines: VecDeque<Bytes>,
    bytes: usize,
    /// A part of the first has been taken.
    is_begun: bool,
    /// When something was last taken, or nothing waited.
    taken: Timestamp,
}

/// Bytes that may wait; one more line may come on top, so that any map fits.
const MAX_BYTES: usize = 256 << 10;
/// A client that takes nothing for so long is stuck.
const PATIENCE: Duration = Duration::from_secs(10);

impl Outbox {
    pub(super) fn new(at: Timestamp) -> Self {
        Self { lines: VecDeque::new(), bytes: 0, is_begun: false, taken: at }
    }

    pub(super) fn is_full(&self) -> bool {
        self.bytes >= MAX_BYTES
    }

    pub(super) fn push(&mut self, at: Timestamp, line: Bytes) {
        if self.lines.is_empty() {
            self.taken = at;
        }
        self.bytes += line.len();
        self.lines.push_back(line);
    }

    /// The bytes to be taken next; empty where nothing waits.
    pub(super) fn first(&self) -> &[u8] {
        self.lines.front().map_or(&[], |line| line)
    }

    pub(super) fn wrote(&mut self, at: Timestamp, count: usize) {
        let Some(first) = self.lines.front_mut() else { return };
        let count = count.min(first.len());
        first.advance(count);
        (self.taken, self.is_begun) = (at, true);
        self.bytes -= count;
        if first.is_empty() {
            self.lines.pop_front();
            self.is_begun = false;
        }
    }

    /// Forgets all but the line that has been begun.
    pub(super) fn clear(&mut self) {
        self.lines.truncate(usize::from(self.is_begun));
        self.bytes = self.lines.front().map_or(0, Bytes::len);
    }

    pub(super) fn is_stuck(&self, at: Timestamp) -> bool {
        self.deadline().is_some_and(|deadline| at >= deadline)
    }

    /// When it will be stuck, unless something is taken.
    pub(super) fn deadline(&self) -> Option<Timestamp> {
        (!self.lines.is_empty()).then(|| self.taken + PATIENCE)
    }
}
