//! A recording that outlives its disk's failures: what cannot be written waits, and is written when it can be.
//!
//! A state machine: chunks and times in, bytes to a [`Disk`] out. What is read is first encoded in memory, one capture chunk ahead of the
//! file at most, and the file takes it from there in whatever pieces it likes; a write that failed is done again at the same place. Behind
//! that, chunks wait up to a bound; what comes when it is reached is counted as lost. So a capture is what went over the line from its
//! beginning on, with a gap where the disk failed for longer than the bound lasts.

use super::{Chunk, Disk};
use slamd_capture::{CaptureError, CaptureInfo, CaptureWriter};
use slamd_core::Timestamp;
use std::collections::VecDeque;
use std::io::{self, ErrorKind, Write};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// When a recording begins another file, and when it stops for want of room.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Plan {
    /// Another file is begun when one has so many bytes.
    pub most_bytes: Option<u64>,
    /// Another file is begun when one is so old.
    pub most_time: Option<Duration>,
    /// Only so many files are kept: the oldest of this recording is deleted.
    pub keep: Option<u32>,
    /// Nothing is written while fewer bytes are free.
    pub keep_free_bytes: u64,
}

/// What a recording lacks.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Losses {
    /// Chunks that were not written.
    pub chunks: u64,
    /// Why the last file could not be closed as it should be; what is in it can be read all the same.
    pub unfinished: Option<String>,
}

/// A recording.
pub struct Tape<D: Disk> {
    disk: D,
    info: CaptureInfo,
    plan: Plan,
    part: Part<D::File>,
    waiting: VecDeque<Chunk>,
    waiting_bytes: usize,
    now: Timestamp,
    trouble: Option<Trouble>,
    look_at_room: Timestamp,
    lost: u64,
    complain_at: Timestamp,
    notices: VecDeque<String>,
}

/// One file.
struct Part<F> {
    number: u32,
    file: F,
    writer: CaptureWriter<Memory>,
    memory: Memory,
    began: Timestamp,
    written: u64,
    /// Something was recorded in it.
    is_used: bool,
    /// Chunks that are encoded and not in the file.
    encoded: u64,
    /// Those of them in the capture chunk that is open.
    open: u64,
}

struct Trouble {
    since: Timestamp,
    retry_at: Timestamp,
    lost_before: u64,
    is_told: bool,
}

/// Payload and overhead of what may wait: three quarters of an hour at 6 kB/s.
const MAX_WAITING: usize = 16 << 20;
const OVERHEAD: usize = 64;
const RETRY: Duration = Duration::from_secs(1);
const ROOM: Duration = Duration::from_secs(1);
/// A file that cannot be written for so long, though there is room, is given up for another: a disk may have been taken out and put back.
const GIVE_UP: Duration = Duration::from_secs(10);
const COMPLAINT: Duration = Duration::from_secs(60);

impl<D: Disk> Tape<D> {
    /// Creates the first file and writes what it says about itself.
    ///
    /// # Errors
    /// When that fails.
    pub fn begin(mut disk: D, info: CaptureInfo, plan: Plan) -> Result<Self, CaptureError> {
        let path = disk.path(1);
        let begun = Part::begin(&mut disk, &info, 1, Timestamp::default()).and_then(|mut part| {
            part.drain()?;
            Ok(part)
        });
        Ok(Self {
            part: begun.map_err(|source| CaptureError::Io { path, source })?,
            disk,
            info,
            plan,
            waiting: VecDeque::new(),
            waiting_bytes: 0,
            now: Timestamp::default(),
            trouble: None,
            look_at_room: Timestamp::default(),
            lost: 0,
            complain_at: Timestamp::default(),
            notices: VecDeque::new(),
        })
    }

    /// Records a chunk. Its time is not before that of the one in front of it.
    pub fn push(&mut self, chunk: Chunk) {
        let at = chunk.at();
        let size = chunk.len() + OVERHEAD;
        if self.waiting_bytes + size > MAX_WAITING {
            self.lost += 1;
        } else {
            self.waiting_bytes += size;
            self.waiting.push_back(chunk);
        }
        self.advance(at);
    }

    /// Writes what is due.
    pub fn advance(&mut self, now: Timestamp) {
        self.now = self.now.max(now);
        if self.trouble.as_ref().is_some_and(|trouble| self.now < trouble.retry_at) {
            return;
        }
        match self.write() {
            Ok(()) => self.well(),
            Err(error) => self.ill(&error),
        }
    }

    /// How long after the newest chunk there is something to be written; none where there is not.
    #[must_use]
    pub fn flush_in(&self) -> Option<Duration> {
        if self.trouble.is_some() { None } else { self.part.writer.flush_in() }
    }

    /// The time of the last call.
    #[must_use]
    pub const fn now(&self) -> Timestamp {
        self.now
    }

    /// The number of the file that is being written.
    #[must_use]
    pub const fn part(&self) -> u32 {
        self.part.number
    }

    /// What is lost so far.
    #[must_use]
    pub const fn lost(&self) -> u64 {
        self.lost
    }

    /// Bytes that wait for the disk.
    #[must_use]
    pub fn waiting_bytes(&self) -> usize {
        self.waiting_bytes + self.part.memory.len()
    }

    /// Something that a person should know; one a minute at most, and the end of what was told.
    pub fn poll_notice(&mut self) -> Option<String> {
        self.notices.pop_front()
    }

    /// Writes everything and closes the file.
    pub fn finish(mut self) -> Losses {
        let result = self.write().and_then(|()| self.part.close());
        let waiting = self.waiting.len() as u64;
        match result {
            Ok(()) => Losses { chunks: self.lost, unfinished: None },
            Err(error) => Losses {
                chunks: self.lost + waiting + self.part.encoded,
                unfinished: Some(format!("{}: {error}", self.disk.path(self.part.number).display())),
            },
        }
    }

    fn write(&mut self) -> io::Result<()> {
        self.room()?;
        self.part.drain()?;
        while let Some(chunk) = self.waiting.front() {
            let at = chunk.at();
            if self.is_full(at) {
                self.turn(at)?;
                continue;
            }
            self.waiting_bytes -= chunk.len() + OVERHEAD;
            if let Some(chunk) = self.waiting.pop_front() {
                self.part.encode(&chunk)?;
            }
            self.part.drain()?;
        }
        self.part.writer.flush_if_due(self.now).map_err(io::Error::other)?;
        self.part.drain()
    }

    fn room(&mut self) -> io::Result<()> {
        if self.plan.keep_free_bytes == 0 || self.now < self.look_at_room {
            return Ok(());
        }
        match self.disk.free_bytes() {
            Some(free) if free < self.plan.keep_free_bytes => {
                let words =
                    format!("{} MiB are free, and {} shall stay free", free >> 20, self.plan.keep_free_bytes >> 20);
                Err(io::Error::new(ErrorKind::StorageFull, words))
            }
            _ => {
                self.look_at_room = self.now + ROOM;
                Ok(())
            }
        }
    }

    /// True where a chunk of that time belongs into another file.
    fn is_full(&self, at: Timestamp) -> bool {
        let age = Duration::from_micros(at.us().saturating_sub(self.part.began.us()));
        self.part.is_used
            && (self.plan.most_bytes.is_some_and(|most| self.part.written >= most)
                || self.plan.most_time.is_some_and(|most| age >= most))
    }

    /// Closes the file and begins the next.
    fn turn(&mut self, at: Timestamp) -> io::Result<()> {
        // Closed only once; where the next file cannot be begun, the closing is not undone.
        self.part.close()?;
        self.next_part(at)
    }

    fn next_part(&mut self, at: Timestamp) -> io::Result<()> {
        let mut number = self.part.number + 1;
        self.part = loop {
            match Part::begin(&mut self.disk, &self.info, number, at) {
                Err(error) if error.kind() == ErrorKind::AlreadyExists => number += 1,
                begun => break begun?,
            }
        };
        if let Some(oldest) =
            self.plan.keep.and_then(|keep| number.checked_sub(keep.max(1))).filter(|oldest| *oldest > 0)
        {
            // Already gone is as good.
            let _ = self.disk.remove(oldest);
        }
        self.part.drain()
    }

    fn well(&mut self) {
        let Some(trouble) = self.trouble.take().filter(|trouble| trouble.is_told) else { return };
        let gap = match self.lost - trouble.lost_before {
            0 => "nothing is missing".into(),
            lost => format!("{lost} chunks are missing"),
        };
        self.notices
            .push_back(format!("recording goes on after {:.0} s; {gap}", self.now.seconds_since(trouble.since)));
    }

    fn ill(&mut self, error: &io::Error) {
        let (now, lost) = (self.now, self.lost);
        let trouble =
            self.trouble.get_or_insert(Trouble { since: now, retry_at: now, lost_before: lost, is_told: false });
        trouble.retry_at = now + RETRY;
        let is_room = !matches!(error.kind(), ErrorKind::StorageFull | ErrorKind::QuotaExceeded);
        let is_hopeless = is_room && trouble.since + GIVE_UP <= now;
        if now >= self.complain_at {
            trouble.is_told = true;
            self.complain_at = now + COMPLAINT;
            self.notices.push_back(format!(
                "recording waits: {}: {error}; mapping goes on, {} kB wait in memory, and it is tried again every second",
                self.disk.path(self.part.number).display(),
                self.waiting_bytes() >> 10,
            ));
        }
        if is_hopeless {
            let (number, unwritten) = (self.part.number, self.part.encoded);
            // Another failure is met, and told, by the next try.
            let _ = self.next_part(now);
            if self.part.number != number {
                self.lost += unwritten;
            }
        }
    }
}

impl<F: Write> Part<F> {
    fn begin<D: Disk<File = F>>(disk: &mut D, info: &CaptureInfo, number: u32, began: Timestamp) -> io::Result<Self> {
        let file = disk.create(number)?;
        let memory = Memory::default();
        let writer = CaptureWriter::begin(memory.clone(), &disk.path(number), info).map_err(io::Error::other)?;
        Ok(Self { number, file, writer, memory, began, written: 0, is_used: false, encoded: 0, open: 0 })
    }

    fn encode(&mut self, chunk: &Chunk) -> io::Result<()> {
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

    /// From memory into the file.
    fn drain(&mut self) -> io::Result<()> {
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
        self.encoded = self.open;
        Ok(())
    }

    fn close(&mut self) -> io::Result<()> {
        self.writer.end().map_err(io::Error::other)?;
        self.drain()?;
        self.file.flush()
    }
}

/// Where the capture writer writes: it never fails.
#[derive(Clone, Default)]
struct Memory(Arc<Mutex<Vec<u8>>>);

impl Memory {
    fn len(&self) -> usize {
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
