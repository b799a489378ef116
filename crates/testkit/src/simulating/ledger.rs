//! Which frames the board sent, and which of them a reader made by the book would accept: `protocol/README.md` once more, in the plainest words.

use std::collections::VecDeque;

/// Content of a frame: type, number, payload.
type Content = Vec<u8>;

/// The frames under way.
#[derive(Default)]
pub struct Ledger {
    sent: VecDeque<Content>,
    /// Bytes since the last delimiter.
    open: Vec<u8>,
    pub accepted: u64,
    pub rejected: u64,
}

const CRC_LEN: usize = 4;
const LEAST: usize = 2 + CRC_LEN;
const MOST: usize = 250;

impl Ledger {
    /// The board sends a frame, whole.
    pub fn sent(&mut self, frame: &[u8]) {
        let (delimiter, stuffed) = frame.split_last().expect("a frame has bytes");
        assert_eq!(*delimiter, 0, "the board sends whole frames");
        self.sent.push_back(content(stuffed).expect("the board sends good frames"));
    }

    /// The host opens the port.
    pub fn opened(&mut self) {
        self.end();
    }

    /// The program on the host restarts.
    pub fn begins(&mut self) {
        self.open.clear();
        (self.accepted, self.rejected) = (0, 0);
    }

    /// The host has read bytes.
    pub fn heard(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            if byte == 0 {
                self.end();
            } else if self.open.len() <= MOST + 1 {
                self.open.push(byte);
            }
        }
    }

    fn end(&mut self) {
        let stuffed = std::mem::take(&mut self.open);
        if stuffed.is_empty() {
            return;
        }
        match content(&stuffed) {
            Some(content) => {
                self.accepted += 1;
                // Frames that were lost on the way stand in front of it.
                let place = self.sent.iter().position(|sent| *sent == content);
                let place =
                    place.unwrap_or_else(|| panic!("a frame was heard that the board has not sent: {content:?}"));
                self.sent.drain(..=place);
            }
            None => self.rejected += 1,
        }
    }
}

/// The content of a stuffed frame whose checksum holds.
fn content(stuffed: &[u8]) -> Option<Content> {
    let (mut content, mut rest) = (Vec::new(), stuffed);
    while let Some((&code, behind)) = rest.split_first() {
        let block = behind.get(..usize::from(code) - 1)?;
        content.extend(block);
        rest = &behind[block.len()..];
        if !rest.is_empty() {
            content.push(0);
        }
    }
    if !(LEAST..=MOST).contains(&content.len()) {
        return None;
    }
    let crc = content.split_off(content.len() - CRC_LEN);
    (crc32(&content).to_le_bytes()[..] == crc).then_some(content)
}

/// CRC-32 of Ethernet, bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    let step = |crc: u32, _| if crc & 1 == 1 { (crc >> 1) ^ 0xEDB8_8320 } else { crc >> 1 };
    !bytes.iter().fold(u32::MAX, |crc, &byte| (0..8).fold(crc ^ u32::from(byte), step))
}
