//! Reads and writes little-endian fields.

use super::{MessageError, Text};
use crate::frame::PayloadBuf;

/// Reads the fields of a payload from its front. If the bytes run out, it returns the message's
/// length error.
pub(super) struct Reader<'a> {
    rest: &'a [u8],
    too_short: MessageError,
}

impl<'a> Reader<'a> {
    /// A reader of the payload of `message`; `expected` describes the valid lengths in words.
    pub(super) fn new(message: &'static str, expected: &'static str, payload: &'a [u8]) -> Self {
        Self { rest: payload, too_short: MessageError::Length { message, got: payload.len(), expected } }
    }

    /// The next `N` bytes.
    pub(super) fn bytes<const N: usize>(&mut self) -> Result<[u8; N], MessageError> {
        let (bytes, rest) = self.rest.split_first_chunk().ok_or(self.too_short)?;
        self.rest = rest;
        Ok(*bytes)
    }

    pub(super) fn u8(&mut self) -> Result<u8, MessageError> {
        self.bytes().map(u8::from_le_bytes)
    }

    pub(super) fn u16(&mut self) -> Result<u16, MessageError> {
        self.bytes().map(u16::from_le_bytes)
    }

    pub(super) fn i16(&mut self) -> Result<i16, MessageError> {
        self.bytes().map(i16::from_le_bytes)
    }

    pub(super) fn u32(&mut self) -> Result<u32, MessageError> {
        self.bytes().map(u32::from_le_bytes)
    }

    pub(super) fn i32(&mut self) -> Result<i32, MessageError> {
        self.bytes().map(i32::from_le_bytes)
    }

    pub(super) fn u64(&mut self) -> Result<u64, MessageError> {
        self.bytes().map(u64::from_le_bytes)
    }

    /// A text field of `N` bytes.
    pub(super) fn text<const N: usize>(&mut self) -> Result<Text<N>, MessageError> {
        self.bytes::<N>().map(|bytes| Text::from_bytes(&bytes))
    }

    /// All remaining bytes.
    pub(super) fn rest(self) -> &'a [u8] {
        self.rest
    }

    /// All remaining bytes, as at most `max` items of `N` bytes.
    pub(super) fn items<const N: usize>(self, max: usize) -> Result<&'a [[u8; N]], MessageError> {
        match self.rest.as_chunks() {
            (items, []) if items.len() <= max => Ok(items),
            _ => Err(self.too_short),
        }
    }
}

/// Appends fields to a payload.
pub(super) struct Writer<'a>(pub(super) &'a mut PayloadBuf);

impl Writer<'_> {
    #[expect(
        clippy::expect_used,
        reason = "the test `the_fullest_messages_fit` covers it, and no received bytes get here"
    )]
    pub(super) fn bytes(&mut self, bytes: &[u8]) -> &mut Self {
        self.0.try_extend_from_slice(bytes).expect("the types bound every message to a payload's length");
        self
    }

    pub(super) fn u8(&mut self, value: u8) -> &mut Self {
        self.bytes(&[value])
    }

    pub(super) fn u16(&mut self, value: u16) -> &mut Self {
        self.bytes(&value.to_le_bytes())
    }

    pub(super) fn i16(&mut self, value: i16) -> &mut Self {
        self.bytes(&value.to_le_bytes())
    }

    pub(super) fn u32(&mut self, value: u32) -> &mut Self {
        self.bytes(&value.to_le_bytes())
    }

    pub(super) fn i32(&mut self, value: i32) -> &mut Self {
        self.bytes(&value.to_le_bytes())
    }

    pub(super) fn u64(&mut self, value: u64) -> &mut Self {
        self.bytes(&value.to_le_bytes())
    }

    /// A text field of `N` bytes, padded with zeros.
    pub(super) fn text<const N: usize>(&mut self, text: &Text<N>) -> &mut Self {
        let mut padded = [0; N];
        for (byte, &letter) in padded.iter_mut().zip(text.as_bytes()) {
            *byte = letter;
        }
        self.bytes(&padded)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Echo, Geometry, Log, MAX_ECHOES, MAX_PLACEMENTS, Message, Placement, SensorEcho, Sonar, Text};
    use crate::frame::{MAX_PAYLOAD, PayloadBuf};

    /// All other messages have at most the 63 bytes of HELLO.
    #[test]
    fn the_fullest_messages_fit() {
        let echoes = [SensorEcho { sensor: 0, echo: Echo::NoEcho }; MAX_ECHOES].into();
        let sonar = Sonar { t_us: 0, group: 0, last_of_cycle: true, left_ticks: 0, right_ticks: 0, echoes };
        let places = [Placement::default(); MAX_PLACEMENTS];
        let geometry = Geometry::new(64, 0, &places).unwrap();
        let log = Log { level: 0, text: Text::from_bytes(&[b'x'; MAX_PAYLOAD]) };
        let mut payload = PayloadBuf::new();
        for (message, length) in
            [(Message::Sonar(sonar), 206), (Message::Geometry(geometry), 236), (Message::Log(log), MAX_PAYLOAD)]
        {
            message.emit(&mut payload);
            assert_eq!(payload.len(), length);
        }
    }
}
