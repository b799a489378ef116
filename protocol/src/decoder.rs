//! Finds frames in a stream of bytes that may lose, gain or change any byte.
//!
//! The decoder resynchronizes at every 0x00: an error before a delimiter cannot affect a frame
//! after it. The decoder takes one byte at a time, so the division of the stream into chunks does
//! not matter.

use crate::frame::{CRC_LEN, DELIMITER, Frame, MAX_CONTENT, MIN_CONTENT, checksum};
use arrayvec::ArrayVec;

/// Finds the frames in a stream of bytes.
#[derive(Clone, Debug, Default)]
pub struct FrameDecoder {
    /// The content so far, with the stuffing removed.
    content: ArrayVec<u8, MAX_CONTENT>,
    /// Bytes until the next stuffing code.
    block_left: u8,
    /// Bytes of the frame so far, as received.
    received: u64,
    /// The frame exceeds the longest valid frame: wait for the delimiter.
    overlong: bool,
    counters: DecoderCounters,
}

/// The counts of a [`FrameDecoder`] since it was created.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DecoderCounters {
    /// Good frames.
    pub frames: u64,
    /// Frames with valid stuffing and a wrong checksum.
    pub crc_errors: u64,
    /// Frames with invalid stuffing, too short or too long.
    pub malformed: u64,
    /// Bytes of all rejected frames, including their delimiters. An empty frame (one delimiter
    /// after another) is idle and not counted. The frame in progress is counted only once it is too
    /// long.
    pub dropped_bytes: u64,
}

impl FrameDecoder {
    /// A decoder that takes the next byte as the first of a frame.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes one byte and returns the frame that it completes. Bad frames are only counted.
    pub fn push(&mut self, byte: u8) -> Option<Frame<'_>> {
        if byte == DELIMITER {
            return self.end();
        }
        if self.received == 0 {
            self.begin();
        }
        self.received += 1;
        if self.overlong {
            self.counters.dropped_bytes += 1;
        } else if self.unstuff(byte).is_none() {
            self.overlong = true;
            self.counters.malformed += 1;
            self.counters.dropped_bytes += self.received;
        }
        None
    }

    /// The counts so far.
    #[must_use]
    pub const fn counters(&self) -> DecoderCounters {
        self.counters
    }

    fn begin(&mut self) {
        self.content.clear();
        self.block_left = 0;
        self.overlong = false;
    }

    /// Adds the unstuffed `byte` to the content; `None` if the content is full.
    fn unstuff(&mut self, byte: u8) -> Option<()> {
        if self.block_left > 0 {
            self.block_left -= 1;
            return self.content.try_push(byte).ok();
        }
        self.block_left = byte - 1; // not the delimiter, hence at least 1
        if self.received == 1 { Some(()) } else { self.content.try_push(0).ok() }
    }

    /// Ends the frame at its delimiter.
    fn end(&mut self) -> Option<Frame<'_>> {
        let received = core::mem::take(&mut self.received);
        if received == 0 {
            return None;
        }
        if self.overlong {
            self.counters.dropped_bytes += 1; // the delimiter; the rest is counted already
            return None;
        }
        let whole = self.block_left == 0 && self.content.len() >= MIN_CONTENT;
        match self.content.split_last_chunk::<CRC_LEN>() {
            Some((covered @ &[kind, seq, ref payload @ ..], crc)) if whole => {
                if checksum(covered) == u32::from_le_bytes(*crc) {
                    self.counters.frames += 1;
                    return Some(Frame { kind, seq, payload });
                }
                self.counters.crc_errors += 1;
            }
            _ => self.counters.malformed += 1,
        }
        self.counters.dropped_bytes += received + 1;
        None
    }
}
