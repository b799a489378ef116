//! Bytes and texts made worse, from one seed.

use slamd_sim::random::{Random, Stream};

/// A stream of decisions.
pub struct Mutator {
    random: Random,
}

const NUMBERS: [&str; 14] = [
    "0",
    "-1",
    "-0.0",
    "1e308",
    "-1e308",
    "1e-308",
    "nan",
    "inf",
    "-inf",
    "9223372036854775807",
    "-9223372036854775808",
    "99999999999999999999",
    "4294967296",
    "",
];
const INTEGERS: [u64; 10] =
    [0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0xFFFF_FFFF, 0x7FFF_FFFF_FFFF_FFFF, 0x8000_0000_0000_0000, u64::MAX];

impl Mutator {
    pub fn new(seed: u64) -> Self {
        Self { random: Random::new(seed, Stream::Link) }
    }

    pub fn below(&mut self, bound: usize) -> usize {
        self.random.below(bound)
    }

    pub fn chance(&mut self, probability: f64) -> bool {
        self.random.chance(probability)
    }

    pub fn noise(&mut self, count: usize) -> Vec<u8> {
        let words = (0..count.div_ceil(8)).map(|_| self.random.bits().to_le_bytes());
        words.flatten().take(count).collect()
    }

    /// Bytes with one to `most` changes.
    pub fn bytes(&mut self, mut bytes: Vec<u8>, most: usize) -> Vec<u8> {
        for _ in 0..=self.below(most) {
            let at = self.below(bytes.len() + 1);
            let length = self.below(1 + (bytes.len() - at).min(64));
            match self.below(8) {
                0 => bytes.truncate(at),
                1 => drop(bytes.drain(at..at + length)),
                2 => {
                    let again = bytes[at..at + length].to_vec();
                    bytes.splice(at..at, again);
                }
                3 => {
                    let noise = self.noise(length);
                    bytes.splice(at..at, noise);
                }
                4 => {
                    // Where a length may be.
                    let number = INTEGERS[self.below(INTEGERS.len())].to_le_bytes();
                    let width = 1 << self.below(4);
                    bytes.iter_mut().skip(at).zip(&number[..width]).for_each(|(byte, new)| *byte = *new);
                }
                _ => {
                    if let Some(byte) = bytes.get_mut(at) {
                        *byte ^= 1 << self.random.below(8);
                    }
                }
            }
        }
        bytes
    }

    /// A text with numbers, lines and letters changed.
    pub fn text(&mut self, text: &str) -> String {
        let mut text = text.to_owned();
        for _ in 0..=self.below(4) {
            match self.below(4) {
                0 => text = self.renumbered(&text),
                1 => {
                    let mut lines: Vec<&str> = text.lines().collect();
                    let (from, to) = (self.below(lines.len() + 1), self.below(lines.len() + 1));
                    if from < lines.len() {
                        let line = lines[from];
                        if self.chance(0.5) {
                            lines.remove(from);
                        }
                        lines.insert(to.min(lines.len()), line);
                    }
                    text = lines.join("\n");
                }
                2 => text = self.renumbered(&text),
                _ => text = String::from_utf8_lossy(&self.bytes(text.into_bytes(), 3)).into_owned(),
            }
        }
        text
    }

    fn renumbered(&mut self, text: &str) -> String {
        let is_number = |c: char| c.is_ascii_digit() || c == '.' || c == '-';
        let starts: Vec<usize> = text
            .char_indices()
            .filter(|&(i, c)| is_number(c) && !text[..i].ends_with(is_number))
            .map(|(i, _)| i)
            .collect();
        let Some(&start) = starts.get(self.below(starts.len())) else { return text.into() };
        let end = text[start..].find(|c| !is_number(c)).map_or(text.len(), |length| start + length);
        format!("{}{}{}", &text[..start], NUMBERS[self.below(NUMBERS.len())], &text[end..])
    }
}
