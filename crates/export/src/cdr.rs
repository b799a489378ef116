//! CDR, the serialization of ROS 2 messages: plain XCDR version 1, little endian (OMG DDS-XTypes 1.3,
//! 7.4.3).
//!
//! Four bytes name the encoding. Every number after them is aligned to its own size, counted from
//! their end; the padding is zero. A string has its length and a final zero byte, a sequence its
//! count. Arrays of a fixed length and structures have no prefix.

/// One message being written, member by member.
#[derive(Debug)]
pub(super) struct Cdr {
    bytes: Vec<u8>,
}

/// `CDR_LE`, no options.
const ENCODING: [u8; 4] = [0, 1, 0, 0];

impl Cdr {
    pub(super) fn new() -> Self {
        Self { bytes: ENCODING.to_vec() }
    }

    pub(super) fn u8(&mut self, value: u8) {
        self.bytes.push(value);
    }

    pub(super) fn i32(&mut self, value: i32) {
        self.number(value.to_le_bytes());
    }

    pub(super) fn u32(&mut self, value: u32) {
        self.number(value.to_le_bytes());
    }

    pub(super) fn f32(&mut self, value: f32) {
        self.number(value.to_le_bytes());
    }

    pub(super) fn f64(&mut self, value: f64) {
        self.number(value.to_le_bytes());
    }

    /// An array of a fixed length.
    pub(super) fn f64s(&mut self, values: &[f64]) {
        values.iter().for_each(|&value| self.f64(value));
    }

    /// A string. Zero bytes would end it, so they are left out.
    pub(super) fn text(&mut self, text: &str) {
        let bytes = || text.bytes().filter(|&byte| byte != 0);
        self.count(bytes().count() + 1);
        self.bytes.extend(bytes());
        self.bytes.push(0);
    }

    /// The number of elements of a sequence. The elements follow.
    pub(super) fn count(&mut self, count: usize) {
        self.u32(u32::try_from(count).expect("no message is that long"));
    }

    /// A sequence of 8-bit integers.
    pub(super) fn i8s(&mut self, values: &[i8]) {
        self.count(values.len());
        self.bytes.extend(values.iter().map(|value| value.cast_unsigned()));
    }

    /// The finished message.
    pub(super) fn finish(self) -> Vec<u8> {
        self.bytes
    }

    fn number<const SIZE: usize>(&mut self, bytes: [u8; SIZE]) {
        let end = (self.bytes.len() - ENCODING.len()).next_multiple_of(SIZE);
        self.bytes.resize(ENCODING.len() + end, 0);
        self.bytes.extend(bytes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(write: impl Fn(&mut Cdr)) -> Vec<u8> {
        let mut cdr = Cdr::new();
        write(&mut cdr);
        let bytes = cdr.finish();
        assert_eq!(bytes[..4], [0, 1, 0, 0]);
        bytes[4..].to_vec()
    }

    #[test]
    fn numbers_are_aligned_to_their_size() {
        let bytes = written(|cdr| {
            cdr.u8(7);
            cdr.u32(0x0102_0304);
            cdr.u8(8);
            cdr.f64(1.0);
            cdr.u8(9);
            cdr.i32(-2);
        });
        let expected: [&[u8]; 9] = [
            &[7],
            &[0; 3],
            &[4, 3, 2, 1],
            &[8],
            &[0; 7],
            &[0, 0, 0, 0, 0, 0, 0xf0, 0x3f],
            &[9],
            &[0; 3],
            &[0xfe, 0xff, 0xff, 0xff],
        ];
        assert_eq!(bytes, expected.concat());
    }

    #[test]
    fn alignment_starts_after_the_encoding() {
        // Eight bytes right after the four: no padding.
        assert_eq!(written(|cdr| cdr.f64(0.0)).len(), 8);
    }

    #[test]
    fn a_string_has_its_length_and_a_zero() {
        assert_eq!(written(|cdr| cdr.text("map")), [4, 0, 0, 0, b'm', b'a', b'p', 0]);
        assert_eq!(written(|cdr| cdr.text("")), [1, 0, 0, 0, 0]);
        assert_eq!(written(|cdr| cdr.text("m\0a")), [3, 0, 0, 0, b'm', b'a', 0]);
        let bytes = written(|cdr| {
            cdr.text("ab");
            cdr.f32(-0.0);
        });
        assert_eq!(bytes, [3, 0, 0, 0, b'a', b'b', 0, 0, 0, 0, 0, 0x80]);
    }

    #[test]
    fn an_empty_sequence_is_only_its_count() {
        let bytes = written(|cdr| {
            cdr.i8s(&[-1, 100]);
            cdr.count(0);
        });
        assert_eq!(bytes, [2, 0, 0, 0, 0xff, 100, 0, 0, 0, 0, 0, 0]);
    }

    #[test]
    fn an_array_of_a_fixed_length_has_no_count() {
        let bytes = written(|cdr| {
            cdr.u32(1);
            cdr.f64s(&[0.0, 0.0]);
        });
        assert_eq!(bytes.len(), 4 + 4 + 16);
    }
}
