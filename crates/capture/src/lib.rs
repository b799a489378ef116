//! Captures: the bytes of the serial line, in chunks with their times, in an MCAP file that Foxglove
//! can open.
//!
//! A capture stores raw bytes, so bytes that cannot be decoded are replayed too. `replay/README.md`
//! is the specification.

#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing, clippy::string_slice)]
#![deny(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)]
#![deny(clippy::allow_attributes, clippy::allow_attributes_without_reason)]

mod damage;
mod foreign;
mod lengths;
mod reader;
mod records;
mod salvage;
mod writer;

pub use lengths::parse_record;
/// The first bytes of an MCAP file.
pub use mcap::MAGIC;
pub use reader::CaptureReader;
pub use slamd_core::Record;
pub use writer::CaptureWriter;

use std::collections::BTreeMap;
use std::io;
use std::path::PathBuf;
use std::time::Duration;

/// Period of closing and flushing a chunk, log time. A kill must lose at most 0.1 s; the remaining
/// 20 ms are for the thread to wake up.
pub const FLUSH_PERIOD: Duration = Duration::from_millis(80);

/// Raw bytes from the board.
pub const RECEIVED_TOPIC: &str = "/serial/rx";
/// Raw bytes to the board.
pub const SENT_TOPIC: &str = "/serial/tx";
/// The true pose, if known.
pub const TRUTH_TOPIC: &str = "/truth/pose";

/// The description of a capture, in its `slamd` metadata record.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CaptureInfo {
    /// Version of the program that wrote it.
    pub slamd_version: String,
    /// Version of that program's wire protocol, as `major.minor`.
    pub protocol_version: String,
    /// The effective configuration as TOML.
    pub config_toml: String,
    /// Unix time in microseconds at `Timestamp` zero; `None` if unknown.
    pub unix_zero_us: Option<u64>,
    /// Free text: where and what was recorded, and the licence.
    pub notes: String,
    /// The true sensor faults, each as `SENSOR:KIND@TIME`, for example `7:saturated@30s`; `None` if
    /// unknown.
    pub faults: Option<Vec<String>>,
}

/// A capture that cannot be written or read.
#[derive(Debug, thiserror::Error)]
pub enum CaptureError {
    /// The file cannot be created, opened, read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The capture.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// The file does not begin with MCAP's magic bytes.
    #[error("{}: not an MCAP file: it begins with {found}, not with 89 4d 43 41 50 30 0d 0a{hint}", path.display())]
    NotMcap {
        /// The file.
        path: PathBuf,
        /// Its first bytes in hexadecimal.
        found: String,
        /// What to do.
        hint: &'static str,
    },
    /// The file has no bytes.
    #[error("{} is empty, and no capture", .0.display())]
    Empty(PathBuf),
    /// Another program's MCAP file.
    #[error("{} is {what}, no capture of slamd: it has no {RECEIVED_TOPIC}{hint}", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// What it is instead.
        what: String,
        /// What to do.
        hint: &'static str,
    },
    /// A capture without its description.
    #[error(
        "{}: its metadata record `slamd` is missing, and with it the robot's configuration: the capture is damaged, or rewritten by another program; \
         use the original, or keep the metadata (`mcap filter --include-metadata`)",
        .0.display()
    )]
    Undescribed(PathBuf),
    /// A record is earlier than the one before it.
    #[error("{}: time runs back from {before_s:.6} s to {at_s:.6} s", path.display())]
    TimeRunsBack {
        /// The capture.
        path: PathBuf,
        /// The earlier record's time, seconds.
        before_s: f64,
        /// The later record's time, seconds.
        at_s: f64,
    },
    /// The chunks are compressed.
    #[error(
        "{}: its chunks are compressed with `{compression}`: rewrite it with `mcap compress --compression none`",
        path.display()
    )]
    Compressed {
        /// The capture.
        path: PathBuf,
        /// The compression's name.
        compression: String,
    },
    /// A message on `/truth/pose` that is not a pose.
    #[error("{}: the pose on {TRUTH_TOPIC} at {at_s:.6} s cannot be read: {reason}", path.display())]
    Truth {
        /// The capture.
        path: PathBuf,
        /// The record's time, seconds.
        at_s: f64,
        /// The reason.
        reason: String,
    },
}

const METADATA_NAME: &str = "slamd";
/// How a capture names the program that wrote it.
const LIBRARY: &str = "slamd ";
const FAULT_SEPARATOR: char = ',';
/// The key of the description's own checksum: MCAP has none for metadata. Older captures have none, either.
const CHECKSUM_KEY: &str = "crc32";

impl CaptureInfo {
    fn to_metadata(&self) -> mcap::records::Metadata {
        let mut metadata = BTreeMap::from([
            ("slamd_version".into(), self.slamd_version.clone()),
            ("protocol_version".into(), self.protocol_version.clone()),
            ("config_toml".into(), self.config_toml.clone()),
            ("notes".into(), self.notes.clone()),
        ]);
        if let Some(us) = self.unix_zero_us {
            metadata.insert("unix_zero_us".into(), us.to_string());
        }
        if let Some(faults) = &self.faults {
            metadata.insert("faults".into(), faults.join(&FAULT_SEPARATOR.to_string()));
        }
        metadata.insert(CHECKSUM_KEY.into(), checksum(&metadata));
        mcap::records::Metadata { name: METADATA_NAME.into(), metadata }
    }

    /// Reads a description; none if its checksum is wrong.
    fn from_sound_metadata(mut metadata: BTreeMap<String, String>) -> Option<Self> {
        let saved = metadata.remove(CHECKSUM_KEY);
        saved.is_none_or(|saved| saved == checksum(&metadata)).then(|| Self::from_metadata(metadata))
    }

    /// The length of a metadata record's content, bytes: each text, and the list of them, behind four bytes of length.
    fn length_of(metadata: &mcap::records::Metadata) -> usize {
        let texts = metadata.metadata.iter().map(|(key, value)| 4 + key.len() + 4 + value.len());
        4 + metadata.name.len() + 4 + texts.sum::<usize>()
    }

    fn from_metadata(mut metadata: BTreeMap<String, String>) -> Self {
        let mut take = |key: &str| metadata.remove(key);
        Self {
            slamd_version: take("slamd_version").unwrap_or_default(),
            protocol_version: take("protocol_version").unwrap_or_default(),
            config_toml: take("config_toml").unwrap_or_default(),
            unix_zero_us: take("unix_zero_us").and_then(|us| us.parse().ok()),
            notes: take("notes").unwrap_or_default(),
            faults: take("faults")
                .map(|list| list.split(FAULT_SEPARATOR).filter(|fault| !fault.is_empty()).map(Into::into).collect()),
        }
    }
}

fn checksum(metadata: &BTreeMap<String, String>) -> String {
    let mut digest = reader::CRC.digest();
    for text in metadata.iter().flat_map(|(key, value)| [key, value]) {
        digest.update(&(text.len() as u64).to_le_bytes());
        digest.update(text.as_bytes());
    }
    format!("{:08x}", digest.finalize())
}

/// The content of a message on `/truth/pose`.
#[derive(serde::Serialize, serde::Deserialize)]
struct TruthMessage {
    x_m: f64,
    y_m: f64,
    theta_rad: f64,
}

#[cfg(test)]
mod tests;
