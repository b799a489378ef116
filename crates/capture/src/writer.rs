//! Writes a capture so that a kill at any moment loses at most the last [`FLUSH_PERIOD`].

use super::{
    CaptureError, CaptureInfo, FLUSH_PERIOD, LIBRARY, RECEIVED_TOPIC, Record, SENT_TOPIC, TRUTH_TOPIC, TruthMessage,
};
use crate::records::McapFile;
use mcap::records::Metadata;
use slamd_core::{Pose2, Timestamp};
use slamd_files::{Output, PartFile, WriteError, private};
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Writes one capture. Dropping it also closes the file, but only [`CaptureWriter::finish`] reports
/// errors.
///
/// Each chunk is collected in memory and written at once, so a killed recording ends at a chunk's end.
/// Memory does not grow with the recording: a file of more than 6,000 chunks has no index of them.
pub struct CaptureWriter<W: Write = BufWriter<File>> {
    path: PathBuf,
    writer: McapFile<W>,
    channels: Channels,
    /// The description, until its copy is written.
    description: Option<Metadata>,
    chunks: u32,
    /// The time of the first message in the open chunk.
    chunk_opened: Option<Timestamp>,
    last: Timestamp,
}

#[derive(Clone, Copy)]
struct Channels {
    received: Channel,
    sent: Channel,
    truth: Channel,
}

#[derive(Clone, Copy)]
struct Channel {
    /// From 0; its id is one more.
    index: usize,
    messages: u32,
}

impl CaptureWriter {
    /// Creates the file, readable by its owner only, and writes the description.
    ///
    /// # Errors
    /// When the file cannot be created or written.
    pub fn create(path: &Path, info: &CaptureInfo) -> Result<Self, CaptureError> {
        let file = private::create_file(path).map_err(|source| CaptureError::Io { path: path.into(), source })?;
        Self::begin(BufWriter::new(file), path, info)
    }

    /// Writes the summary and closes the file.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn finish(mut self) -> Result<(), CaptureError> {
        self.end()?;
        let Some(file) = self.writer.into_inner() else { return Ok(()) };
        let file = file.into_inner().map_err(io::IntoInnerError::into_error);
        file.and_then(|file| file.sync_all()).map_err(|source| CaptureError::Io { path: self.path, source })
    }
}

impl CaptureWriter<PartFile> {
    /// Begins a capture that appears when it is complete.
    ///
    /// # Errors
    /// When the file cannot be created or written.
    pub fn output(output: Output, info: &CaptureInfo) -> Result<Self, CaptureError> {
        let path = output.path().to_owned();
        Self::begin(output.begin()?, &path, info)
    }

    /// Writes the summary and gives the file its name.
    ///
    /// # Errors
    /// When the file cannot be written. Then nothing is left of it, and an older file of that name is unchanged.
    pub fn finish(mut self) -> Result<(), CaptureError> {
        self.end()?;
        let Some(file) = self.writer.into_inner() else { return Ok(()) };
        Ok(file.finish().map(drop)?)
    }
}

impl From<WriteError> for CaptureError {
    fn from(error: WriteError) -> Self {
        Self::Io { path: error.path, source: error.source }
    }
}

impl<W: Write> CaptureWriter<W> {
    /// Writes a capture's description to any target; `path` is its name in errors.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn begin(to: W, path: &Path, info: &CaptureInfo) -> Result<Self, CaptureError> {
        let (writer, channels) = begin(to, info).map_err(|error| write_error(path, error))?;
        Ok(Self {
            path: path.into(),
            writer,
            channels,
            description: Some(info.to_metadata()),
            chunks: 0,
            chunk_opened: None,
            last: Timestamp::default(),
        })
    }

    /// Stores a record.
    ///
    /// # Errors
    /// As [`CaptureWriter::received`].
    pub fn record(&mut self, record: &Record) -> Result<(), CaptureError> {
        match record {
            Record::Received { at, bytes } => self.received(*at, bytes),
            Record::Sent { at, bytes } => self.sent(*at, bytes),
            Record::Opened { at } => self.opened(*at),
            Record::Truth { at, pose } => self.truth(*at, *pose),
        }
    }

    /// Stores that the port was opened again at `at`: an empty chunk from the board.
    ///
    /// # Errors
    /// As [`CaptureWriter::received`].
    pub fn opened(&mut self, at: Timestamp) -> Result<(), CaptureError> {
        self.write(|channels| &mut channels.received, at, &[])
    }

    /// Stores bytes read from the board at `at`; no bytes are no record.
    ///
    /// # Errors
    /// When the file cannot be written or `at` is earlier than a time already stored.
    pub fn received(&mut self, at: Timestamp, bytes: &[u8]) -> Result<(), CaptureError> {
        if bytes.is_empty() {
            return Ok(());
        }
        self.write(|channels| &mut channels.received, at, bytes)
    }

    /// Stores bytes written to the board at `at`.
    ///
    /// # Errors
    /// As [`CaptureWriter::received`].
    pub fn sent(&mut self, at: Timestamp, bytes: &[u8]) -> Result<(), CaptureError> {
        self.write(|channels| &mut channels.sent, at, bytes)
    }

    /// Stores the true pose `world_from_robot` at `at`.
    ///
    /// # Errors
    /// As [`CaptureWriter::received`].
    pub fn truth(&mut self, at: Timestamp, pose: Pose2) -> Result<(), CaptureError> {
        let message = TruthMessage { x_m: pose.x_m, y_m: pose.y_m, theta_rad: pose.theta_rad };
        let json = serde_json::to_vec(&message)
            .map_err(|error| CaptureError::Io { path: self.path.clone(), source: error.into() })?;
        self.write(|channels| &mut channels.truth, at, &json)
    }

    /// Closes and flushes the open chunk if it began [`FLUSH_PERIOD`] or more before `at`. Call it in
    /// idle times; the other methods call it themselves.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn flush_if_due(&mut self, at: Timestamp) -> Result<(), CaptureError> {
        if self.chunk_opened.is_some_and(|opened| opened + FLUSH_PERIOD <= at) {
            self.chunk_opened = None;
            self.chunks = self.chunks.saturating_add(1);
            if self.chunks >= CHUNKS_BEFORE_COPY {
                self.describe_again()?;
            }
            self.writer.flush().map_err(|error| write_error(&self.path, error))?;
        }
        Ok(())
    }

    /// Time from the newest message until the open chunk is due to be closed; `None` if no chunk is
    /// open.
    #[must_use]
    pub fn flush_in(&self) -> Option<Duration> {
        self.chunk_opened.map(|opened| {
            FLUSH_PERIOD.saturating_sub(Duration::from_micros(self.last.us().saturating_sub(opened.us())))
        })
    }

    /// A copy of the description, so that damage at the head costs no more than the damaged bytes.
    fn describe_again(&mut self) -> Result<(), CaptureError> {
        let Some(description) = self.description.take() else { return Ok(()) };
        self.writer.metadata(&description.name, &description.metadata).map_err(|error| write_error(&self.path, error))
    }

    /// Writes the summary. A second call does nothing.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn end(&mut self) -> Result<(), CaptureError> {
        self.chunk_opened = None;
        self.describe_again()?;
        self.writer.finish().map_err(|error| write_error(&self.path, error))
    }

    fn write(
        &mut self,
        pick: fn(&mut Channels) -> &mut Channel,
        at: Timestamp,
        bytes: &[u8],
    ) -> Result<(), CaptureError> {
        if at < self.last {
            let path = self.path.clone();
            return Err(CaptureError::TimeRunsBack { path, before_s: self.last.seconds(), at_s: at.seconds() });
        }
        self.flush_if_due(at)?;
        self.last = at;
        self.chunk_opened.get_or_insert(at);
        let channel = pick(&mut self.channels);
        let log_time = at.us().saturating_mul(1000);
        let Channel { index, messages } = *channel;
        channel.messages = messages.wrapping_add(1);
        self.writer.message(index, messages, log_time, bytes).map_err(|error| write_error(&self.path, error))
    }
}

/// The description's copy follows on so many chunks: a second of a drive, some kilobytes away from the first.
const CHUNKS_BEFORE_COPY: u32 = 10;

/// Writes and flushes metadata and channels first, so that a truncated file can be read.
fn begin<W: Write>(to: W, info: &CaptureInfo) -> io::Result<(McapFile<W>, Channels)> {
    let mut writer = McapFile::begin(to, "slamd", &format!("{LIBRARY}{}", info.slamd_version))?;
    let description = info.to_metadata();
    writer.metadata(&description.name, &description.metadata)?;
    writer.schema(1, "slamd.Pose2", "jsonschema", TRUTH_SCHEMA);
    writer.channel(1, 0, RECEIVED_TOPIC, "application/octet-stream");
    writer.channel(2, 0, SENT_TOPIC, "application/octet-stream");
    writer.channel(3, 1, TRUTH_TOPIC, "json");
    writer.flush()?;
    let [received, sent, truth] = [0, 1, 2].map(|index| Channel { index, messages: 0 });
    Ok((writer, Channels { received, sent, truth }))
}

fn write_error(path: &Path, source: io::Error) -> CaptureError {
    CaptureError::Io { path: path.into(), source }
}

const TRUTH_SCHEMA: &str = r#"{
  "title": "slamd.Pose2",
  "description": "world_from_robot: metres and radians, x forward, y left, counter-clockwise",
  "type": "object",
  "properties": { "x_m": { "type": "number" }, "y_m": { "type": "number" }, "theta_rad": { "type": "number" } },
  "required": ["x_m", "y_m", "theta_rad"]
}"#;
