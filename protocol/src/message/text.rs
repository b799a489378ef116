//! Text of bounded length that is safe to display: it cannot move a cursor or reverse a line.

use arrayvec::ArrayString;
use core::fmt;
use core::ops::Deref;

/// At most `N` bytes of UTF-8 without control characters.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
pub struct Text<const N: usize>(ArrayString<N>);

impl<const N: usize> Text<N> {
    /// As much of `text` as fits, as [`Text::from_bytes`] reads it.
    #[must_use]
    pub fn new(text: &str) -> Self {
        Self::from_bytes(text.as_bytes())
    }

    /// As much of `bytes` as fits, in whole characters and up to the first zero. Invalid UTF-8 and
    /// control characters are removed, because a board's text is shown in terminals, logs and other
    /// programs.
    #[must_use]
    pub fn from_bytes(bytes: &[u8]) -> Self {
        let bytes = bytes.split(|&byte| byte == 0).next().unwrap_or_default();
        let mut text = ArrayString::new();
        let letters = bytes.utf8_chunks().flat_map(|chunk| chunk.valid().chars());
        for letter in letters.filter(|letter| !is_control(*letter)) {
            if text.try_push(letter).is_err() {
                break;
            }
        }
        Self(text)
    }
}

/// Control characters, line separators and Unicode's bidirectional controls, which reverse a line.
fn is_control(letter: char) -> bool {
    letter.is_control() || matches!(letter, '\u{200E}' | '\u{200F}' | '\u{2028}'..='\u{202E}' | '\u{2066}'..='\u{2069}')
}

impl<const N: usize> Deref for Text<N> {
    type Target = str;

    fn deref(&self) -> &str {
        &self.0
    }
}

impl<const N: usize> fmt::Debug for Text<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(&self.0, f)
    }
}

impl<const N: usize> fmt::Display for Text<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&self.0, f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_character_is_whole_or_absent() {
        assert_eq!(&*Text::<4>::new("abcé"), "abc");
        assert_eq!(&*Text::<5>::new("abcé"), "abcé");
        assert_eq!(&*Text::<5>::new("abcéd"), "abcé");
    }

    #[test]
    fn what_is_not_text_is_left_out() {
        assert_eq!(&*Text::<8>::from_bytes(b"a\xFFb\xC3"), "ab");
        assert_eq!(&*Text::<8>::from_bytes(b"ab\0cd"), "ab");
    }

    #[test]
    fn nothing_moves_the_cursor() {
        assert_eq!(&*Text::<16>::from_bytes(b"a\x1b[2Jb\r\nc\x7f\xC2\x9Bd"), "a[2Jbcd");
        assert_eq!(&*Text::<16>::new("a\u{202E}b\u{2028}c\u{2066}d"), "abcd");
    }
}
