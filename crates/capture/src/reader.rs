//! Reads a capture from its first byte to its last, one chunk in memory at a time.
//!
//! A chunk is used only after its checksum held. Where the file is cut or damaged, everything in front of the damage is given
//! out and [`CaptureReader::damage`] says in words what is missing.

use super::{CaptureError, CaptureInfo, METADATA_NAME, RECEIVED_TOPIC, Record, SENT_TOPIC, TRUTH_TOPIC, TruthMessage};
use crc::{CRC_32_ISO_HDLC, Crc};
use mcap::records::{ChunkHeader, Record as McapRecord};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{MAGIC, McapError};
use slamd_core::geometry::Pose2;
use slamd_core::time::Timestamp;
use std::collections::{BTreeMap, VecDeque};
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::{Path, PathBuf};

/// Reads one capture: an iterator over its records in the order of the file.
pub struct CaptureReader<R: Read = BufReader<File>> {
    path: PathBuf,
    file: R,
    machine: LinearReader,
    info: CaptureInfo,
    channels: BTreeMap<u16, Topic>,
    /// What is read and not yet given out: the rest of a chunk.
    pending: VecDeque<Record>,
    /// Why nothing can be read behind it.
    failure: Option<CaptureError>,
    last: Timestamp,
    damage: Option<String>,
    finished: bool,
}

#[derive(Clone, Copy)]
enum Topic {
    Received,
    Sent,
    Truth,
}

impl CaptureReader {
    /// Opens a capture and reads what it says about itself.
    ///
    /// # Errors
    /// When the file cannot be read or is not an MCAP file. A file cut off anywhere is no error: its beginning may not have been written.
    pub fn open(path: &Path) -> Result<Self, CaptureError> {
        let file = File::open(path).map_err(|source| CaptureError::Io { path: path.into(), source })?;
        Self::begin(BufReader::new(file), path)
    }
}

impl<R: Read> CaptureReader<R> {
    /// Reads a capture from anything; `path` is its name in errors.
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
        let options = LinearReaderOptions::default()
            .with_skip_start_magic(true)
            .with_emit_chunks(true)
            .with_record_length_limit(RECORD_LIMIT);
        let mut reader = Self {
            path: path.into(),
            file,
            machine: LinearReader::new_with_options(options),
            info: CaptureInfo::default(),
            channels: BTreeMap::new(),
            pending: VecDeque::new(),
            failure: None,
            last: Timestamp::default(),
            damage: None,
            finished: false,
        };
        if magic.len() < MAGIC.len() {
            reader.stop(McapError::UnexpectedEof)?;
        }
        // What the capture says about itself stands before its first record.
        if let Some(first) = reader.advance()? {
            reader.pending.push_front(first);
        }
        Ok(reader)
    }

    /// What the capture says about itself; all empty where it says nothing.
    #[must_use]
    pub const fn info(&self) -> &CaptureInfo {
        &self.info
    }

    /// What is wrong with the file, once the iterator has ended; none where the file is whole.
    #[must_use]
    pub fn damage(&self) -> Option<&str> {
        self.damage.as_deref()
    }

    /// The next record; what came before an error is given out before it.
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

    /// Lets the machine take one step.
    fn step(&mut self) -> Result<(), CaptureError> {
        let record = match self.machine.next_event() {
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

    /// Takes the records of a chunk, once its checksum holds. They are walked here: the library's own way trusts their lengths.
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
            McapRecord::Metadata(metadata) if metadata.name == METADATA_NAME => {
                self.info = CaptureInfo::from_metadata(metadata.metadata);
            }
            McapRecord::Channel(channel) => {
                if let Some(topic) = Topic::from_name(&channel.topic) {
                    self.channels.insert(channel.id, topic);
                }
            }
            McapRecord::Message { header, data } => {
                if let Some(&topic) = self.channels.get(&header.channel_id) {
                    let record = self.record(topic, Timestamp::from_us(header.log_time / 1000), data.into_owned())?;
                    self.pending.push_back(record);
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
        let buffer = self.machine.insert(wanted.min(READ_LIMIT));
        loop {
            match self.file.read(buffer) {
                Ok(length) => {
                    self.machine.notify_read(length);
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

    /// Nothing can be read behind an error: it becomes words, except where the file is sound and we lack the means.
    fn stop(&mut self, error: McapError) -> Result<(), CaptureError> {
        match error {
            McapError::UnsupportedCompression(compression) => {
                return Err(CaptureError::Compressed { path: self.path.clone(), compression });
            }
            McapError::UnexpectedEof => {
                self.finished = true;
                self.damage = Some(format!(
                    "the file was not finished: it holds everything up to {:.3} s, and what was recorded behind that \
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
            "the file is damaged behind {:.3} s and nothing after that was read: {what}",
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

/// As MCAP has it.
const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);
/// From here on record types are free for private use and are skipped.
const PRIVATE_OPCODES: u8 = 0x80;
/// A longer record or chunk is damage: our own chunks hold 0.1 s.
const RECORD_LIMIT: usize = 64 << 20;
/// Most bytes asked of the file at once: a damaged length must not reserve memory.
const READ_LIMIT: usize = 64 << 10;
