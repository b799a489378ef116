//! Lines that wait to be read by a client.

use bytes::{Buf as _, Bytes};
use slamd_core::Timestamp;
use std::collections::VecDeque;
use std::time::Duration;

/// Waiting lines; the first holds only its unwritten rest.
#[derive(Debug)]
pub(super) struct SendQueue {
    lines: VecDeque<Bytes>,
    bytes: usize,
    /// A part of the first line was written.
    is_begun: bool,
    /// When bytes were last written, or the queue was empty.
    progress_at: Timestamp,
}

/// Bytes that may wait; one more line may exceed it, so that any map fits.
const MAX_BYTES: usize = 256 << 10;
/// A client that reads nothing for so long is dropped.
const STALL_TIMEOUT: Duration = Duration::from_secs(10);

impl SendQueue {
    pub(super) fn new(at: Timestamp) -> Self {
        Self { lines: VecDeque::new(), bytes: 0, is_begun: false, progress_at: at }
    }

    pub(super) fn is_full(&self) -> bool {
        self.bytes >= MAX_BYTES
    }

    pub(super) fn push(&mut self, at: Timestamp, line: Bytes) {
        if self.lines.is_empty() {
            self.progress_at = at;
        }
        self.bytes += line.len();
        self.lines.push_back(line);
    }

    /// The bytes to write next; empty if nothing waits.
    pub(super) fn first(&self) -> &[u8] {
        self.lines.front().map_or(&[], |line| line)
    }

    pub(super) fn wrote(&mut self, at: Timestamp, count: usize) {
        let Some(first) = self.lines.front_mut() else { return };
        let count = count.min(first.len());
        first.advance(count);
        (self.progress_at, self.is_begun) = (at, true);
        self.bytes -= count;
        if first.is_empty() {
            self.lines.pop_front();
            self.is_begun = false;
        }
    }

    /// Removes all lines but one that is partly written.
    pub(super) fn clear(&mut self) {
        self.lines.truncate(usize::from(self.is_begun));
        self.bytes = self.lines.front().map_or(0, Bytes::len);
    }

    pub(super) fn is_stalled(&self, at: Timestamp) -> bool {
        self.deadline().is_some_and(|deadline| at >= deadline)
    }

    /// When the client counts as stalled, unless it reads something.
    pub(super) fn deadline(&self) -> Option<Timestamp> {
        (!self.lines.is_empty()).then(|| self.progress_at + STALL_TIMEOUT)
    }
}
