//! A recording that survives disk failures: chunks that cannot be written wait in memory.
//!
//! A state machine: chunks and times go in, bytes to a [`Disk`] come out. Traffic is first encoded in memory, at most one capture chunk ahead of
//! the file, and written from there in pieces of any size; a failed write is repeated at the same position. Further chunks wait up to a limit
//! and are counted as lost beyond it. So a capture holds the link's whole traffic, with a gap if the disk failed for longer than the limit
//! lasts.

use super::{Chunk, Disk};
use slamd_capture::{CaptureError, CaptureInfo, CaptureWriter};
use slamd_core::Timestamp;
use std::collections::VecDeque;
use std::io::{self, ErrorKind, Write};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// When a recording begins a new file, and how much disk space it leaves free.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Plan {
    /// Largest size of a file, bytes.
    pub most_bytes: Option<u64>,
    /// Longest time in a file.
    pub most_time: Option<Duration>,
    /// Number of files to keep; older files of this recording are deleted.
    pub keep: Option<u32>,
    /// Writing pauses while fewer bytes are free.
    pub keep_free_bytes: u64,
}

/// What a recording lacks.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Losses {
    /// Chunks that were not written.
    pub chunks: u64,
    /// Why the last file could not be closed; its content can still be read.
    pub unfinished: Option<String>,
}

/// A recording.
pub struct Tape<D: Disk> {
    disk: D,
    info: CaptureInfo,
    plan: Plan,
    part: Part<D::File>,
    /// The numbers of this recording's files that may be deleted; others in between belong to other recordings.
    parts: VecDeque<u32>,
    waiting: VecDeque<Chunk>,
    waiting_bytes: usize,
    now: Timestamp,
    outage: Option<Outage>,
    check_space_at: Timestamp,
    lost: u64,
    notice_at: Timestamp,
    notices: VecDeque<String>,
}

/// One file of the recording.
struct Part<F> {
    number: u32,
    file: F,
    writer: CaptureWriter<Memory>,
    memory: Memory,
    began: Timestamp,
    written: u64,
    /// The file holds a chunk.
    is_used: bool,
    /// Chunks that are encoded but not yet in the file.
    encoded: u64,
    /// Those of them that are in the open capture chunk.
    open: u64,
}

/// A period in which the disk fails.
struct Outage {
    since: Timestamp,
    retry_at: Timestamp,
    lost_before: u64,
    is_reported: bool,
}

/// Limit on waiting chunks with their overhead, bytes: three quarters of an hour at 6 kB/s.
const MAX_WAITING: usize = 16 << 20;
const OVERHEAD: usize = 64;
const RETRY_PERIOD: Duration = Duration::from_secs(1);
const FREE_SPACE_PERIOD: Duration = Duration::from_secs(1);
/// After so long a failure that is not a full disk, a new file is begun: the disk may have been removed and inserted again.
const GIVE_UP: Duration = Duration::from_secs(10);
/// Shortest time between two notices.
const NOTICE_PERIOD: Duration = Duration::from_secs(60);

impl<D: Disk> Tape<D> {
    /// Creates the first file and writes its header. A file that exists is another recording's and is kept.
    ///
    /// # Errors
    /// When the file cannot be created or written.
    pub fn begin(mut disk: D, info: CaptureInfo, plan: Plan) -> Result<Self, CaptureError> {
        let begun = Part::begin_next(&mut disk, &info, 1, Timestamp::default()).and_then(|mut part| {
            part.drain().inspect_err(|_| {
                // An empty file is no recording.
                let _ = disk.remove(part.number);
            })?;
            Ok(part)
        });
        let part = begun.map_err(|source| CaptureError::Io { path: disk.path(1), source })?;
        Ok(Self {
            parts: VecDeque::from([part.number]),
            part,
            disk,
            info,
            plan,
            waiting: VecDeque::new(),
            waiting_bytes: 0,
            now: Timestamp::default(),
            outage: None,
            check_space_at: Timestamp::default(),
            lost: 0,
            notice_at: Timestamp::default(),
            notices: VecDeque::new(),
        })
    }

    /// Records a chunk. Its time must not be before the last chunk's time.
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
        if self.outage.as_ref().is_some_and(|outage| self.now < outage.retry_at) {
            return;
        }
        match self.write() {
            Ok(()) => self.recovered(),
            Err(error) => self.failed(&error),
        }
    }

    /// How long after the newest chunk a write is due; none if none is.
    #[must_use]
    pub fn flush_in(&self) -> Option<Duration> {
        if self.outage.is_some() { None } else { self.part.writer.flush_in() }
    }

    /// The time of the last call.
    #[must_use]
    pub const fn now(&self) -> Timestamp {
        self.now
    }

    /// The present file's number.
    #[must_use]
    pub const fn part(&self) -> u32 {
        self.part.number
    }

    /// The present file's path, for messages.
    pub fn path(&self) -> std::path::PathBuf {
        self.disk.path(self.part.number)
    }

    /// Chunks lost so far.
    #[must_use]
    pub const fn lost(&self) -> u64 {
        self.lost
    }

    /// Bytes that wait for the disk.
    #[must_use]
    pub fn waiting_bytes(&self) -> usize {
        self.waiting_bytes + self.part.memory.len()
    }

    /// The next notice for the log: at most one failure a minute, and each recovery from a reported failure.
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
        self.check_free_space()?;
        self.part.drain()?;
        while let Some(chunk) = self.waiting.front() {
            let at = chunk.at();
            if self.is_full(at) {
                self.rotate(at)?;
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

    fn check_free_space(&mut self) -> io::Result<()> {
        if self.plan.keep_free_bytes == 0 || self.now < self.check_space_at {
            return Ok(());
        }
        match self.disk.free_bytes() {
            Some(free) if free < self.plan.keep_free_bytes => {
                let text =
                    format!("{} MiB are free, and {} must stay free", free >> 20, self.plan.keep_free_bytes >> 20);
                Err(io::Error::new(ErrorKind::StorageFull, text))
            }
            _ => {
                self.check_space_at = self.now + FREE_SPACE_PERIOD;
                Ok(())
            }
        }
    }

    /// True if a chunk of this time belongs into a new file.
    fn is_full(&self, at: Timestamp) -> bool {
        let age = Duration::from_micros(at.us().saturating_sub(self.part.began.us()));
        self.part.is_used
            && (self.plan.most_bytes.is_some_and(|most| self.part.written >= most)
                || self.plan.most_time.is_some_and(|most| age >= most))
    }

    /// Closes the file and begins the next one.
    fn rotate(&mut self, at: Timestamp) -> io::Result<()> {
        // The file stays closed if the next one cannot be begun.
        self.part.close()?;
        self.next_part(at)
    }

    fn next_part(&mut self, at: Timestamp) -> io::Result<()> {
        self.part = Part::begin_next(&mut self.disk, &self.info, self.part.number + 1, at)?;
        self.parts.push_back(self.part.number);
        if self.plan.keep.is_some_and(|keep| self.parts.len() > keep.max(1) as usize)
            && let Some(oldest) = self.parts.pop_front()
        {
            // The file may have been deleted already.
            let _ = self.disk.remove(oldest);
        }
        self.part.drain()
    }

    /// A write succeeded.
    fn recovered(&mut self) {
        let Some(outage) = self.outage.take().filter(|outage| outage.is_reported) else { return };
        let gap = match self.lost - outage.lost_before {
            0 => "nothing is missing".into(),
            lost => format!("{lost} chunks are missing"),
        };
        self.notices
            .push_back(format!("recording continues after {:.0} s; {gap}", self.now.seconds_since(outage.since)));
    }

    /// A write failed.
    fn failed(&mut self, error: &io::Error) {
        let (now, lost) = (self.now, self.lost);
        let outage =
            self.outage.get_or_insert(Outage { since: now, retry_at: now, lost_before: lost, is_reported: false });
        outage.retry_at = now + RETRY_PERIOD;
        let is_room = !matches!(error.kind(), ErrorKind::StorageFull | ErrorKind::QuotaExceeded);
        let is_hopeless = is_room && outage.since + GIVE_UP <= now;
        if now >= self.notice_at {
            outage.is_reported = true;
            self.notice_at = now + NOTICE_PERIOD;
            self.notices.push_back(format!(
                "recording waits: {}: {error}; mapping continues, {} kB wait in memory, next attempt in a second",
                self.disk.path(self.part.number).display(),
                self.waiting_bytes() >> 10,
            ));
        }
        if is_hopeless {
            let (number, unwritten) = (self.part.number, self.part.encoded);
            // The next attempt meets and reports a further failure.
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

    /// Begins the first file from `number` on that does not exist.
    fn begin_next<D: Disk<File = F>>(
        disk: &mut D,
        info: &CaptureInfo,
        mut number: u32,
        began: Timestamp,
    ) -> io::Result<Self> {
        loop {
            match Self::begin(disk, info, number, began) {
                Err(error) if error.kind() == ErrorKind::AlreadyExists && number < u32::MAX => number += 1,
                begun => return begun,
            }
        }
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

    /// Writes the encoded bytes to the file.
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

/// The buffer that the capture writer writes to; it never fails.
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
