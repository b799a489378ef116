//! The records of an MCAP file, also where it is damaged: a chunk counts only if its checksum is right, and after damage the next sound chunk
//! is sought.

use mcap::records::{ChunkHeader, Record};
use mcap::{MAGIC, McapError};

/// What of a file could not be read.
#[derive(Debug, Default)]
pub(super) struct Losses {
    holes: Vec<Hole>,
    /// The end is missing.
    is_cut: bool,
    /// Time of the first and the newest message, nanoseconds.
    times_ns: Option<(u64, u64)>,
    messages: u64,
    /// Messages that the file's statistics count.
    counted: Option<u64>,
}

#[derive(Debug)]
struct Hole {
    /// Where in the file it begins, bytes.
    at: usize,
    what: String,
    /// Times of the messages before and behind it, nanoseconds.
    after_ns: Option<u64>,
    before_ns: Option<u64>,
}

/// So many holes are described.
const MAX_HOLES: usize = 3;
/// A larger chunk is not unpacked, bytes.
const MAX_CHUNK_BYTES: u64 = 1 << 30;
/// Type and length of a record, bytes.
const HEAD: usize = 9;
const CHUNK: u8 = 0x06;
/// Record types from here on are for private use and are skipped.
const PRIVATE_OPCODES: u8 = 0x80;

/// Hands each record to `take`, those of chunks one by one.
///
/// # Errors
/// As `take`, and where chunks are compressed in a way that is not read: the name of the compression goes to `compressed`.
pub(super) fn read<E>(
    bytes: &[u8],
    mut take: impl FnMut(Record<'_>) -> Result<(), E>,
    compressed: impl Fn(&str) -> E,
) -> Result<Losses, E> {
    let (mut losses, mut at) = (Losses::default(), MAGIC.len());
    loop {
        let Some((opcode, body, behind)) = record(bytes, at) else {
            let next = seek_chunk(bytes, at + 1);
            if bytes.get(at..).is_some_and(|rest| !rest.is_empty()) && next.is_some() {
                losses.hole(at, "a record that is longer than the file");
            } else {
                losses.is_cut = true;
            }
            match next {
                Some(next) => at = next,
                None => return Ok(losses),
            }
            continue;
        };
        let records = match mcap::parse_record(opcode, body) {
            Ok(Record::Footer(_)) => return Ok(losses),
            Ok(Record::Chunk { header, data }) => match records(header, &data) {
                Err(McapError::UnsupportedCompression(compression)) => return Err(compressed(&compression)),
                records => records.map_err(|error| error.to_string()),
            },
            Ok(Record::Unknown { opcode, .. }) if opcode < PRIVATE_OPCODES => {
                Err(format!("a record of type {opcode:#04x}, which MCAP does not have"))
            }
            Ok(record) => Ok(vec![record]),
            Err(error) => Err(error.to_string()),
        };
        match records {
            Ok(records) => {
                for record in records {
                    losses.see(&record);
                    take(record)?;
                }
                at = behind;
            }
            Err(what) => {
                losses.hole(at, &what);
                // A length that is wrong may have swallowed chunks.
                let next = if is_chunk(bytes, at) { Some(behind) } else { seek_chunk(bytes, at + 1) };
                match next {
                    Some(next) => at = next,
                    None => return Ok(losses),
                }
            }
        }
    }
}

/// Type and body of the record at a byte, and where the next one begins.
fn record(bytes: &[u8], at: usize) -> Option<(u8, &[u8], usize)> {
    let (head, rest) = bytes.get(at..)?.split_at_checked(HEAD)?;
    let (opcode, length) = head.split_first()?;
    let length = usize::try_from(u64::from_le_bytes(*length.first_chunk()?)).ok()?;
    Some((*opcode, rest.get(..length)?, at + HEAD + length))
}

/// All records of a chunk.
fn records(header: ChunkHeader, data: &[u8]) -> Result<Vec<Record<'static>>, McapError> {
    if header.uncompressed_size > MAX_CHUNK_BYTES {
        return Err(McapError::RecordTooLarge { opcode: CHUNK, len: header.uncompressed_size });
    }
    mcap::read::ChunkReader::new(header, data)?.map(|record| record.map(Record::into_owned)).collect()
}

/// True if the bytes have the lengths and times of a chunk.
fn is_chunk(bytes: &[u8], at: usize) -> bool {
    let Some((CHUNK, body, _)) = record(bytes, at) else { return false };
    let Ok(Record::Chunk { header, data }) = mcap::parse_record(CHUNK, body) else { return false };
    let length = body.len().checked_sub(CHUNK_HEAD + header.compression.len());
    header.message_start_time <= header.message_end_time && length == Some(data.len())
}

/// Bytes of a chunk's head: two times, size, checksum, and the lengths of the compression's name and of the records.
const CHUNK_HEAD: usize = 8 + 8 + 8 + 4 + 4 + 8;

/// Where the next chunk begins.
fn seek_chunk(bytes: &[u8], from: usize) -> Option<usize> {
    let rest = bytes.get(from..)?;
    let begins = rest.iter().enumerate().filter(|(_, byte)| **byte == CHUNK);
    begins.map(|(index, _)| from + index).find(|at| is_chunk(bytes, *at))
}

impl Losses {
    fn hole(&mut self, at: usize, what: &str) {
        let after_ns = self.times_ns.map(|(_, last)| last);
        self.holes.push(Hole { at, what: what.into(), after_ns, before_ns: None });
    }

    fn see(&mut self, record: &Record<'_>) {
        match record {
            Record::Message { header, .. } => {
                self.messages += 1;
                let at_ns = header.log_time;
                self.holes.iter_mut().rev().take_while(|hole| hole.before_ns.is_none()).for_each(|hole| {
                    hole.before_ns = Some(at_ns);
                });
                let (first, last) = self.times_ns.unwrap_or((at_ns, at_ns));
                self.times_ns = Some((first.min(at_ns), last.max(at_ns)));
            }
            Record::Statistics(statistics) => self.counted = Some(statistics.message_count),
            _ => {}
        }
    }

    /// What is missing, one sentence each; empty if nothing is.
    pub(super) fn sentences(&self) -> Vec<String> {
        let (first_ns, last_ns) = self.times_ns.unwrap_or_default();
        let seconds = |at_ns: u64| 1e-9 * at_ns.saturating_sub(first_ns) as f64;
        let span = |hole: &Hole| match (hole.after_ns, hole.before_ns) {
            (Some(after), Some(before)) => {
                format!(
                    "what was recorded between {:.1} s and {:.1} s of the bag is lost",
                    seconds(after),
                    seconds(before)
                )
            }
            (Some(after), None) => format!("what was recorded after {:.1} s of the bag is lost", seconds(after)),
            (None, Some(_)) => "what was recorded before the first message is lost".into(),
            (None, None) => "nothing could be read".into(),
        };
        let hole = |hole: &Hole| format!("damaged at byte {} ({}): {}", hole.at, hole.what, span(hole));
        let mut sentences: Vec<String> = self.holes.iter().take(MAX_HOLES).map(hole).collect();
        if self.holes.len() > MAX_HOLES {
            sentences.push(format!("damaged in {} more places", self.holes.len() - MAX_HOLES));
        }
        if self.is_cut {
            sentences.push(format!(
                "cut off: it ends {:.1} s after its begin; what was recorded after that is lost",
                seconds(last_ns)
            ));
        }
        if let Some(counted) = self.counted.filter(|counted| *counted > self.messages) {
            sentences.push(format!("{} of {counted} messages could be read", self.messages));
        }
        sentences
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    /// Ten messages a second apart, each in a chunk of its own.
    fn bag() -> Vec<u8> {
        let mut file = Cursor::new(Vec::new());
        let mut writer = mcap::WriteOptions::new().compression(None).chunk_size(Some(64)).create(&mut file).unwrap();
        let channel = writer.add_channel(0, "/sonar0", "cdr", &std::collections::BTreeMap::new()).unwrap();
        for k in 0..10u32 {
            let log_time = 1_700_000_000_000_000_000 + 1_000_000_000 * u64::from(k);
            let header =
                mcap::records::MessageHeader { channel_id: channel, sequence: k, log_time, publish_time: log_time };
            writer.write_to_known_channel(&header, &[u8::try_from(k).unwrap(); 80]).unwrap();
        }
        writer.finish().unwrap();
        drop(writer);
        file.into_inner()
    }

    /// The first bytes of the messages, and what is said to be missing.
    fn read_all(bytes: &[u8]) -> (Vec<u8>, Vec<String>) {
        let mut seen = Vec::new();
        let take = |record: Record<'_>| {
            if let Record::Message { data, .. } = record {
                seen.push(data[0]);
            }
            Ok::<(), String>(())
        };
        let losses = read(bytes, take, str::to_owned).unwrap();
        (seen, losses.sentences())
    }

    #[test]
    fn a_damaged_chunk_costs_itself_alone() {
        let whole = bag();
        assert_eq!(read_all(&whole), ((0..10).collect(), Vec::new()));
        // In the bytes of message 4.
        let at = whole.windows(80).position(|window| window == [4; 80]).unwrap();
        let mut damaged = whole.clone();
        damaged[at + 40] ^= 1;
        let (seen, said) = read_all(&damaged);
        assert_eq!(seen, [0, 1, 2, 3, 5, 6, 7, 8, 9]);
        assert!(said[0].starts_with("damaged at byte ") && said[0].contains("between 3.0 s and 5.0 s"), "{said:?}");
        assert_eq!(said[1], "9 of 10 messages could be read");
    }

    #[test]
    fn any_damaged_byte_costs_at_most_its_chunk() {
        let whole = bag();
        for at in MAGIC.len()..whole.len() {
            let mut damaged = whole.clone();
            damaged[at] ^= 0x20;
            let (seen, said) = read_all(&damaged);
            assert!(seen.len() >= 8 || at > whole.len() / 2 || !said.is_empty(), "byte {at}: {seen:?}");
            assert!(seen.len() == 10 || !said.is_empty(), "byte {at}: {seen:?} without a word");
            assert!(seen.len() >= 9, "byte {at}: {seen:?} {said:?}");
        }
    }

    #[test]
    fn a_cut_says_how_far_the_bag_goes() {
        let whole = bag();
        let at = whole.windows(80).position(|window| window == [6; 80]).unwrap();
        let (seen, said) = read_all(&whole[..at + 10]);
        assert_eq!(seen, [0, 1, 2, 3, 4, 5]);
        assert_eq!(said, ["cut off: it ends 5.0 s after its begin; what was recorded after that is lost"]);
    }
}
