//! Turns the bytes of a message into a frame: appends a CRC-32, applies byte stuffing (COBS), ends
//! with 0x00.
//!
//! Consistent Overhead Byte Stuffing (Cheshire and Baker, 1999) replaces each zero by the distance
//! to the next one. Its special case, a block of 254 bytes without a zero, cannot occur here,
//! because a frame's content has at most 250 bytes. So stuffing costs exactly one byte.

use crate::message::Message;
use arrayvec::ArrayVec;
use crc::{CRC_32_ISO_HDLC, Crc};

/// The longest payload in bytes.
pub const MAX_PAYLOAD: usize = 244;

/// Bytes of the checksum at the end of the content.
pub(crate) const CRC_LEN: usize = 4;

/// The shortest content: type, sequence number, checksum.
pub(crate) const MIN_CONTENT: usize = 2 + CRC_LEN;

/// The longest content: type, sequence number, payload, checksum.
pub(crate) const MAX_CONTENT: usize = MIN_CONTENT + MAX_PAYLOAD;

/// The longest frame on the wire in bytes: the stuffed content and the delimiter.
pub const MAX_FRAME: usize = 1 + MAX_CONTENT + 1;

/// Ends every frame and occurs nowhere else.
pub const DELIMITER: u8 = 0x00;

const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// A payload under construction.
pub type PayloadBuf = ArrayVec<u8, MAX_PAYLOAD>;

/// A frame as it goes onto the wire, delimiter included.
pub type FrameBuf = ArrayVec<u8, MAX_FRAME>;

/// A frame whose checksum holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame<'a> {
    /// The message type, known or not: see [`crate::kind`].
    pub kind: u8,
    /// The sender's frame number, modulo 256.
    pub seq: u8,
    /// At most [`MAX_PAYLOAD`] bytes.
    pub payload: &'a [u8],
}

/// Encodes messages as frames and numbers them from 0.
#[derive(Clone, Debug, Default)]
pub struct FrameEncoder {
    seq: u8,
}

impl FrameEncoder {
    /// An encoder whose first frame has number 0.
    #[must_use]
    pub const fn new() -> Self {
        Self { seq: 0 }
    }

    /// The number of the next frame; the ACK of that frame repeats it.
    #[must_use]
    pub const fn next_seq(&self) -> u8 {
        self.seq
    }

    /// The next frame.
    #[must_use]
    pub fn encode(&mut self, message: &Message) -> FrameBuf {
        let mut payload = PayloadBuf::new();
        message.emit(&mut payload);
        let frame = encode_frame(message.kind(), self.seq, &payload);
        self.seq = self.seq.wrapping_add(1);
        frame
    }
}

/// The frame of any type, sequence number and payload. This version need not know the type.
#[must_use]
pub fn encode_frame(kind: u8, seq: u8, payload: &PayloadBuf) -> FrameBuf {
    let mut crc = CRC.digest();
    crc.update(&[kind, seq]);
    crc.update(payload);
    let crc = crc.finalize().to_le_bytes();

    let mut frame = FrameBuf::new();
    frame.push(1);
    let mut code_at = 0;
    for &byte in [kind, seq].iter().chain(payload).chain(&crc) {
        if byte == DELIMITER {
            code_at = frame.len();
            frame.push(1);
        } else {
            frame.push(byte);
            // At most 251: no block is longer than the longest content.
            if let Some(code) = frame.get_mut(code_at) {
                *code += 1;
            }
        }
    }
    frame.push(DELIMITER);
    frame
}

/// The CRC-32/ISO-HDLC (that of Ethernet and zlib) of `bytes`.
pub(crate) fn checksum(bytes: &[u8]) -> u32 {
    CRC.checksum(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_is_the_one_of_zlib() {
        assert_eq!(checksum(b"123456789"), 0xCBF4_3926);
    }

    #[test]
    fn the_longest_payload_without_a_zero_fits() {
        let payload = PayloadBuf::from([0xFF; MAX_PAYLOAD]);
        let frame = encode_frame(0xFF, 0xFF, &payload);
        assert_eq!(frame.len(), MAX_FRAME);
        assert_eq!(frame.iter().filter(|&&byte| byte == DELIMITER).count(), 1);
    }

    #[test]
    fn numbers_wrap() {
        let mut encoder = FrameEncoder::new();
        for _ in 0..256 {
            let _ = encoder.encode(&Message::Heartbeat);
        }
        assert_eq!(encoder.next_seq(), 0);
    }
}
