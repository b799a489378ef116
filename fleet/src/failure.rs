//! Why a command failed, and its exit code from sysexits.h: the same codes as slamd's.

use slamd_capture::CaptureError;
use slamd_files::WriteError;

/// The kinds of failure, numbered as in sysexits.h.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    /// The command line is wrong.
    Usage = 64,
    /// A file holds something else than it should.
    Data = 65,
    /// A file cannot be read.
    NoInput = 66,
    /// A port cannot be opened.
    Unavailable = 69,
    /// A file cannot be created.
    CantCreate = 73,
    /// Reading or writing failed.
    Io = 74,
    /// The configuration is wrong.
    Config = 78,
}

/// A failed command.
#[derive(Debug, thiserror::Error)]
#[error("{text}")]
pub struct Failure {
    /// Its kind.
    pub kind: Kind,
    text: String,
}

impl Failure {
    /// A failure of a kind, in words.
    pub fn new(kind: Kind, text: impl Into<String>) -> Self {
        Self { kind, text: text.into() }
    }
}

impl From<WriteError> for Failure {
    fn from(error: WriteError) -> Self {
        Self::new(Kind::CantCreate, format!("{error}; choose a folder that can be written with --out"))
    }
}

impl From<CaptureError> for Failure {
    fn from(error: CaptureError) -> Self {
        match &error {
            CaptureError::Io { source, .. } if source.kind() == std::io::ErrorKind::NotFound => {
                Self::new(Kind::NoInput, format!("{error}; name an existing capture"))
            }
            CaptureError::Io { .. } => Self::new(Kind::Io, error.to_string()),
            _ => Self::new(Kind::Data, format!("{error}; it is no capture that slamd can read")),
        }
    }
}
