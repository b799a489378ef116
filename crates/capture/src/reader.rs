//! Reads a capture from the first byte to the last, with one chunk in memory at a time.
//!
//! A chunk is used only if its checksum is right. Where the file is damaged, the reader goes on at the next sound chunk; of a file that
//! is cut it returns everything before the cut. [`CaptureReader::damage`] says what is missing.

use super::damage::{Damage, Holes};
use super::foreign::{MAX_TOPICS, Seen, hint};
use super::lengths::parse_record;
use super::salvage::{CHUNK_HEAD, RECORD_HEAD, Source};
use super::{
    CaptureError, CaptureInfo, LIBRARY, METADATA_NAME, RECEIVED_TOPIC, Record, SENT_TOPIC, TRUTH_TOPIC, TruthMessage,
};
use crc::{CRC_32_ISO_HDLC, Crc};
use mcap::records::{ChunkHeader, Record as McapRecord};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{MAGIC, McapError};
use slamd_core::{Pose2, Timestamp};
use slamd_files::regular;
use std::collections::{BTreeMap, VecDeque};
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

/// Reads one capture: an iterator over its records in file order.
pub struct CaptureReader<R: Read = BufReader<File>> {
    path: PathBuf,
    source: Source<R>,
    mcap: LinearReader,
    info: CaptureInfo,
    channels: BTreeMap<u16, Topic>,
    /// Records of the current chunk that were not returned yet.
    pending: VecDeque<Record>,
    /// The error to return after the pending records.
    failure: Option<CaptureError>,
    last: Timestamp,
    /// Messages read, as the file's statistics count them.
    messages: u64,
    holes: Holes,
    /// What is wrong with the file, once it is read to its end.
    damage: Option<String>,
    finished: bool,
    /// The MCAP profile, once it is known.
    profile: Option<String>,
    is_described: bool,
    /// The description at the head is damaged; its copy is sought.
    is_headless: bool,
    /// Bytes of records read.
    record_bytes: usize,
    /// Written by slamd itself, not rewritten by another program.
    is_own: bool,
    /// The first topics.
    topics: Vec<String>,
}

#[derive(Clone, Copy)]
enum Topic {
    Received,
    Sent,
    Truth,
}

impl CaptureReader {
    /// Opens a capture and reads its description.
    ///
    /// # Errors
    /// When the file cannot be read, is empty, or is not a capture. A truncated capture is no error: the recorder may have been killed at
    /// any time.
    pub fn open(path: &Path) -> Result<Self, CaptureError> {
        let file = regular::open(path).map_err(|source| CaptureError::Io { path: path.into(), source })?;
        Self::begin(BufReader::new(file), path)
    }
}

impl<R: Read> CaptureReader<R> {
    /// Reads a capture from any source; `path` is its name in errors.
    ///
    /// # Errors
    /// As [`CaptureReader::open`].
    pub fn begin(mut file: R, path: &Path) -> Result<Self, CaptureError> {
        let io_error = |source| CaptureError::Io { path: path.into(), source };
        let mut magic = Vec::new();
        file.by_ref().take(MAGIC.len() as u64).read_to_end(&mut magic).map_err(io_error)?;
        if !MAGIC.starts_with(&magic) {
            let hex: Vec<String> = magic.iter().map(|byte| format!("{byte:02x}")).collect();
            return Err(CaptureError::NotMcap { path: path.into(), found: hex.join(" "), hint: hint(&magic) });
        }
        if magic.is_empty() {
            return Err(CaptureError::Empty(path.into()));
        }
        let mut reader = Self {
            path: path.into(),
            source: Source::new(file),
            mcap: parser(),
            info: CaptureInfo::default(),
            channels: BTreeMap::new(),
            pending: VecDeque::new(),
            failure: None,
            last: Timestamp::default(),
            messages: 0,
            holes: Holes::default(),
            damage: None,
            finished: false,
            profile: None,
            is_described: false,
            is_headless: false,
            record_bytes: 0,
            is_own: false,
            topics: Vec::new(),
        };
        if magic.len() < MAGIC.len() {
            reader.damaged(Damage::End)?;
        }
        // The description precedes the first record.
        let first = reader.advance();
        if reader.is_headless
            && let Ok(first) = &first
        {
            let first = first.clone();
            reader.seek_description(first);
        }
        if !reader.is_described {
            let seen = Seen {
                profile: reader.profile.as_deref(),
                topics: &reader.topics,
                is_compressed: matches!(first, Err(CaptureError::Compressed { .. })),
            };
            seen.complaint(path).map_or(Ok(()), Err)?;
            if !reader.holes.are_there() {
                reader.hole("it has no description");
            }
            if reader.is_headless {
                reader.pending.clear();
            }
        }
        if let Some(first) = first?.filter(|_| !reader.is_headless) {
            reader.pending.push_front(first);
        }
        Ok(reader)
    }

    /// The capture's description; empty if it has none.
    #[must_use]
    pub const fn info(&self) -> &CaptureInfo {
        &self.info
    }

    /// What is wrong with the file, after the iterator's end; `None` if it is complete.
    #[must_use]
    pub fn damage(&self) -> Option<&str> {
        self.damage.as_deref()
    }

    /// Reads on to the description's copy. The records before it wait.
    fn seek_description(&mut self, first: Option<Record>) {
        let mut waiting = VecDeque::from_iter(first);
        while !self.is_described && !self.finished && self.record_bytes < MAX_HEADLESS_BYTES {
            self.step_or_fail();
            waiting.append(&mut self.pending);
        }
        self.finished |= !self.is_described;
        self.pending = waiting;
    }

    /// The next record. An error comes after the records before it.
    fn advance(&mut self) -> Result<Option<Record>, CaptureError> {
        while self.pending.is_empty() && !self.finished {
            self.step_or_fail();
        }
        let record = self.pending.pop_front();
        if record.is_none() {
            self.damage = self.holes.described(self.last);
            return self.failure.take().map_or(Ok(None), Err);
        }
        Ok(record)
    }

    fn step_or_fail(&mut self) {
        if let Err(error) = self.step() {
            self.finished = true;
            self.failure = Some(error);
        }
    }

    /// Handles the next event of the MCAP reader.
    fn step(&mut self) -> Result<(), CaptureError> {
        let record = match self.mcap.next_event() {
            None => {
                self.finished = true;
                return Ok(());
            }
            Some(Ok(LinearReadEvent::ReadRequest(wanted))) => return self.read(wanted),
            Some(Ok(LinearReadEvent::Record { opcode, data })) => {
                parse_record(opcode, data).map(|record| (RECORD_HEAD + data.len(), record.into_owned()))
            }
            Some(Err(error)) => Err(error),
        };
        let handled = match record {
            Ok((_, McapRecord::Message { .. })) if self.is_own || self.profile.is_none() => {
                Err(Damage::Other("a message outside the chunks".into()))
            }
            // A length that is too long would swallow what follows.
            Ok((length, McapRecord::Chunk { header, data }))
                if self.is_own && length != CHUNK_HEAD + header.compression.len() + data.len() =>
            {
                Err(Damage::Other("a chunk whose lengths differ".into()))
            }
            Ok((length, McapRecord::Chunk { header, data })) => self.chunk(&header, &data)?.map(|()| length),
            Ok((length, McapRecord::Metadata(metadata)))
                if self.is_own && length != RECORD_HEAD + CaptureInfo::length_of(&metadata) =>
            {
                Err(Damage::Other("a description whose lengths differ".into()))
            }
            Ok((length, record)) => self.take(record)?.map(|()| length),
            Err(error) => Err(error.into()),
        };
        match handled {
            Ok(length) => self.source.advance(length),
            Err(damage) => self.damaged(damage)?,
        }
        Ok(())
    }

    /// Handles the records of a chunk if its checksum is right. The loop splits the records itself,
    /// because the library trusts their lengths.
    fn chunk(&mut self, header: &ChunkHeader, mut rest: &[u8]) -> Result<Result<(), Damage>, CaptureError> {
        if !header.compression.is_empty() {
            let (path, compression) = (self.path.clone(), header.compression.clone());
            return Err(CaptureError::Compressed { path, compression });
        }
        let (saved, calculated) = (header.uncompressed_crc, CRC.checksum(rest));
        if saved != 0 && saved != calculated {
            return Ok(Err(McapError::BadChunkCrc { saved, calculated }.into()));
        }
        while let (false, Some((&opcode, behind))) = (self.finished, rest.split_first()) {
            let split = behind.split_first_chunk().and_then(|(length, behind)| {
                behind.split_at_checked(usize::try_from(u64::from_le_bytes(*length)).ok()?)
            });
            let Some((body, behind)) = split else {
                return Ok(Err(Damage::Other("a record that is longer than its chunk".into())));
            };
            let handled = match parse_record(opcode, body) {
                Ok(record) => self.take(record)?,
                Err(error) => Err(error.into()),
            };
            if handled.is_err() {
                return Ok(handled);
            }
            rest = behind;
        }
        Ok(Ok(()))
    }

    fn take(&mut self, record: McapRecord<'_>) -> Result<Result<(), Damage>, CaptureError> {
        match record {
            McapRecord::Header(header) => {
                self.is_own = header.library.starts_with(LIBRARY);
                self.profile = Some(header.profile);
            }
            // The first of the two is the description, unless it is damaged.
            McapRecord::Metadata(metadata) if metadata.name == METADATA_NAME => {
                match CaptureInfo::from_sound_metadata(metadata.metadata) {
                    Some(info) if !self.is_described => (self.info, self.is_described) = (info, true),
                    Some(_) => {}
                    None => return Ok(Err(Damage::Other("a description with a wrong checksum".into()))),
                }
            }
            McapRecord::Channel(channel) => {
                if let Some(topic) = Topic::from_name(&channel.topic) {
                    self.channels.insert(channel.id, topic);
                }
                if self.topics.len() < MAX_TOPICS {
                    self.topics.push(channel.topic);
                }
            }
            McapRecord::Message { header, data } => {
                self.messages += 1;
                if self.is_own && !self.is_described && !self.is_headless {
                    self.hole("its description is damaged");
                    self.is_headless = true;
                }
                if self.channels.is_empty() && self.is_own && (self.is_described || self.is_headless) {
                    self.hole("its topics are not named");
                    self.channels = OWN_CHANNELS.into();
                }
                if let Some(&topic) = self.channels.get(&header.channel_id) {
                    let record = self.record(topic, Timestamp::from_us(header.log_time / 1000), data.into_owned())?;
                    self.pending.push_back(record);
                } else if !self.is_described && !self.is_headless {
                    // Another program's file may be long.
                    self.finished = true;
                }
            }
            McapRecord::Unknown { opcode, .. } if opcode < PRIVATE_OPCODES => {
                return Ok(Err(Damage::Other(format!("a record of type {opcode:#04x}, which MCAP does not have"))));
            }
            // A chunk whose type was damaged is no chunk any more.
            McapRecord::Statistics(counted) if counted.message_count > self.messages && !self.holes.are_there() => {
                self.hole(&format!("it held {} messages, and {} are there", counted.message_count, self.messages));
            }
            _ => {}
        }
        Ok(Ok(()))
    }

    fn read(&mut self, wanted: usize) -> Result<(), CaptureError> {
        let read = self.source.read(self.mcap.insert(wanted.min(READ_LIMIT)));
        let length = read.map_err(|source| CaptureError::Io { path: self.path.clone(), source })?;
        self.mcap.notify_read(length);
        Ok(())
    }

    fn record(&mut self, topic: Topic, at: Timestamp, bytes: Vec<u8>) -> Result<Record, CaptureError> {
        if at < self.last {
            let path = self.path.clone();
            return Err(CaptureError::TimeRunsBack { path, before_s: self.last.seconds(), at_s: at.seconds() });
        }
        self.last = at;
        self.record_bytes = self.record_bytes.saturating_add(bytes.len().max(1));
        Ok(match topic {
            // The file has no topic for it: nothing is ever read that is empty.
            Topic::Received if bytes.is_empty() => Record::Opened { at },
            Topic::Received => Record::Received { at, bytes },
            Topic::Sent => Record::Sent { at, bytes },
            Topic::Truth => {
                let message: TruthMessage = serde_json::from_slice(&bytes).map_err(|error| CaptureError::Truth {
                    path: self.path.clone(),
                    at_s: at.seconds(),
                    reason: error.to_string(),
                })?;
                Record::Truth { at, pose: Pose2 { x_m: message.x_m, y_m: message.y_m, theta_rad: message.theta_rad } }
            }
        })
    }

    /// Goes on at the next sound chunk. Where the damage is in the description or before it, the description's copy follows some chunks later.
    fn damaged(&mut self, damage: Damage) -> Result<(), CaptureError> {
        let is_foreign = !self.is_own && self.profile.is_some();
        let sought = if self.is_described || !is_foreign { self.source.seek_chunk() } else { Ok(false) };
        if !self.is_described && matches!(sought, Ok(true)) {
            (self.is_headless, self.is_own) = (true, true);
        }
        let is_found = sought.map_err(|source| CaptureError::Io { path: self.path.clone(), source })?;
        (self.finished, self.mcap) = (!is_found, parser());
        match damage {
            Damage::End if !is_found => self.holes.is_cut = true,
            Damage::End => self.hole("a record that is longer than the file"),
            Damage::Other(what) => {
                self.holes.has_no_end = !is_found;
                self.hole(&what);
            }
        }
        Ok(())
    }

    /// Something is missing behind the last record.
    fn hole(&mut self, what: &str) {
        self.holes.add(self.last, what);
    }
}

/// A parser of the records after the file's first bytes.
fn parser() -> LinearReader {
    let options = LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_emit_chunks(true)
        .with_record_length_limit(RECORD_LIMIT);
    LinearReader::new_with_options(options)
}

impl<R: Read> Iterator for CaptureReader<R> {
    type Item = Result<Record, CaptureError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.advance().transpose()
    }
}

impl Topic {
    fn from_name(name: &str) -> Option<Self> {
        match name {
            RECEIVED_TOPIC => Some(Self::Received),
            SENT_TOPIC => Some(Self::Sent),
            TRUTH_TOPIC => Some(Self::Truth),
            _ => None,
        }
    }
}

/// The checksum of MCAP.
pub(super) const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);
/// The channels that the writer adds, in its order: known although the chunk that names them is damaged.
const OWN_CHANNELS: [(u16, Topic); 3] = [(1, Topic::Received), (2, Topic::Sent), (3, Topic::Truth)];
/// Record types from here on are for private use and are skipped.
const PRIVATE_OPCODES: u8 = 0x80;
/// Limit of the records that wait for the description's copy, bytes: it follows after a second.
const MAX_HEADLESS_BYTES: usize = 1 << 20;
/// Maximum length of a record or chunk, bytes. Longer ones are damage: our own chunks hold 0.1 s.
pub(super) const RECORD_LIMIT: usize = 64 << 20;
/// Maximum number of bytes per read, so that a damaged length does not reserve memory.
pub(super) const READ_LIMIT: usize = 64 << 10;
