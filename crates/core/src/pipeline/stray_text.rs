//! Text between the frames: somebody has left prints in the firmware.
//!
//! The text becomes part of the frame after it, which is then damaged. Only damaged frames are searched: whole ones hold text, too.

use slamd_protocol::DELIMITER;

/// Searches damaged frames for text.
#[derive(Clone, Debug)]
pub(super) struct StrayText {
    chunk: Vec<u8>,
    damaged: u64,
    first: String,
    count: u64,
}

/// Bytes kept of a frame, and characters quoted.
const MAX_CHUNK: usize = 512;
const MAX_QUOTED: usize = 40;
/// Least number of characters of a line that ends, and of a text at the start of a frame. Damage makes either once in thousands of frames.
const MIN_LINE: usize = 6;
const MIN_START: usize = 8;
/// Texts before they are reported: a boot loader prints once.
const MIN_COUNT: u64 = 2;

impl StrayText {
    pub(super) fn new() -> Self {
        Self { chunk: Vec::with_capacity(MAX_CHUNK), damaged: 0, first: String::new(), count: 0 }
    }

    /// Frames with text before or within them.
    pub(super) const fn count(&self) -> u64 {
        self.count
    }

    /// Takes a byte after the decoder, which has accepted `frames` and rejected `damaged` ones by now. True once the text is to be reported.
    /// Text without any frame belongs to a boot loader or another firmware.
    pub(super) fn take(&mut self, byte: u8, frames: u64, damaged: u64) -> bool {
        if byte != DELIMITER {
            if self.chunk.len() < MAX_CHUNK {
                self.chunk.push(byte);
            }
            return false;
        }
        let is_damaged = std::mem::replace(&mut self.damaged, damaged) != damaged;
        let text = if is_damaged { text(&self.chunk) } else { None };
        self.chunk.clear();
        let Some(text) = text else { return false };
        self.count += 1;
        let is_first = frames > 0 && self.count >= MIN_COUNT && self.first.is_empty();
        if is_first {
            self.first = text;
        }
        is_first
    }

    /// The problem, and what to do.
    pub(super) fn report(&self) -> String {
        format!(
            "readable text between frames: `{}`: take the prints out of the firmware, or send them as LOG messages",
            self.first
        )
    }
}

/// The longest line of text in the bytes, without control characters.
fn text(chunk: &[u8]) -> Option<String> {
    let is_text = |byte: &u8| matches!(byte, b' '..=b'~' | b'\t' | b'\r' | b'\n');
    let is_end = |byte: &u8| matches!(byte, b'\r' | b'\n');
    let mut runs = chunk.split(|byte| !is_text(byte)).enumerate();
    let length = |run: &[u8]| run.iter().filter(|byte| !byte.is_ascii_control()).count();
    let run = runs.find_map(|(index, run)| {
        let ended = run.iter().rposition(is_end).and_then(|end| run.get(..end)).filter(|run| length(run) >= MIN_LINE);
        ended.or_else(|| (index == 0 && length(run) >= MIN_START).then_some(run))
    })?;
    let lines = run.split(is_end).map(|line| String::from_utf8_lossy(line).replace('`', "'"));
    let line = lines.map(|line| line.trim().to_owned()).max_by_key(String::len)?;
    Some(line.chars().filter(|c| !c.is_control()).take(MAX_QUOTED).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use slamd_protocol::{Encoder, FrameDecoder, FrameEncoder, Log, Message, Text};

    /// What is reported of frames, every tenth after the print, the first one before any frame.
    fn reported(print: &[u8], message: &Message) -> (Vec<String>, u64) {
        let (mut text, mut decoder, mut encoder) = (StrayText::new(), FrameDecoder::new(), FrameEncoder::default());
        let mut said = Vec::new();
        for index in 0..200 {
            let mut bytes = if index % 10 == 0 { print.to_vec() } else { Vec::new() };
            bytes.extend_from_slice(&encoder.encode(message));
            for byte in bytes {
                let _ = decoder.push(byte);
                let counted = decoder.counters();
                if text.take(byte, counted.frames, counted.crc_errors + counted.malformed) {
                    said.push(text.report());
                }
            }
        }
        (said, text.count())
    }

    #[test]
    fn prints_are_quoted_once_and_bounded() {
        let message = Message::Encoder(Encoder { t_us: 77, left_ticks: 5, ..Encoder::default() });
        for (print, quoted) in [
            (&b"dist=23 cm\r\n"[..], "`dist=23 cm`"),
            (b"Distance: 118 cm, free RAM 1203\r\n", "`Distance: 118 cm, free RAM 1203`"),
            (b"loop() says hello", "`loop() says hello"),
            (
                b"a `very` long line that nobody would like to see whole in a log file\n",
                "`a 'very' long line that nobody would lik`",
            ),
        ] {
            let (said, count) = reported(print, &message);
            assert_eq!((said.len(), count), (1, 20), "{said:?}");
            assert!(said[0].contains(quoted), "{said:?}");
        }
    }

    #[test]
    fn damage_is_no_text() {
        let message = Message::Log(Log { level: 2, text: Text::new("calibration of the ring is done") });
        for noise in [&b"\x80\xff\x03"[..], b"\x11abc\n", b"\r\n"] {
            assert_eq!(reported(noise, &message).1, 0, "{noise:?}");
        }
    }
}
