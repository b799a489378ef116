//! A file that appears whole or not at all: written as `NAME.part` beside its place and renamed at the end.
//!
//! A disk that fails for a while does not end the run: what it does not take waits in memory, up to a bound, and is tried again with what
//! follows. Only [`PartFile::finish`] fails.

use crate::private;
use sha2::{Digest, Sha256};
use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};

/// A file that cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("{}: {source}", path.display())]
pub struct WriteError {
    /// The file.
    pub path: PathBuf,
    /// What the system says.
    pub source: io::Error,
}

/// A file being written. What a killed run leaves behind is `NAME.part`.
pub struct PartFile {
    path: PathBuf,
    part: PathBuf,
    file: File,
    waiting: Vec<u8>,
    /// The file is written when so many bytes wait.
    write_at: usize,
    /// Why something is missing in the file for ever.
    failure: Option<io::Error>,
    sha256: Sha256,
}

const BLOCK: usize = 8 << 10;
/// An hour of poses.
const MAX_WAITING: usize = 4 << 20;

impl PartFile {
    /// Begins the file that will be `path`.
    ///
    /// # Errors
    /// When it cannot be created.
    pub fn create(path: &Path) -> Result<Self, WriteError> {
        let mut part = path.as_os_str().to_owned();
        part.push(".part");
        let part = PathBuf::from(part);
        let file = private::create_file(&part).map_err(|source| WriteError { path: part.clone(), source })?;
        let (waiting, write_at) = (Vec::with_capacity(BLOCK), BLOCK);
        Ok(Self { path: path.into(), part, file, waiting, write_at, failure: None, sha256: Sha256::new() })
    }

    /// Adds to the file.
    pub fn append(&mut self, bytes: &[u8]) {
        self.sha256.update(bytes);
        if self.failure.is_some() {
            return;
        }
        self.waiting.extend_from_slice(bytes);
        if self.waiting.len() < self.write_at {
            return;
        }
        let was_well = self.write_at == BLOCK;
        match drain(&mut self.waiting, &mut self.file) {
            Ok(()) if was_well => {}
            Ok(()) => {
                self.write_at = BLOCK;
                tracing::info!("{}: written again, and nothing is missing", self.part.display());
            }
            Err(error) if self.waiting.len() > MAX_WAITING => {
                tracing::error!("{}: {error}; given up", self.part.display());
                (self.waiting, self.failure) = (Vec::new(), Some(error));
            }
            Err(error) => {
                self.write_at = self.waiting.len() + BLOCK;
                if was_well {
                    tracing::warn!("{}: {error}; it waits in memory, and mapping goes on", self.part.display());
                }
            }
        }
    }

    /// Gives the file its name and returns the SHA-256 of its content in hexadecimal.
    ///
    /// # Errors
    /// When something of it could not be written; then it has no name.
    pub fn finish(mut self) -> Result<String, WriteError> {
        let written = match self.failure.take() {
            Some(failure) => Err(failure),
            None => drain(&mut self.waiting, &mut self.file),
        };
        let named = written.and_then(|()| self.file.sync_all()).and_then(|()| fs::rename(&self.part, &self.path));
        named.map_err(|source| WriteError { path: self.path.clone(), source })?;
        Ok(self.sha256.finalize().iter().fold(String::new(), |mut hex, byte| {
            let _ = write!(hex, "{byte:02x}");
            hex
        }))
    }
}

/// Fails only once something is missing for ever.
impl Write for PartFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.append(bytes);
        match &self.failure {
            Some(failure) => Err(io::Error::new(failure.kind(), failure.to_string())),
            None => Ok(bytes.len()),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// As much of `waiting` as the file takes.
fn drain(waiting: &mut Vec<u8>, file: &mut impl Write) -> io::Result<()> {
    while !waiting.is_empty() {
        match file.write(waiting) {
            Ok(0) => return Err(ErrorKind::WriteZero.into()),
            Ok(count) => drop(waiting.drain(..count)),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

/// Writes a whole file at once, for its owner alone, and returns its SHA-256 in hexadecimal.
///
/// # Errors
/// When it cannot be written; the old file, if there was one, is then still there.
pub fn write_file(folder: &Path, name: &str, bytes: &[u8]) -> Result<String, WriteError> {
    let mut file = PartFile::create(&folder.join(name))?;
    file.sha256.update(bytes);
    file.waiting.extend_from_slice(bytes);
    file.finish()
}
