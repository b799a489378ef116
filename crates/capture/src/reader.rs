//! Reads a capture from the first byte to the last, with one chunk in memory at a time.
//!
//! A chunk is used only if its checksum is right. If the file is cut or damaged, the reader returns
//! everything before the damage, and [`CaptureReader::damage`] says what is missing.

use super::foreign::{MAX_TOPICS, Seen};
use super::{CaptureError, CaptureInfo, METADATA_NAME, RECEIVED_TOPIC, Record, SENT_TOPIC, TRUTH_TOPIC, TruthMessage};
use crc::{CRC_32_ISO_HDLC, Crc};
use mcap::records::{ChunkHeader, Record as McapRecord};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{MAGIC, McapError};
use slamd_core::{Pose2, Timestamp};
use std::collections::{BTreeMap, VecDeque};
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::{Path, PathBuf};

/// Reads one capture: an iterator over its records in file order.
pub struct CaptureReader<R: Read = BufReader<File>> {
    path: PathBuf,
    file: R,
    mcap: LinearReader,
    info: CaptureInfo,
    channels: BTreeMap<u16, Topic>,
    /// Records of the current chunk that were not returned yet.
    pending: VecDeque<Record>,
    /// The error to return after the pending records.
    failure: Option<CaptureError>,
    last: Timestamp,
    damage: Option<String>,
    finished: bool,
    /// The MCAP profile, once it is known.
    profile: Option<String>,
    is_described: bool,
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
        let file = File::open(path).map_err(|source| CaptureError::Io { path: path.into(), source })?;
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
            return Err(CaptureError::NotMcap { path: path.into(), found: hex.join(" ") });
        }
        if magic.is_empty() {
            return Err(CaptureError::Empty(path.into()));
        }
        let options = LinearReaderOptions::default()
            .with_skip_start_magic(true)
            .with_emit_chunks(true)
            .with_record_length_limit(RECORD_LIMIT);
        let mut reader = Self {
            path: path.into(),
            file,
            mcap: LinearReader::new_with_options(options),
            info: CaptureInfo::default(),
            channels: BTreeMap::new(),
            pending: VecDeque::new(),
            failure: None,
            last: Timestamp::default(),
            damage: None,
            finished: false,
            profile: None,
            is_described: false,
            topics: Vec::new(),
        };
        if magic.len() < MAGIC.len() {
            reader.stop(McapError::UnexpectedEof)?;
        }
        // The description precedes the first record.
        let first = reader.advance();
        if !reader.is_described {
            let seen = Seen {
                profile: reader.profile.as_deref(),
                topics: &reader.topics,
                is_compressed: matches!(first, Err(CaptureError::Compressed { .. })),
            };
            seen.complaint(path).map_or(Ok(()), Err)?;
        }
        if let Some(first) = first? {
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

    /// The next record. An error comes after the records before it.
    fn advance(&mut self) -> Result<Option<Record>, CaptureError> {
        while self.pending.is_empty() && !self.finished {
            if let Err(error) = self.step() {
                self.finished = true;
                self.failure = Some(error);
            }
        }
        match (self.pending.pop_front(), self.failure.is_some()) {
            (None, true) => self.failure.take().map_or(Ok(None), Err),
            (record, _) => Ok(record),
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
                mcap::parse_record(opcode, data).map(McapRecord::into_owned)
            }
            Some(Err(error)) => Err(error),
        };
        match record {
            Ok(McapRecord::Chunk { header, data }) => self.chunk(&header, &data),
            Ok(record) => self.take(record),
            Err(error) => self.stop(error),
        }
    }

    /// Handles the records of a chunk if its checksum is right. The loop splits the records itself,
    /// because the library trusts their lengths.
    fn chunk(&mut self, header: &ChunkHeader, mut rest: &[u8]) -> Result<(), CaptureError> {
        if !header.compression.is_empty() {
            return self.stop(McapError::UnsupportedCompression(header.compression.clone()));
        }
        let (saved, calculated) = (header.uncompressed_crc, CRC.checksum(rest));
        if saved != 0 && saved != calculated {
            return self.stop(McapError::BadChunkCrc { saved, calculated });
        }
        while let (false, Some((&opcode, behind))) = (self.finished, rest.split_first()) {
            let split = behind.split_first_chunk().and_then(|(length, behind)| {
                behind.split_at_checked(usize::try_from(u64::from_le_bytes(*length)).ok()?)
            });
            let Some((body, behind)) = split else {
                self.damaged("a record that is longer than its chunk");
                break;
            };
            match mcap::parse_record(opcode, body) {
                Ok(record) => self.take(record)?,
                Err(error) => self.stop(error)?,
            }
            rest = behind;
        }
        Ok(())
    }

    fn take(&mut self, record: McapRecord<'_>) -> Result<(), CaptureError> {
        match record {
            McapRecord::Header(header) => self.profile = Some(header.profile),
            McapRecord::Metadata(metadata) if metadata.name == METADATA_NAME => {
                self.is_described = true;
                self.info = CaptureInfo::from_metadata(metadata.metadata);
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
                if let Some(&topic) = self.channels.get(&header.channel_id) {
                    let record = self.record(topic, Timestamp::from_us(header.log_time / 1000), data.into_owned())?;
                    self.pending.push_back(record);
                } else if !self.is_described {
                    // Another program's file may be long.
                    self.finished = true;
                }
            }
            McapRecord::Unknown { opcode, .. } if opcode < PRIVATE_OPCODES => {
                self.damaged(&format!("a record of type {opcode:#04x}, which MCAP does not have"));
            }
            _ => {}
        }
        Ok(())
    }

    fn read(&mut self, wanted: usize) -> Result<(), CaptureError> {
        let buffer = self.mcap.insert(wanted.min(READ_LIMIT));
        loop {
            match self.file.read(buffer) {
                Ok(length) => {
                    self.mcap.notify_read(length);
                    return Ok(());
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(source) => return Err(CaptureError::Io { path: self.path.clone(), source }),
            }
        }
    }

    fn record(&mut self, topic: Topic, at: Timestamp, bytes: Vec<u8>) -> Result<Record, CaptureError> {
        if at < self.last {
            let path = self.path.clone();
            return Err(CaptureError::TimeRunsBack { path, before_s: self.last.seconds(), at_s: at.seconds() });
        }
        self.last = at;
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

    /// Stops at an error. It becomes a description of the damage, unless the file is whole but
    /// compressed.
    fn stop(&mut self, error: McapError) -> Result<(), CaptureError> {
        match error {
            McapError::UnsupportedCompression(compression) => {
                return Err(CaptureError::Compressed { path: self.path.clone(), compression });
            }
            McapError::UnexpectedEof => {
                self.finished = true;
                self.damage = Some(format!(
                    "the file was not finished: it holds everything up to {:.3} s, and what was recorded after that \
                     (0.1 s where the recorder was killed) is missing",
                    self.last.seconds()
                ));
            }
            other => self.damaged(&other.to_string()),
        }
        Ok(())
    }

    fn damaged(&mut self, what: &str) {
        self.finished = true;
        self.damage = Some(format!(
            "the file is damaged after {:.3} s and nothing after that was read: {what}",
            self.last.seconds()
        ));
    }
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
const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);
/// Record types from here on are for private use and are skipped.
const PRIVATE_OPCODES: u8 = 0x80;
/// Maximum length of a record or chunk, bytes. Longer ones are damage: our own chunks hold 0.1 s.
const RECORD_LIMIT: usize = 64 << 20;
/// Maximum number of bytes per read, so that a damaged length does not reserve memory.
const READ_LIMIT: usize = 64 << 10;
