//! The MCAP records of a capture, as bytes. The writer of the `mcap` library keeps an index of every chunk until the file is closed: 11 MB an
//! hour. This one keeps at most [`MAX_INDEXED_CHUNKS`].
//!
//! Layout: <https://mcap.dev/spec>. All numbers little end first.

use super::reader::CRC;
use mcap::MAGIC;
use mcap::records::op;
use std::collections::BTreeMap;
use std::io::{self, Write};

/// A file of more chunks gets no index of them, and readers scan it: nine minutes at 11 chunks a second, 0.8 MB of memory. More would
/// let the memory of a long recording grow; a part of an index would hide the rest from readers.
pub(super) const MAX_INDEXED_CHUNKS: usize = 6_000;
/// A chunk is closed when it has so many bytes: much less than readers accept.
const MAX_CHUNK_BYTES: usize = 1 << 20;
/// Channels of a capture: received, sent, truth.
pub(super) const CHANNELS: usize = 3;

/// Where a chunk is, and what it holds.
struct ChunkIndex {
    times: (u64, u64),
    start: u64,
    length: u64,
    /// By channel, where its message index is.
    indexes: [Option<u64>; CHANNELS],
    indexes_length: u64,
    size: u64,
}

/// Writes an MCAP file to a target, and its summary when it is dropped at the latest.
pub(super) struct McapFile<W: Write> {
    /// None after [`McapFile::into_inner`].
    to: Option<W>,
    position: u64,
    crc: crc::Digest<'static, u32>,
    /// The open chunk's records, and by channel where its messages are: time in nanoseconds, and offset.
    chunk: Vec<u8>,
    messages: [Vec<(u64, u64)>; CHANNELS],
    chunk_times: Option<(u64, u64)>,
    /// Schemas and channels once more, for the summary.
    schemas: Vec<u8>,
    channels: Vec<u8>,
    metadata_indexes: Vec<u8>,
    /// None where there are more than [`MAX_INDEXED_CHUNKS`].
    index: Option<Vec<ChunkIndex>>,
    chunks: u32,
    metadata: u32,
    counts: [u64; CHANNELS],
    times: Option<(u64, u64)>,
    /// The summary is written, or a write has failed: what follows would stand behind half a record.
    is_over: bool,
}

/// The table of the checksum, for digests that are kept.
static DATA_CRC: crc::Crc<u32> = CRC;

impl<W: Write> McapFile<W> {
    /// Begins a file.
    ///
    /// # Errors
    /// When the target fails, as in all others.
    pub(super) fn begin(to: W, profile: &str, library: &str) -> io::Result<Self> {
        let mut file = Self {
            to: Some(to),
            position: 0,
            crc: DATA_CRC.digest(),
            chunk: Vec::new(),
            messages: Default::default(),
            chunk_times: None,
            schemas: Vec::new(),
            channels: Vec::new(),
            metadata_indexes: Vec::new(),
            index: Some(Vec::new()),
            chunks: 0,
            metadata: 0,
            counts: [0; CHANNELS],
            times: None,
            is_over: false,
        };
        let header = record(op::HEADER, |body| {
            put_text(body, profile);
            put_text(body, library);
        });
        file.write(&[MAGIC, &header].concat())?;
        Ok(file)
    }

    /// Adds schema `id` to the open chunk.
    pub(super) fn schema(&mut self, id: u16, name: &str, encoding: &str, data: &str) {
        let schema = record(op::SCHEMA, |body| {
            body.extend(id.to_le_bytes());
            [name, encoding, data].into_iter().for_each(|text| put_text(body, text));
        });
        self.chunk.extend(&schema);
        self.schemas.extend(&schema);
    }

    /// Adds channel `id` to the open chunk; schema 0 is none.
    pub(super) fn channel(&mut self, id: u16, schema: u16, topic: &str, encoding: &str) {
        let channel = record(op::CHANNEL, |body| {
            body.extend(id.to_le_bytes());
            body.extend(schema.to_le_bytes());
            put_text(body, topic);
            put_text(body, encoding);
            put_list(body, |_| ());
        });
        self.chunk.extend(&channel);
        self.channels.extend(&channel);
    }

    /// Adds a message to the open chunk, and closes it if it is large. `channel` counts from 0 and has the id after it.
    pub(super) fn message(&mut self, channel: usize, sequence: u32, time_ns: u64, data: &[u8]) -> io::Result<()> {
        let offset = self.chunk.len() as u64;
        let message = record(op::MESSAGE, |body| {
            body.extend(id(channel).to_le_bytes());
            body.extend(sequence.to_le_bytes());
            body.extend(time_ns.to_le_bytes());
            body.extend(time_ns.to_le_bytes());
            body.extend(data);
        });
        self.chunk.extend(&message);
        if let (Some(messages), Some(count)) = (self.messages.get_mut(channel), self.counts.get_mut(channel)) {
            messages.push((time_ns, offset));
            *count += 1;
        }
        for times in [&mut self.chunk_times, &mut self.times] {
            *times = Some(times.map_or((time_ns, time_ns), |(first, last)| (first.min(time_ns), last.max(time_ns))));
        }
        if self.chunk.len() >= MAX_CHUNK_BYTES { self.close_chunk() } else { Ok(()) }
    }

    /// Closes the open chunk and writes a metadata record.
    pub(super) fn metadata(&mut self, name: &str, pairs: &BTreeMap<String, String>) -> io::Result<()> {
        self.close_chunk()?;
        let (offset, metadata) = (
            self.position,
            record(op::METADATA, |body| {
                put_text(body, name);
                put_list(body, |list| pairs.iter().flat_map(<[_; 2]>::from).for_each(|text| put_text(list, text)));
            }),
        );
        self.write(&metadata)?;
        self.metadata += 1;
        self.metadata_indexes.extend(record(op::METADATA_INDEX, |body| {
            body.extend(offset.to_le_bytes());
            body.extend((metadata.len() as u64).to_le_bytes());
            put_text(body, name);
        }));
        Ok(())
    }

    /// Closes the open chunk, and flushes the target.
    pub(super) fn flush(&mut self) -> io::Result<()> {
        self.close_chunk()?;
        self.to.as_mut().map_or(Ok(()), W::flush)
    }

    /// Writes the open chunk and its message indexes at once.
    fn close_chunk(&mut self) -> io::Result<()> {
        if self.chunk.is_empty() {
            return Ok(());
        }
        let (start, size) = (self.position, self.chunk.len() as u64);
        let times = self.chunk_times.take().unwrap_or_default();
        let mut bytes = record(op::CHUNK, |body| {
            body.extend(times.0.to_le_bytes());
            body.extend(times.1.to_le_bytes());
            body.extend(size.to_le_bytes());
            body.extend(CRC.checksum(&self.chunk).to_le_bytes());
            put_text(body, "");
            body.extend(size.to_le_bytes());
            body.extend(&self.chunk);
        });
        self.chunk.clear();
        let length = bytes.len() as u64;
        let mut indexes = [None; CHANNELS];
        for (channel, (messages, index)) in self.messages.iter_mut().zip(&mut indexes).enumerate() {
            if messages.is_empty() {
                continue;
            }
            *index = Some(start + bytes.len() as u64);
            bytes.extend(record(op::MESSAGE_INDEX, |body| {
                body.extend(id(channel).to_le_bytes());
                put_list(body, |list| {
                    for (time_ns, offset) in messages.drain(..) {
                        list.extend(time_ns.to_le_bytes());
                        list.extend(offset.to_le_bytes());
                    }
                });
            }));
        }
        self.chunks = self.chunks.saturating_add(1);
        if self.index.as_ref().is_some_and(|index| index.len() >= MAX_INDEXED_CHUNKS) {
            self.index = None;
        }
        if let Some(index) = &mut self.index {
            index.push(ChunkIndex { times, start, length, indexes, indexes_length: bytes.len() as u64 - length, size });
        }
        self.write(&bytes)
    }

    /// Closes the open chunk and writes the summary. A second call does nothing.
    pub(super) fn finish(&mut self) -> io::Result<()> {
        if self.is_over {
            return Ok(());
        }
        self.close_chunk()?;
        let data_crc = self.crc.clone().finalize();
        self.write(&record(op::DATA_END, |body| body.extend(data_crc.to_le_bytes())))?;
        let begin = self.position;
        let indexes = self.index.take().unwrap_or_default().iter().flat_map(ChunkIndex::record).collect();
        let groups = [
            (op::SCHEMA, std::mem::take(&mut self.schemas)),
            (op::CHANNEL, std::mem::take(&mut self.channels)),
            (op::STATISTICS, self.statistics()),
            (op::CHUNK_INDEX, indexes),
            (op::METADATA_INDEX, std::mem::take(&mut self.metadata_indexes)),
        ];
        let (mut summary, mut offsets) = (Vec::new(), Vec::new());
        for (opcode, group) in groups.iter().filter(|(_, group)| !group.is_empty()) {
            offsets.extend(record(op::SUMMARY_OFFSET, |body| {
                body.push(*opcode);
                body.extend((begin + summary.len() as u64).to_le_bytes());
                body.extend((group.len() as u64).to_le_bytes());
            }));
            summary.extend(group);
        }
        let offsets_begin = begin + summary.len() as u64;
        summary.extend(offsets);
        // The checksum covers the footer up to itself.
        summary.push(op::FOOTER);
        summary.extend(FOOTER_LENGTH.to_le_bytes());
        summary.extend(begin.to_le_bytes());
        summary.extend(offsets_begin.to_le_bytes());
        summary.extend(CRC.checksum(&summary).to_le_bytes());
        summary.extend(MAGIC);
        self.write(&summary)?;
        self.is_over = true;
        Ok(())
    }

    fn statistics(&self) -> Vec<u8> {
        let (first, last) = self.times.unwrap_or_default();
        record(op::STATISTICS, |body| {
            body.extend(self.counts.iter().sum::<u64>().to_le_bytes());
            // Of the truth.
            body.extend(1_u16.to_le_bytes());
            body.extend(u32::from(id(CHANNELS - 1)).to_le_bytes());
            // Attachments.
            body.extend(0_u32.to_le_bytes());
            body.extend(self.metadata.to_le_bytes());
            body.extend(self.chunks.to_le_bytes());
            body.extend(first.to_le_bytes());
            body.extend(last.to_le_bytes());
            put_list(body, |list| {
                for (channel, count) in self.counts.iter().enumerate().filter(|(_, count)| **count > 0) {
                    list.extend(id(channel).to_le_bytes());
                    list.extend(count.to_le_bytes());
                }
            });
        })
    }

    /// The target; without [`McapFile::finish`] before, the file is not complete.
    pub(super) fn into_inner(mut self) -> Option<W> {
        self.is_over = true;
        self.to.take()
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        let to = self.to.as_mut().filter(|_| !self.is_over);
        let to = to.ok_or_else(|| io::Error::other("the capture is closed, or an earlier write to it has failed"))?;
        to.write_all(bytes).inspect_err(|_| self.is_over = true)?;
        self.position += bytes.len() as u64;
        self.crc.update(bytes);
        Ok(())
    }
}

impl<W: Write> Drop for McapFile<W> {
    fn drop(&mut self) {
        // An error here has no reader: `finish` returns it.
        let _ = self.finish();
    }
}

impl ChunkIndex {
    fn record(&self) -> Vec<u8> {
        record(op::CHUNK_INDEX, |body| {
            for number in [self.times.0, self.times.1, self.start, self.length] {
                body.extend(number.to_le_bytes());
            }
            put_list(body, |list| {
                for (channel, offset) in self.indexes.iter().enumerate() {
                    if let Some(offset) = offset {
                        list.extend(id(channel).to_le_bytes());
                        list.extend(offset.to_le_bytes());
                    }
                }
            });
            body.extend(self.indexes_length.to_le_bytes());
            put_text(body, "");
            body.extend(self.size.to_le_bytes());
            body.extend(self.size.to_le_bytes());
        })
    }
}

/// Content of a footer: two offsets and the checksum.
const FOOTER_LENGTH: u64 = 8 + 8 + 4;

/// Ids count from 1.
fn id(channel: usize) -> u16 {
    u16::try_from(channel + 1).unwrap_or(u16::MAX)
}

/// A record: its type, the length of its content in eight bytes, and the content.
fn record(opcode: u8, content: impl FnOnce(&mut Vec<u8>)) -> Vec<u8> {
    let mut body = Vec::new();
    content(&mut body);
    [&[opcode][..], &(body.len() as u64).to_le_bytes(), &body].concat()
}

fn put_text(to: &mut Vec<u8>, text: &str) {
    put_list(to, |list| list.extend(text.as_bytes()));
}

/// Anything behind its length in four bytes.
fn put_list(to: &mut Vec<u8>, content: impl FnOnce(&mut Vec<u8>)) {
    let mut list = Vec::new();
    content(&mut list);
    to.extend(u32::try_from(list.len()).unwrap_or(u32::MAX).to_le_bytes());
    to.extend(list);
}
