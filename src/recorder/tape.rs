//! A recording that survives disk failures: chunks that cannot be written wait in memory.
//!
//! A state machine: chunks and times go in, bytes to a [`Disk`] come out. Traffic is first encoded in memory, at most one capture chunk ahead of
//! the file, and written from there in pieces of any size; a failed write is repeated at the same position. Further chunks wait up to a limit
//! and are counted as lost beyond it. So a capture holds the link's whole traffic, with a gap if the disk failed for longer than the limit
//! lasts.

use super::disk::Presence;
use super::outage::Outage;
use super::part::Part;
use super::plan::{Losses, Plan};
use super::{Chunk, Disk};
use slamd_capture::{CaptureError, CaptureInfo};
use slamd_core::Timestamp;
use std::collections::VecDeque;
use std::io::{self, ErrorKind};
use std::time::Duration;

/// A recording.
pub struct Tape<D: Disk> {
    disk: D,
    info: CaptureInfo,
    plan: Plan,
    part: Part<D::File>,
    /// This recording's closed files; others in between belong to other recordings.
    closed: VecDeque<Closed>,
    /// A file without a chunk that could not be deleted.
    leftover: Option<u32>,
    waiting: VecDeque<Chunk>,
    waiting_bytes: usize,
    now: Timestamp,
    outage: Option<Outage>,
    check_at: Timestamp,
    lost: u64,
    /// Chunks of the present file that are gone with it.
    removed: u64,
    errors: u64,
    notice_at: Timestamp,
    notices: VecDeque<String>,
}

/// A file that is not written any more.
#[derive(Clone, Copy)]
struct Closed {
    number: u32,
    /// All of it is known to be on the disk. Only such files count as kept ones.
    is_sound: bool,
}

/// Limit on waiting chunks with their overhead, bytes: three quarters of an hour at 6 kB/s.
const MAX_WAITING: usize = 16 << 20;
const OVERHEAD: usize = 64;
/// Period of looking whether there is free space and whether the file still exists.
const CHECK_PERIOD: Duration = Duration::from_secs(1);
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
            closed: VecDeque::new(),
            leftover: None,
            part,
            disk,
            info,
            plan,
            waiting: VecDeque::new(),
            waiting_bytes: 0,
            now: Timestamp::default(),
            outage: None,
            check_at: Timestamp::default(),
            lost: 0,
            removed: 0,
            errors: 0,
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

    /// Writes what waits, without waiting for the next attempt.
    pub fn retry(&mut self) {
        if let Some(outage) = &mut self.outage {
            outage.retry_at = self.now;
            self.advance(self.now);
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

    /// Errors of the disk so far.
    #[must_use]
    pub const fn errors(&self) -> u64 {
        self.errors
    }

    /// Why the recording waits, and since when; none while it is written.
    #[must_use]
    pub fn outage(&self) -> Option<(Timestamp, &str)> {
        self.outage.as_ref().map(|outage| (outage.since, outage.cause.as_str()))
    }

    /// Writes everything and closes the file.
    pub fn finish(mut self) -> Losses {
        let result = self.check_file().and_then(|()| self.write()).and_then(|()| self.part.close());
        let waiting = self.waiting.len() as u64;
        self.delete_leftover();
        self.delete_old();
        match result {
            Ok(()) => Losses { chunks: self.lost, ..Losses::default() },
            Err(error) => {
                let unwritten = self.part.encoded;
                // An empty file is no recording.
                let is_gone = self.part.held == 0 || self.removed > 0;
                if self.part.held == 0 {
                    let _ = self.disk.remove(self.part.number);
                }
                Losses {
                    chunks: self.lost + self.removed + waiting + unwritten,
                    unfinished: Some(format!("{}: {error}", self.disk.path(self.part.number).display())),
                    is_gone,
                }
            }
        }
    }

    fn write(&mut self) -> io::Result<()> {
        self.check()?;
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
        self.part.drain()?;
        self.delete_old();
        Ok(())
    }

    /// Looks once a second whether there is room, and whether the file still exists.
    fn check(&mut self) -> io::Result<()> {
        if self.now < self.check_at {
            return Ok(());
        }
        if self.plan.keep_free_bytes > 0
            && let Some(free) = self.disk.free_bytes()
            && free < self.plan.keep_free_bytes
        {
            let text = format!("{} MiB are free, and {} must stay free", free >> 20, self.plan.keep_free_bytes >> 20);
            return Err(io::Error::new(ErrorKind::StorageFull, text));
        }
        self.check_file()?;
        self.check_at = self.now + CHECK_PERIOD;
        Ok(())
    }

    /// A file that was removed or renamed is told at once, and the next one is begun.
    fn check_file(&mut self) -> io::Result<()> {
        let (gone, what) = match self.disk.presence(self.part.number, &self.part.file)? {
            Presence::There => return Ok(()),
            Presence::Renamed => (0, "the file was renamed"),
            Presence::Removed => (self.part.held, "the file was removed"),
        };
        let path = self.path();
        let lost = gone + self.part.encoded;
        if let Err(error) = self.next_part(self.now) {
            self.removed = gone;
            return Err(io::Error::new(error.kind(), format!("{what}, and no other can be begun: {error}")));
        }
        (self.lost, self.removed, self.errors) = (self.lost + lost, 0, self.errors + 1);
        self.notices.push_back(format!(
            "{}: {what}; {lost} chunks are missing; recording to {}",
            path.display(),
            self.path().display()
        ));
        Ok(())
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
        let closed = Closed { number: self.part.number, is_sound: !self.part.is_doubtful };
        self.next_part(at)?;
        self.closed.push_back(closed);
        Ok(())
    }

    /// Begins the next file once the disk has taken its header; until then the present one stays.
    fn next_part(&mut self, at: Timestamp) -> io::Result<()> {
        if !self.delete_leftover() {
            return Err(io::Error::other("an empty file cannot be deleted"));
        }
        let mut next = Part::begin_next(&mut self.disk, &self.info, self.part.number + 1, at)?;
        if let Err(error) = next.drain() {
            self.leftover = Some(next.number);
            self.delete_leftover();
            return Err(error);
        }
        self.part = next;
        Ok(())
    }

    /// Deletes the file that holds no chunk. False if the disk refuses.
    fn delete_leftover(&mut self) -> bool {
        let Some(number) = self.leftover else { return true };
        let is_deleted = match self.disk.remove(number) {
            Ok(()) => true,
            Err(error) => error.kind() == ErrorKind::NotFound,
        };
        if is_deleted {
            self.leftover = None;
        }
        is_deleted
    }

    /// Deletes files that are too old. Empty and unsound ones do not count as kept, and nothing is deleted before the present file holds a
    /// chunk, so a failing disk costs no file.
    fn delete_old(&mut self) {
        let Some(keep) = self.plan.keep.filter(|_| self.part.held > 0) else { return };
        let keep = keep.max(1) as usize;
        loop {
            let sound = 1 + self.closed.iter().filter(|closed| closed.is_sound).count();
            let oldest_is_sound = self.closed.front().is_some_and(|oldest| oldest.is_sound);
            let index = if sound > keep || (sound == keep && !oldest_is_sound) {
                Some(0)
            } else if self.closed.len() >= 2 * keep {
                self.closed.iter().position(|closed| !closed.is_sound)
            } else {
                None
            };
            let Some(old) = index.and_then(|index| self.closed.remove(index)) else { return };
            // The file may have been deleted already.
            let _ = self.disk.remove(old.number);
        }
    }

    /// A write succeeded.
    fn recovered(&mut self) {
        let Some(outage) = self.outage.take() else { return };
        self.delete_leftover();
        if !outage.is_reported {
            return;
        }
        let gap = match self.lost - outage.lost_before {
            0 => "nothing is missing".into(),
            lost => format!("{lost} chunks are missing"),
        };
        self.notices
            .push_back(format!("recording continues after {:.0} s; {gap}", self.now.seconds_since(outage.since)));
    }

    /// A write failed.
    fn failed(&mut self, error: &io::Error) {
        self.errors += 1;
        let (now, lost) = (self.now, self.lost);
        let outage = self.outage.get_or_insert_with(|| Outage::begin(now, lost));
        let is_hopeless = outage.fail(now, error);
        if now >= self.notice_at {
            outage.is_reported = true;
            self.notice_at = now + NOTICE_PERIOD;
            let next_s = outage.retry_at.seconds_since(now);
            self.notices.push_back(format!(
                "recording waits: {}: {error}; mapping continues, {} kB wait in memory, next attempt in {next_s:.0} s",
                self.disk.path(self.part.number).display(),
                self.waiting_bytes() >> 10,
            ));
        }
        if is_hopeless {
            let (given_up, held, unwritten) = (self.part.number, self.part.held, self.part.encoded);
            // The next attempt meets and reports a further failure.
            if self.next_part(now).is_ok() {
                self.lost += unwritten;
                if held == 0 {
                    self.leftover = Some(given_up);
                    self.delete_leftover();
                } else {
                    self.closed.push_back(Closed { number: given_up, is_sound: false });
                }
            }
        }
    }
}
