//! A recording's bytes as text: gzip is unpacked, UTF-16 is decoded, and what is no text is named.

use super::ImportError;
use flate2::read::MultiGzDecoder;
use std::io::Read;

/// The text of a recording.
#[derive(Debug)]
pub(super) struct Text {
    pub(super) text: String,
    /// What was done to read it, and what is missing, one sentence each.
    pub(super) remarks: Vec<String>,
    /// False if the end is missing.
    pub(super) is_whole: bool,
}

/// Most bytes of a recording, as it arrives and unpacked: 100 days of a ring of 16 sensors at 1 Hz, 10 days at 10 Hz.
const MAX_BYTES: u64 = 256 << 20;
/// Most lines: a row takes much more memory than a short line.
const MAX_LINES: usize = 4_000_000;
/// First bytes of files that are no text, and what they are.
const MAGIC: [(&[u8], &str); 8] = [
    (b"PK\x03\x04", "a ZIP archive or an Excel workbook; unpack it, or save it as CSV"),
    (b"\x89MCAP", "an MCAP file; `slamd replay` takes captures, `slamd import bag` ROS 2 bags"),
    (b"SQLite format 3", "an SQLite database; `slamd import bag` takes ROS 2 bags"),
    (b"#ROSBAG V", "a ROS 1 bag; convert it to ROS 2 (`rosbags-convert`), and `slamd import bag` reads it"),
    (b"BZh", "a bzip2 file; unpack it (`bzcat FILE | slamd import ... -`)"),
    (b"\xfd7zXZ", "an xz file; unpack it (`xzcat FILE | slamd import ... -`)"),
    (b"\x28\xb5\x2f\xfd", "a zstd file; unpack it (`zstdcat FILE | slamd import ... -`)"),
    (b"%PDF", "a PDF document"),
];
/// A text in UTF-16 has at least this share of zero bytes; other text has none.
const MIN_ZEROS: f64 = 0.2;
/// So many bytes decide about the encoding.
const PROBE: usize = 4096;

/// Reads a recording, called `file` in errors.
///
/// # Errors
/// When it cannot be read, is no text or is too long.
pub(super) fn read(input: impl Read, file: &str) -> Result<Text, ImportError> {
    read_within(input, file, MAX_BYTES, MAX_LINES)
}

/// The same within other bounds.
fn read_within(input: impl Read, file: &str, max_bytes: u64, max_lines: usize) -> Result<Text, ImportError> {
    let mut bytes = Vec::new();
    let io = |source| ImportError::Io { file: file.into(), source };
    let too_long = |words: String| ImportError::Problem {
        file: file.into(),
        problem: format!("more than {words}: split the recording"),
    };
    let check = |bytes: &[u8], whence: &str| {
        let is_more = bytes.len() as u64 > max_bytes;
        if is_more { Err(too_long(format!("{} MiB of text{whence}", max_bytes >> 20))) } else { Ok(()) }
    };
    input.take(max_bytes + 1).read_to_end(&mut bytes).map_err(io)?;
    check(&bytes, "")?;
    let mut read = Text { text: String::new(), remarks: Vec::new(), is_whole: true };
    if bytes.starts_with(&[0x1f, 0x8b]) {
        let mut unpacked = Vec::new();
        if let Err(error) = MultiGzDecoder::new(bytes.as_slice()).take(max_bytes + 1).read_to_end(&mut unpacked) {
            read.is_whole = false;
            read.remarks.push(format!("the gzip file is damaged or cut off ({error}); what could be unpacked is used"));
        }
        check(&unpacked, ", unpacked")?;
        bytes = unpacked;
    }
    if let Some((_, what)) = MAGIC.iter().find(|(magic, _)| bytes.starts_with(magic)) {
        return Err(ImportError::Foreign { file: file.into(), what });
    }
    read.text = decode(bytes, file)?;
    let zeros = read.text.bytes().filter(|byte| *byte == 0).count();
    if zeros > 0 {
        let line = 1 + read.text.bytes().take_while(|byte| *byte != 0).filter(|byte| *byte == b'\n').count();
        read.text.retain(|character| character != '\0');
        read.remarks.push(format!(
            "{} left out, the first in line {line}: the card or the line has lost data there",
            if zeros == 1 { "1 zero byte is".into() } else { format!("{zeros} zero bytes are") }
        ));
    }
    let lines = |end: u8| read.text.bytes().filter(|byte| *byte == end).count();
    if lines(b'\n').max(lines(b'\r')) > max_lines {
        return Err(too_long(format!("{max_lines} lines")));
    }
    Ok(read)
}

fn decode(bytes: Vec<u8>, file: &str) -> Result<String, ImportError> {
    let probe = bytes.get(..PROBE.min(bytes.len())).unwrap_or_default();
    let zeros = |odd: usize| probe.iter().skip(odd).step_by(2).filter(|byte| **byte == 0).count();
    let (even, odd) = (zeros(0), zeros(1));
    if (even + odd) as f64 >= MIN_ZEROS * probe.len().max(1) as f64 {
        if even.min(odd) > even.max(odd) / 10 {
            return Err(ImportError::Foreign { file: file.into(), what: "no text; name a CSV file or a CARMEN log" });
        }
        let unit = |pair: &[u8; 2]| if odd > even { u16::from_le_bytes(*pair) } else { u16::from_be_bytes(*pair) };
        let units = bytes.as_chunks::<2>().0.iter().map(unit);
        let text: String = char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect();
        return Ok(text.trim_start_matches(BYTE_ORDER_MARK).into());
    }
    let text = String::from_utf8(bytes).unwrap_or_else(|error| String::from_utf8_lossy(error.as_bytes()).into_owned());
    Ok(if text.starts_with(BYTE_ORDER_MARK) { text.trim_start_matches(BYTE_ORDER_MARK).into() } else { text })
}

/// True for a text whose first lines are those of a CARMEN log.
pub(super) fn is_carmen(text: &str) -> bool {
    let first = text.lines().filter(|line| !line.trim().is_empty() && !line.starts_with('#')).take(20);
    first.filter_map(|line| line.split_whitespace().next()).any(|word| CARMEN.contains(&word))
}

/// How the lines of a CARMEN log begin.
const CARMEN: [&str; 7] = ["ODOM", "SONAR", "ROBOTLASER1", "FLASER", "PARAM", "TRUEPOS", "SYNC"];
const BYTE_ORDER_MARK: char = '\u{feff}';

#[cfg(test)]
mod tests {
    use super::*;
    use flate2::{Compression, write::GzEncoder};
    use std::io::Write as _;

    const TEXT: &str = "t_s,left_ticks,right_ticks,r0\n0,1,2,0.5\n0.1,1,2,0.5\n";

    fn utf16(mark: bool, big: bool) -> Vec<u8> {
        let text = if mark { format!("\u{feff}{TEXT}") } else { TEXT.into() };
        text.encode_utf16().flat_map(|unit| if big { unit.to_be_bytes() } else { unit.to_le_bytes() }).collect()
    }

    fn gzip() -> Vec<u8> {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
        let many: String =
            (0..5_000).map(|k: u32| format!("{k},{},{}\n", k.wrapping_mul(2_654_435_761), k ^ 77)).collect();
        encoder.write_all(many.as_bytes()).unwrap();
        encoder.finish().unwrap()
    }

    #[test]
    fn every_encoding_gives_the_same_text() {
        let mark = [b"\xef\xbb\xbf", TEXT.as_bytes()].concat();
        let packed = {
            let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
            encoder.write_all(&mark).unwrap();
            encoder.finish().unwrap()
        };
        let all = [
            TEXT.as_bytes().to_vec(),
            mark,
            utf16(true, false),
            utf16(true, true),
            utf16(false, false),
            utf16(false, true),
            packed,
        ];
        for bytes in all {
            let read = read(bytes.as_slice(), "a.csv").unwrap();
            assert_eq!((read.text.as_str(), read.is_whole), (TEXT, true), "{bytes:02x?}");
        }
    }

    #[test]
    fn boot_garbage_is_no_utf_16() {
        let bytes = [b"\xff\xfe@ets Jun  8 2016\n", TEXT.as_bytes()].concat();
        assert!(read(bytes.as_slice(), "a.csv").unwrap().text.ends_with(TEXT));
    }

    #[test]
    fn a_cut_gzip_file_is_used_as_far_as_it_goes() {
        let bytes = gzip();
        let cut = read(&bytes[..bytes.len() / 2], "a.csv.gz").unwrap();
        assert!(!cut.is_whole && cut.text.starts_with("0,0,77\n1,") && cut.text.len() > 1_000);
        assert!(cut.remarks[0].contains("cut off"), "{:?}", cut.remarks);
    }

    #[test]
    fn streams_and_bombs_stop_at_the_bound() {
        // The same byte for ever, and as many zipped.
        let error = read(std::io::repeat(b'1'), "-").unwrap_err();
        assert!(matches!(error, ImportError::Problem { .. }), "{error:?}");
        assert_eq!(error.to_string(), "-: more than 256 MiB of text: split the recording");
        let mut bomb = GzEncoder::new(Vec::new(), Compression::best());
        (0..8 << 10).for_each(|_| bomb.write_all(&[b'1'; 1 << 10]).unwrap());
        let bomb = bomb.finish().unwrap();
        assert!(bomb.len() < 10 << 10);
        let error = read_within(bomb.as_slice(), "a.gz", 2 << 20, 10).unwrap_err().to_string();
        assert_eq!(error, "a.gz: more than 2 MiB of text, unpacked: split the recording");
        assert_eq!(read_within(bomb.as_slice(), "a.gz", 8 << 20, 10).unwrap().text.len(), 8 << 20);
        // Rows of one character.
        let error = read_within("1\n".repeat(11).as_bytes(), "a.csv", 1 << 20, 10).unwrap_err().to_string();
        assert_eq!(error, "a.csv: more than 10 lines: split the recording");
        assert!(read_within("1\r".repeat(10).as_bytes(), "a.csv", 1 << 20, 10).is_ok());
    }

    #[test]
    fn files_that_are_no_text_are_named() {
        let error = |bytes: &[u8]| read(bytes, "a.csv").unwrap_err().to_string();
        assert!(error(b"PK\x03\x04rest").contains("a.csv is a ZIP archive or an Excel workbook"));
        assert!(error(b"\x89MCAP0\r\n").contains("an MCAP file"));
        assert!(error(&[0; 100]).contains("no text"));
    }
}
