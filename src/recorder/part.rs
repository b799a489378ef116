//! One file of a recording: traffic is encoded in memory, and goes from there to the disk in pieces of any size.

use super::{Chunk, Disk};
use slamd_capture::{CaptureInfo, CaptureWriter};
use slamd_core::Timestamp;
use std::io::{self, ErrorKind, Write};
use std::sync::{Arc, Mutex, PoisonError};

/// One file of the recording.
pub(super) struct Part<F> {
    pub(super) number: u32,
    pub(super) file: F,
    pub(super) writer: CaptureWriter<Memory>,
    pub(super) memory: Memory,
    pub(super) began: Timestamp,
    pub(super) written: u64,
    /// The file is given a chunk.
    pub(super) is_used: bool,
    /// Chunks that the file holds.
    pub(super) held: u64,
    /// The disk has refused to keep what it had taken.
    pub(super) is_doubtful: bool,
    /// Chunks that are encoded but not yet in the file.
    pub(super) encoded: u64,
    /// Those of them that are in the open capture chunk.
    pub(super) open: u64,
}

impl<F: Write> Part<F> {
    pub(super) fn begin<D: Disk<File = F>>(
        disk: &mut D,
        info: &CaptureInfo,
        number: u32,
        began: Timestamp,
    ) -> io::Result<Self> {
        let file = disk.create(number)?;
        let memory = Memory::default();
        let writer = CaptureWriter::begin(memory.clone(), &disk.path(number), info).map_err(io::Error::other)?;
        Ok(Self {
            number,
            file,
            writer,
            memory,
            began,
            written: 0,
            is_used: false,
            held: 0,
            is_doubtful: false,
            encoded: 0,
            open: 0,
        })
    }

    /// Begins the first file from `number` on that does not exist. Its head is written if the disk takes it.
    pub(super) fn begin_next<D: Disk<File = F>>(
        disk: &mut D,
        info: &CaptureInfo,
        mut number: u32,
        began: Timestamp,
    ) -> io::Result<Self> {
        loop {
            let begun = Self::begin(disk, info, number, began).and_then(|mut part| match part.drain() {
                Err(error) if error.kind() == ErrorKind::AlreadyExists => Err(error),
                _ => Ok(part),
            });
            match begun {
                Err(error) if error.kind() == ErrorKind::AlreadyExists && number < u32::MAX => number += 1,
                begun => return begun,
            }
        }
    }

    pub(super) fn encode(&mut self, chunk: &Chunk) -> io::Result<()> {
        let closed = self.memory.len();
        match chunk {
            Chunk::Received(at, bytes) => self.writer.received(*at, bytes),
            Chunk::Sent(at, bytes) => self.writer.sent(*at, bytes),
            Chunk::Opened(at) => self.writer.opened(*at),
        }
        .map_err(io::Error::other)?;
        self.open = if self.memory.len() > closed { 1 } else { self.open + 1 };
        (self.is_used, self.encoded) = (true, self.encoded + 1);
        Ok(())
    }

    /// Writes the encoded bytes to the file.
    pub(super) fn drain(&mut self) -> io::Result<()> {
        let mut memory = self.memory.0.lock().unwrap_or_else(PoisonError::into_inner);
        while !memory.is_empty() {
            match self.file.write(&memory) {
                Ok(0) => return Err(ErrorKind::WriteZero.into()),
                Ok(count) => {
                    memory.drain(..count);
                    self.written += count as u64;
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        if self.writer.flush_in().is_none() {
            self.open = 0;
        }
        self.held += self.encoded - self.open;
        self.encoded = self.open;
        Ok(())
    }

    pub(super) fn close(&mut self) -> io::Result<()> {
        self.writer.end().map_err(io::Error::other)?;
        self.drain()?;
        // After a failed sync the system forgets what it could not write: a second sync that succeeds proves nothing.
        self.file.flush().inspect_err(|_| self.is_doubtful = true)
    }
}

/// The buffer that the capture writer writes to; it never fails.
#[derive(Clone, Default)]
pub(super) struct Memory(Arc<Mutex<Vec<u8>>>);

impl Memory {
    pub(super) fn len(&self) -> usize {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).len()
    }
}

impl Write for Memory {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
