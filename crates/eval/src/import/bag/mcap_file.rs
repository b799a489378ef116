//! The records of an MCAP file, also where it is damaged: a chunk is read up to the damage, and after it the next sound chunk is sought.

use mcap::records::{ChunkHeader, Record};
use mcap::{MAGIC, McapError};

/// What of a file could not be read.
#[derive(Debug, Default)]
pub(super) struct Losses {
    holes: Vec<Hole>,
    /// Chunks whose checksum is wrong: where they begin, bytes, and the times of their first and last message, nanoseconds.
    doubtful: Vec<(usize, Option<(u64, u64)>)>,
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
    /// Where in the file it begins, bytes, and how many messages precede it.
    at: usize,
    messages: u64,
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
        let (piece, behind) = match record(bytes, at) {
            Some((opcode, body, behind)) => (piece(opcode, body), Some(behind)),
            None => (cut_chunk(bytes.get(at..).unwrap_or_default()), None),
        };
        if let Some(Failure::Compression(compression)) = &piece.error {
            return Err(compressed(compression));
        }
        let first_ns = piece.records.iter().find_map(time_ns);
        for record in piece.records {
            losses.see(&record);
            take(record)?;
        }
        let next = match (&piece.error, behind) {
            (None, Some(_)) if piece.is_end => return Ok(losses),
            (None, Some(behind)) => Some(behind),
            (Some(Failure::Checksum), Some(behind)) => {
                losses.doubtful.push((at, first_ns.zip(losses.times_ns.map(|(_, last_ns)| last_ns))));
                Some(behind)
            }
            (error, behind) => {
                // A length that is wrong may have swallowed chunks.
                let next = behind.filter(|_| is_chunk(bytes, at)).or_else(|| seek_chunk(bytes, at + 1));
                if behind.is_some() || next.is_some() {
                    let what = if let Some(Failure::Other(what)) = error {
                        what
                    } else {
                        "a record that is longer than the file"
                    };
                    losses.hole(at, what);
                } else {
                    losses.is_cut = true;
                }
                next
            }
        };
        let Some(next) = next else { return Ok(losses) };
        at = next;
    }
}

/// What stands at one point of a file.
struct Piece {
    records: Vec<Record<'static>>,
    /// Why what follows in this record cannot be read.
    error: Option<Failure>,
    /// It is the last record of a file.
    is_end: bool,
}

/// Why a record cannot be read.
enum Failure {
    /// A chunk could be read, but its checksum is another.
    Checksum,
    /// A chunk is compressed in this way.
    Compression(String),
    /// This.
    Other(String),
}

impl From<McapError> for Failure {
    fn from(error: McapError) -> Self {
        match error {
            McapError::BadChunkCrc { .. } => Self::Checksum,
            McapError::UnsupportedCompression(compression) => Self::Compression(compression),
            other => Self::Other(other.to_string()),
        }
    }
}

/// A record, or the records of a chunk.
fn piece(opcode: u8, body: &[u8]) -> Piece {
    let (records, error) = match slamd_capture::parse_record(opcode, body) {
        Ok(Record::Chunk { header, data }) => records(header, &data),
        Ok(Record::Unknown { opcode, .. }) if opcode < PRIVATE_OPCODES => {
            (Vec::new(), Some(Failure::Other(format!("a record of type {opcode:#04x}, which MCAP does not have"))))
        }
        Ok(record) => (vec![record.into_owned()], None),
        Err(error) => (Vec::new(), Some(error.into())),
    };
    let is_end = matches!(records.as_slice(), [Record::Footer(_)]);
    Piece { records, error, is_end }
}

/// The records of a chunk whose end is missing.
fn cut_chunk(bytes: &[u8]) -> Piece {
    let none = Piece { records: Vec::new(), error: None, is_end: false };
    let Some((&CHUNK, rest)) = bytes.split_first() else { return none };
    let body = rest.get(HEAD - 1..).unwrap_or_default();
    // Two times, size, checksum, and the length of the compression's name, which is followed by the length of the records.
    let name = body
        .get(28..)
        .and_then(<[u8]>::first_chunk)
        .map_or(usize::MAX, |length| usize::try_from(u32::from_le_bytes(*length)).unwrap_or(usize::MAX));
    let Some(end) = name.checked_add(CHUNK_HEAD).filter(|end| *end <= body.len()) else { return none };
    let (head, data) = body.split_at(end);
    let mut whole = head.get(..end - 8).unwrap_or_default().to_vec();
    whole.extend((data.len() as u64).to_le_bytes());
    whole.extend(data);
    piece(CHUNK, &whole)
}

fn time_ns(record: &Record<'_>) -> Option<u64> {
    if let Record::Message { header, .. } = record { Some(header.log_time) } else { None }
}

/// Type and body of the record at a byte, and where the next one begins.
fn record(bytes: &[u8], at: usize) -> Option<(u8, &[u8], usize)> {
    let (head, rest) = bytes.get(at..)?.split_at_checked(HEAD)?;
    let (opcode, length) = head.split_first()?;
    let length = usize::try_from(u64::from_le_bytes(*length.first_chunk()?)).ok()?;
    Some((*opcode, rest.get(..length)?, at + HEAD + length))
}

/// The records of a chunk up to the first that cannot be read, and why it cannot.
fn records(header: ChunkHeader, data: &[u8]) -> (Vec<Record<'static>>, Option<Failure>) {
    if header.uncompressed_size > MAX_CHUNK_BYTES {
        return (Vec::new(), Some(Failure::Other("a chunk of more than 1 GiB".into())));
    }
    let (mut records, mut error) = (Vec::new(), None);
    match mcap::read::ChunkReader::new(header, data) {
        Ok(all) => {
            for record in all {
                match record {
                    Ok(record) => records.push(record.into_owned()),
                    Err(failure) => {
                        error = Some(failure.into());
                        break;
                    }
                }
            }
        }
        Err(failure) => error = Some(failure.into()),
    }
    (records, error)
}

/// True if the bytes have the lengths and times of a chunk.
fn is_chunk(bytes: &[u8], at: usize) -> bool {
    let Some((CHUNK, body, _)) = record(bytes, at) else { return false };
    let Ok(Record::Chunk { header, data }) = slamd_capture::parse_record(CHUNK, body) else { return false };
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
        self.holes.push(Hole { at, messages: self.messages, what: what.into(), after_ns, before_ns: None });
    }

    /// How many messages precede the first hole.
    pub(super) fn before_first(&self) -> Option<u64> {
        self.holes.first().map(|hole| hole.messages)
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
        for (at, times_ns) in self.doubtful.iter().take(MAX_HOLES) {
            let (from, to) = times_ns.unwrap_or_default();
            sentences.push(format!(
                "the checksum of the chunk at byte {at} is wrong: some message between {:.1} s and {:.1} s of the bag is wrong, and all are used",
                seconds(from),
                seconds(to)
            ));
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
        bag_with_chunks_of(Some(64))
    }

    fn bag_with_chunks_of(size: Option<u64>) -> Vec<u8> {
        let mut file = Cursor::new(Vec::new());
        let mut writer = mcap::WriteOptions::new().compression(None).chunk_size(size).create(&mut file).unwrap();
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
    fn damage_costs_the_rest_of_its_chunk() {
        let whole = bag();
        assert_eq!(read_all(&whole), ((0..10).collect(), Vec::new()));
        // In the bytes of message 4: all can be read, but one is wrong.
        let at = whole.windows(80).position(|window| window == [4; 80]).unwrap();
        let mut wrong = whole.clone();
        wrong[at + 40] ^= 1;
        let (seen, said) = read_all(&wrong);
        assert_eq!(seen, (0..10).collect::<Vec<u8>>());
        assert!(
            said.len() == 1 && said[0].contains("some message between 4.0 s and 4.0 s of the bag is wrong"),
            "{said:?}"
        );
        // The message's own length.
        let mut torn = whole.clone();
        torn[at - 24] = 0xff;
        let (seen, said) = read_all(&torn);
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

    #[test]
    fn a_bag_of_one_chunk_is_read_up_to_the_cut() {
        let whole = bag_with_chunks_of(None);
        let at = whole.windows(80).position(|window| window == [6; 80]).unwrap();
        let (seen, said) = read_all(&whole[..at + 10]);
        assert_eq!((seen, said.len()), (vec![0, 1, 2, 3, 4, 5], 1));
    }
}
