//! Frames out of a stream of bytes in which anything may be lost, added or changed.
//!
//! Every 0x00 is a fresh start: what went wrong before a delimiter cannot harm a frame behind it. The decoder takes one
//! byte at a time, so how the stream was cut into chunks cannot matter.

use crate::frame::{CRC_LEN, DELIMITER, Frame, MAX_CONTENT, MIN_CONTENT, checksum};
use arrayvec::ArrayVec;

/// Finds the frames in a stream of bytes.
#[derive(Clone, Debug, Default)]
pub struct FrameDecoder {
    /// The content so far, without the stuffing.
    content: ArrayVec<u8, MAX_CONTENT>,
    /// Bytes until the next stuffing code.
    block_left: u8,
    /// Bytes of the frame so far, as received.
    received: u64,
    /// The frame is longer than any frame: wait for the delimiter.
    overlong: bool,
    counters: DecoderCounters,
}

/// What a [`FrameDecoder`] has counted since it was made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DecoderCounters {
    /// Good frames.
    pub frames: u64,
    /// Frames that were stuffed well but whose checksum did not hold.
    pub crc_errors: u64,
    /// Frames with bad stuffing, too short or too long.
    pub malformed: u64,
    /// Bytes of all frames that were not good, delimiters included. An empty frame (one delimiter after another) means
    /// nothing and is not counted; neither is the frame in progress unless it is already too long.
    pub dropped_bytes: u64,
}

impl FrameDecoder {
    /// A decoder that takes the next byte for the first of a frame.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes one byte; gives the frame that it completes. Bad frames are counted and otherwise pass in silence.
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

    /// What has been counted so far.
    #[must_use]
    pub const fn counters(&self) -> DecoderCounters {
        self.counters
    }

    fn begin(&mut self) {
        self.content.clear();
        self.block_left = 0;
        self.overlong = false;
    }

    /// Adds what `byte` stands for to the content; `None` where that is full.
    fn unstuff(&mut self, byte: u8) -> Option<()> {
        if self.block_left > 0 {
            self.block_left -= 1;
            return self.content.try_push(byte).ok();
        }
        self.block_left = byte - 1; // not the delimiter, hence at least 1
        if self.received == 1 { Some(()) } else { self.content.try_push(0).ok() }
    }

    /// The delimiter has come.
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
