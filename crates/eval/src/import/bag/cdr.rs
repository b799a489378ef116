//! CDR, the serialization of ROS 2 messages, read member by member. Numbers are aligned to their size, counted from the fourth byte.

/// One message being read.
pub(super) struct Cdr<'a> {
    bytes: &'a [u8],
    at: usize,
    is_little: bool,
}

/// The first bytes name the encoding.
const HEADER: usize = 4;

impl<'a> Cdr<'a> {
    /// None if the bytes are not plain CDR.
    pub(super) fn new(bytes: &'a [u8]) -> Option<Self> {
        let (header, bytes) = bytes.split_at_checked(HEADER)?;
        // XCDR1 or XCDR2 without options, big or little endian.
        let is_little = match header.get(..2)? {
            [0, 0 | 6] => false,
            [0, 1 | 7] => true,
            _ => return None,
        };
        Some(Self { bytes, at: 0, is_little })
    }

    fn number<const SIZE: usize>(&mut self) -> Option<[u8; SIZE]> {
        let start = self.at.checked_next_multiple_of(SIZE)?;
        let mut bytes = *self.bytes.get(start..)?.first_chunk::<SIZE>()?;
        self.at = start + SIZE;
        if !self.is_little {
            bytes.reverse();
        }
        Some(bytes)
    }

    pub(super) fn u8(&mut self) -> Option<u8> {
        self.number().map(u8::from_le_bytes)
    }

    pub(super) fn i32(&mut self) -> Option<i32> {
        self.number().map(i32::from_le_bytes)
    }

    pub(super) fn u32(&mut self) -> Option<u32> {
        self.number().map(u32::from_le_bytes)
    }

    pub(super) fn f32(&mut self) -> Option<f64> {
        self.number().map(f32::from_le_bytes).map(f64::from)
    }

    pub(super) fn f64(&mut self) -> Option<f64> {
        self.number().map(f64::from_le_bytes)
    }

    /// The number of elements of a sequence that follow, each of at least `size` bytes.
    pub(super) fn count(&mut self, size: usize) -> Option<usize> {
        let count = usize::try_from(self.u32()?).ok()?;
        (count <= self.bytes.len().saturating_sub(self.at) / size.max(1)).then_some(count)
    }

    pub(super) fn text(&mut self) -> Option<String> {
        let count = self.count(1)?;
        let bytes = self.bytes.get(self.at..self.at + count)?;
        self.at += count;
        let text = String::from_utf8_lossy(bytes);
        Some(text.trim_end_matches('\0').to_owned())
    }

    /// The stamp of a `std_msgs/Header`, seconds, and its frame.
    pub(super) fn header(&mut self) -> Option<(f64, String)> {
        let (seconds, nanoseconds) = (self.i32()?, self.u32()?);
        Some((f64::from(seconds) + 1e-9 * f64::from(nanoseconds), self.text()?))
    }
}
