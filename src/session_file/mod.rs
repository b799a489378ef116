//! Session files: the saved state of a run on disk.
//!
//! | bytes | content |
//! |---|---|
//! | 0–7 | `slamdses` |
//! | 8–11 | version of the format, u32, little-endian |
//! | 12–19 | length of the payload, u64, little-endian |
//! | 20–23 | CRC-32 (ISO-HDLC, as in zip) of bytes 8–19 and the payload, u32, little-endian |
//! | 24– | the payload: a [`SavedState`] in [postcard's wire format](https://postcard.jamesmunns.com/wire-format) |
//!
//! In that format f64 are eight little-endian bytes, integers varints (signed ones zig-zag), a list is its length and its
//! elements, a struct its fields in the order of [`slamd_core::saved_state`], an enum the number of its variant. A change of any of these
//! types is a new version. `docs/session-file.md` describes the format for other programs.
//!
//! A file is written under another name and renamed, so it is always the old one or the new one, complete. A reader checks length and checksum
//! before it parses the payload. A length inside the payload never reserves more memory than the file has bytes: postcard rejects a length that
//! exceeds the remaining bytes.

#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing, clippy::string_slice)]
#![deny(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)]
#![deny(clippy::allow_attributes, clippy::allow_attributes_without_reason)]

mod saver;

pub use saver::Saver;

use crc::{CRC_32_ISO_HDLC, Crc};
use slamd_core::SavedState;
use slamd_core::saved_state::FoundRobot;
use slamd_files::{PartFile, WriteError, regular};
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

/// The first bytes of each session file.
pub const MAGIC: [u8; 8] = *b"slamdses";
/// Version of the format that this program writes.
pub const VERSION: u32 = 2;
/// The oldest version that it reads: one without the robot that was found.
pub const OLDEST_VERSION: u32 = 1;
/// Bytes in front of the payload.
pub const HEADER: usize = 24;
/// Largest accepted file, bytes: the largest map takes 50 MB.
const MAX_BYTES: u64 = 256 << 20;

const CHECKSUM: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// What is wrong with a session's bytes.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum SessionFileError {
    /// The first bytes differ.
    #[error("it is no session file: it begins with {found:02x?}, not with \"slamdses\"")]
    Magic {
        /// The first bytes, at most eight.
        found: Vec<u8>,
    },
    /// Another version.
    #[error("it has format version {found}, and this program reads versions {OLDEST_VERSION} to {VERSION}: {}", whose(*found))]
    Version {
        /// The file's version.
        found: u32,
    },
    /// Fewer bytes than the header says.
    #[error("it is cut off: it says that it has {expected} bytes, and ends after {found}")]
    Truncated {
        /// Bytes according to the header.
        expected: u64,
        /// Bytes in the file.
        found: u64,
    },
    /// More bytes than the header says.
    #[error("{} bytes follow its end at byte {expected}", found.saturating_sub(*expected))]
    Trailing {
        /// Bytes according to the header.
        expected: u64,
        /// Bytes in the file.
        found: u64,
    },
    /// The checksum differs.
    #[error("it is damaged: its checksum says 0x{expected:08x}, its bytes 0x{computed:08x}")]
    Checksum {
        /// As written in the file.
        expected: u32,
        /// As computed.
        computed: u32,
    },
    /// The payload cannot be parsed.
    #[error("its content cannot be read: {0}")]
    Content(String),
    /// Larger than any session.
    #[error("it has {found} bytes, and no session has more than {MAX_BYTES}")]
    TooLarge {
        /// Its size.
        found: u64,
    },
}

fn whose(version: u32) -> &'static str {
    if version > VERSION {
        "the file is from a newer slamd; update the program"
    } else {
        "the file is from an older slamd"
    }
}

/// A session file that cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// The system refuses.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// The file holds no session.
    #[error("{}: {source}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: SessionFileError,
    },
}

/// Encodes a saved state as the bytes of a session file.
///
/// # Panics
/// Never: the state consists of numbers and of lists with known lengths.
#[must_use]
#[expect(
    clippy::expect_used,
    reason = "postcard refuses only lists of unknown length and full buffers, and a Vec grows"
)]
pub fn encode(state: &SavedState) -> Vec<u8> {
    let payload = postcard::to_allocvec(state).expect("numbers and lists");
    let mut bytes = Vec::with_capacity(HEADER + payload.len());
    bytes.extend(MAGIC);
    let (version, length) = (VERSION.to_le_bytes(), (payload.len() as u64).to_le_bytes());
    bytes.extend(version);
    bytes.extend(length);
    bytes.extend(checksum(version, length, &payload).to_le_bytes());
    bytes.extend(payload);
    bytes
}

/// Decodes the bytes of a session file.
///
/// # Errors
/// What is wrong with the bytes. Arbitrary bytes never cause a panic.
pub fn decode(bytes: &[u8]) -> Result<SavedState, SessionFileError> {
    let found = bytes.len() as u64;
    let Some((_, rest)) = bytes.split_first_chunk::<8>().filter(|(magic, _)| **magic == MAGIC) else {
        // A beginning of the magic bytes means a truncated file.
        let is_cut = !bytes.is_empty() && bytes.len() < MAGIC.len() && MAGIC.starts_with(bytes);
        let expected = HEADER as u64;
        return Err(if is_cut {
            SessionFileError::Truncated { expected, found }
        } else {
            SessionFileError::Magic { found: bytes.iter().take(MAGIC.len()).copied().collect() }
        });
    };
    let cut = SessionFileError::Truncated { expected: HEADER as u64, found };
    let Some((version, rest)) = rest.split_first_chunk() else { return Err(cut) };
    let number = u32::from_le_bytes(*version);
    if !(OLDEST_VERSION..=VERSION).contains(&number) {
        return Err(SessionFileError::Version { found: number });
    }
    let Some((length, rest)) = rest.split_first_chunk() else { return Err(cut) };
    let Some((expected, payload)) = rest.split_first_chunk() else { return Err(cut) };
    let whole = u64::from_le_bytes(*length).saturating_add(HEADER as u64);
    if whole > found {
        return Err(SessionFileError::Truncated { expected: whole, found });
    }
    if whole < found {
        return Err(SessionFileError::Trailing { expected: whole, found });
    }
    let (expected, computed) = (u32::from_le_bytes(*expected), checksum(*version, *length, payload));
    if expected != computed {
        return Err(SessionFileError::Checksum { expected, computed });
    }
    let older = if number == OLDEST_VERSION { with_robot(payload) } else { Vec::new() };
    match postcard::take_from_bytes(if older.is_empty() { payload } else { &older }) {
        Ok((state, [])) => Ok(state),
        Ok((_, rest)) => Err(SessionFileError::Content(format!("{} bytes follow its end", rest.len()))),
        Err(error) => Err(SessionFileError::Content(error.to_string())),
    }
}

/// A payload of version 1 as one of version 2, which has one field more at its end.
fn with_robot(payload: &[u8]) -> Vec<u8> {
    // Four numbers and an empty list always have an encoding.
    let robot = postcard::to_allocvec(&FoundRobot::default()).unwrap_or_default();
    [payload, &robot].concat()
}

fn checksum(version: [u8; 4], length: [u8; 8], payload: &[u8]) -> u32 {
    let mut digest = CHECKSUM.digest();
    digest.update(&version);
    digest.update(&length);
    digest.update(payload);
    digest.finalize()
}

/// Reads a session file.
///
/// # Errors
/// When the file cannot be read or holds no session; the error names the file.
pub fn read(path: &Path) -> Result<SavedState, FileError> {
    let io = |source| FileError::Io { path: path.into(), source };
    let file = regular::open(path).map_err(io)?;
    let size = file.metadata().map_err(io)?.len();
    let mut bytes = Vec::new();
    if size <= MAX_BYTES {
        file.take(MAX_BYTES).read_to_end(&mut bytes).map_err(io)?;
    }
    let content = |source| FileError::Content { path: path.into(), source };
    if size > MAX_BYTES {
        return Err(content(SessionFileError::TooLarge { found: size }));
    }
    decode(&bytes).map_err(content)
}

/// Writes a session file: completely or not at all.
///
/// # Errors
/// When the file cannot be written; the error names the file.
pub fn write(path: &Path, state: &SavedState) -> Result<(), FileError> {
    let mut file = PartFile::create(path)?;
    file.append(&encode(state));
    Ok(file.finish().map(drop)?)
}

impl From<WriteError> for FileError {
    fn from(error: WriteError) -> Self {
        Self::Io { path: error.path, source: error.source }
    }
}
