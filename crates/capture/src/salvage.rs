//! A file's bytes, kept from the start of the current record on: behind damage, reading continues at the next sound chunk.

use super::reader::{CRC, READ_LIMIT, RECORD_LIMIT};
use std::io::{self, ErrorKind, Read};

/// The bytes of a capture.
pub(super) struct Source<R> {
    file: R,
    /// Bytes of the file; those before `last` are of no more use.
    held: Vec<u8>,
    /// Where the record before the current one begins: its length may be damaged, and it may have swallowed chunks.
    last: usize,
    /// Where the current record begins.
    start: usize,
    /// How far the parser has been given them.
    passed: usize,
    /// What one read fills.
    scratch: Vec<u8>,
    is_searching: bool,
    /// Bytes searched for sound chunks.
    searched: u64,
}

/// Type of a chunk's record.
const CHUNK: u8 = 0x06;
/// Length of a record's type and length.
pub(super) const RECORD_HEAD: usize = 1 + 8;
/// Length of an uncompressed chunk's record before its messages: head, two times, size, checksum, an empty name, size.
pub(super) const CHUNK_HEAD: usize = RECORD_HEAD + 8 + 8 + 8 + 4 + 4 + 8;
/// Limit of the bytes that are searched and summed: a file made by hand must not take hours.
const MAX_SEARCHED: u64 = 1 << 30;

impl<R: Read> Source<R> {
    /// The source of a file from its present position on.
    pub(super) fn new(file: R) -> Self {
        Self {
            file,
            held: Vec::new(),
            last: 0,
            start: 0,
            passed: 0,
            scratch: vec![0; READ_LIMIT],
            is_searching: false,
            searched: 0,
        }
    }

    /// Gives the parser the next bytes; none at the end of the file.
    pub(super) fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        if self.passed >= self.held.len() {
            self.fill()?;
        }
        let waiting = self.held.get(self.passed..).unwrap_or_default();
        let count = waiting.len().min(to.len());
        if let (Some(to), Some(waiting)) = (to.get_mut(..count), waiting.get(..count)) {
            to.copy_from_slice(waiting);
        }
        self.passed += count;
        Ok(count)
    }

    /// The current record is sound: the next one begins so many bytes on.
    pub(super) const fn advance(&mut self, length: usize) {
        self.last = self.start;
        self.start += length;
    }

    /// Moves behind the current record's damage to the next chunk whose checksum is right. False if there is none.
    pub(super) fn seek_chunk(&mut self) -> io::Result<bool> {
        self.is_searching = true;
        let found = self.next_chunk();
        self.is_searching = false;
        found
    }

    fn next_chunk(&mut self) -> io::Result<bool> {
        self.start = self.last + 1;
        while self.searched < MAX_SEARCHED {
            let behind = self.held.get(self.start..).unwrap_or_default();
            let skipped = behind.iter().position(|byte| *byte == CHUNK).unwrap_or(behind.len());
            self.start += skipped;
            self.searched += skipped as u64 + 1;
            if !self.has(CHUNK_HEAD)? {
                break;
            }
            let Some(length) = self.held.get(self.start..).and_then(chunk_length) else {
                self.start += 1;
                continue;
            };
            if self.has(length)? {
                self.searched += length as u64;
                if self.held.get(self.start..).and_then(|bytes| bytes.get(..length)).is_some_and(is_sound) {
                    (self.last, self.passed) = (self.start, self.start);
                    return Ok(true);
                }
            }
            self.start += 1;
        }
        self.passed = self.held.len();
        Ok(false)
    }

    /// True if so many bytes are there from `start` on.
    fn has(&mut self, length: usize) -> io::Result<bool> {
        while self.held.len().saturating_sub(self.start) < length {
            if self.fill()? == 0 {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Reads more of the file; 0 at its end.
    fn fill(&mut self) -> io::Result<usize> {
        // What the search has passed is of no use, either.
        if self.is_searching {
            self.last = self.start;
        }
        if self.last >= READ_LIMIT && self.last >= self.held.len() / 2 {
            self.held.drain(..self.last.min(self.held.len()));
            self.passed = self.passed.saturating_sub(self.last);
            (self.start, self.last) = (self.start - self.last, 0);
        }
        loop {
            match self.file.read(&mut self.scratch) {
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Ok(count) => {
                    self.held.extend_from_slice(self.scratch.get(..count).unwrap_or_default());
                    return Ok(count);
                }
                Err(error) => return Err(error),
            }
        }
    }
}

/// The length of the record that begins here, if it may be an uncompressed chunk.
fn chunk_length(record: &[u8]) -> Option<usize> {
    let number = |at: usize| record.get(at..)?.first_chunk().map(|bytes| u64::from_le_bytes(*bytes));
    let messages = number(1)?.checked_sub((CHUNK_HEAD - RECORD_HEAD) as u64)?;
    let has_no_compression = record.get(37..41)? == [0; 4];
    let is_chunk = has_no_compression && number(25)? == messages && number(41)? == messages;
    let length = usize::try_from(messages).ok()?;
    (is_chunk && length <= RECORD_LIMIT).then(|| CHUNK_HEAD + length)
}

/// True if a chunk's checksum is right; one without a checksum cannot be told from noise.
fn is_sound(chunk: &[u8]) -> bool {
    let saved = chunk.get(33..).and_then(|bytes| bytes.first_chunk()).map(|bytes| u32::from_le_bytes(*bytes));
    chunk.get(CHUNK_HEAD..).is_some_and(|messages| saved == Some(CRC.checksum(messages)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_length_that_no_number_can_hold_is_no_chunk() {
        // What fuzzing found: all bits of a chunk's lengths are set.
        let mut record = [0xFF; 100];
        record[0] = CHUNK;
        record[37..41].fill(0);
        assert_eq!(chunk_length(&record), None);
        let file = [&[0], &record[..]].concat();
        let mut source = Source::new(&file[..]);
        assert!(!source.seek_chunk().unwrap());
    }
}
