//! Text of bounded length.

use arrayvec::ArrayString;
use core::fmt;
use core::ops::Deref;

/// At most `N` bytes of UTF-8 without a zero byte, which would end it on the wire.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
pub struct Text<const N: usize>(ArrayString<N>);

impl<const N: usize> Text<N> {
    /// As much of `text` as fits, in whole characters and up to the first NUL.
    #[must_use]
    pub fn new(text: &str) -> Self {
        Self::from_bytes(text.as_bytes())
    }

    /// As much of `bytes` as fits, in whole characters and up to the first zero, without what is not UTF-8.
    #[must_use]
    pub fn from_bytes(bytes: &[u8]) -> Self {
        let bytes = bytes.split(|&byte| byte == 0).next().unwrap_or_default();
        let mut text = ArrayString::new();
        for letter in bytes.utf8_chunks().flat_map(|chunk| chunk.valid().chars()) {
            if text.try_push(letter).is_err() {
                break;
            }
        }
        Self(text)
    }
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
}
