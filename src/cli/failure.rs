//! Why a command failed, with an exit code from sysexits.h.

use crate::daemon::DaemonError;
use crate::source::replay::ReplayError;
use slamd_capture::CaptureError;
use slamd_publish::WriteError;

/// The kinds of failure, numbered as in sysexits.h.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    /// The command line is wrong.
    Usage = 64,
    /// A file has the wrong content.
    Data = 65,
    /// A file cannot be read.
    NoInput = 66,
    /// A port cannot be opened.
    Unavailable = 69,
    /// A file cannot be created.
    CantCreate = 73,
    /// Reading or writing failed.
    Io = 74,
    /// The session is over before anything was mapped.
    NothingMapped = 75,
    /// The configuration is wrong.
    Config = 78,
}

/// A failed command.
#[derive(Debug, thiserror::Error)]
#[error("{text}")]
pub struct Failure {
    /// The kind, which is the exit code.
    pub kind: Kind,
    text: String,
}

impl Failure {
    /// A failure with its message.
    pub fn new(kind: Kind, text: impl Into<String>) -> Self {
        Self { kind, text: in_words(text.into()) }
    }

    /// A capture that could not be created.
    pub(super) fn creating(error: CaptureError) -> Self {
        Self::new(Kind::CantCreate, format!("{error}; name a file that can be written"))
    }
}

/// One result of several. All failures but the last are logged; the last is the program's last line, with the kind of the first.
///
/// # Errors
/// When one of them is a failure.
pub(super) fn together(results: impl IntoIterator<Item = Result<(), Failure>>) -> Result<(), Failure> {
    let mut failures: Vec<Failure> = results.into_iter().filter_map(Result::err).collect();
    let Some(last) = failures.pop() else { return Ok(()) };
    failures.iter().for_each(|failure| tracing::error!("{failure}"));
    Err(Failure { kind: failures.first().map_or(last.kind, |first| first.kind), ..last })
}

/// The system's errors in words.
fn in_words(text: String) -> String {
    const WORDS: &[(&str, &str)] = &[
        ("No such file or directory (os error 2)", "there is no such file or folder"),
        ("Permission denied (os error 13)", "you have no permission"),
        ("File exists (os error 17)", "it is a file, not a folder"),
        ("Not a directory (os error 20)", "it is a file, not a folder"),
        ("Is a directory (os error 21)", "it is a folder, not a file"),
        ("No space left on device (os error 28)", "the disk is full"),
        ("Read-only file system (os error 30)", "the disk is read-only"),
    ];
    WORDS.iter().fold(text, |text, (of_system, words)| text.replace(of_system, words))
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
            CaptureError::Empty(_) | CaptureError::Foreign { .. } | CaptureError::Undescribed(_) => {
                Self::new(Kind::Data, error.to_string())
            }
            _ => Self::new(Kind::Data, format!("{error}; slamd cannot read this capture")),
        }
    }
}

impl From<DaemonError> for Failure {
    fn from(error: DaemonError) -> Self {
        Self::new(Kind::Unavailable, error.to_string())
    }
}

impl From<ReplayError> for Failure {
    fn from(error: ReplayError) -> Self {
        match error {
            ReplayError::Capture(error) => error.into(),
            ReplayError::Publish(error) => error.into(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_failure_gives_the_code_and_the_last_the_line() {
        let failed = |kind, text: &str| Err(Failure::new(kind, text));
        assert!(together([Ok(()), Ok(())]).is_ok());
        let failure = together([failed(Kind::Io, "a"), Ok(()), failed(Kind::CantCreate, "b")]).unwrap_err();
        assert_eq!((failure.kind, failure.to_string()), (Kind::Io, "b".into()));
        assert_eq!(together([Ok(()), failed(Kind::NothingMapped, "c")]).unwrap_err().kind, Kind::NothingMapped);
    }
}
