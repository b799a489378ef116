//! A file that is complete or absent: it is written as `NAME.part` in the same folder and renamed at
//! the end.
//!
//! A temporary disk failure does not end the run: unwritten bytes stay in memory, up to a limit, and
//! are written with the bytes that follow. Only [`PartFile::finish`] reports an error.

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
    /// The system's error.
    pub source: io::Error,
}

/// A file being written. A killed run leaves `NAME.part`.
pub struct PartFile {
    path: PathBuf,
    part: PathBuf,
    file: File,
    pending: Vec<u8>,
    /// Number of pending bytes that triggers the next write.
    write_at: usize,
    /// The error that made the file incomplete for good.
    failure: Option<io::Error>,
    sha256: Sha256,
}

const BLOCK: usize = 8 << 10;
/// Limit of the pending bytes: an hour of poses.
const MAX_PENDING: usize = 4 << 20;

impl PartFile {
    /// Creates `path` with the suffix `.part`.
    ///
    /// # Errors
    /// When the file cannot be created.
    pub fn create(path: &Path) -> Result<Self, WriteError> {
        let mut part = path.as_os_str().to_owned();
        part.push(".part");
        let part = PathBuf::from(part);
        let file = private::create_file(&part).map_err(|source| WriteError { path: part.clone(), source })?;
        let (pending, write_at) = (Vec::with_capacity(BLOCK), BLOCK);
        Ok(Self { path: path.into(), part, file, pending, write_at, failure: None, sha256: Sha256::new() })
    }

    /// Appends bytes.
    pub fn append(&mut self, bytes: &[u8]) {
        self.sha256.update(bytes);
        if self.failure.is_some() {
            return;
        }
        self.pending.extend_from_slice(bytes);
        if self.pending.len() < self.write_at {
            return;
        }
        let was_working = self.write_at == BLOCK;
        match drain(&mut self.pending, &mut self.file) {
            Ok(()) if was_working => {}
            Ok(()) => {
                self.write_at = BLOCK;
                tracing::info!("{}: written again, and nothing is missing", self.part.display());
            }
            Err(error) if self.pending.len() > MAX_PENDING => {
                tracing::error!("{}: {error}; given up", self.part.display());
                (self.pending, self.failure) = (Vec::new(), Some(error));
            }
            Err(error) => {
                self.write_at = self.pending.len() + BLOCK;
                if was_working {
                    tracing::warn!("{}: {error}; it waits in memory, and mapping goes on", self.part.display());
                }
            }
        }
    }

    /// Gives the file its name and returns the SHA-256 of its content in hexadecimal.
    ///
    /// # Errors
    /// When a part of the content could not be written. The file then keeps the suffix `.part`.
    pub fn finish(mut self) -> Result<String, WriteError> {
        let written = match self.failure.take() {
            Some(failure) => Err(failure),
            None => drain(&mut self.pending, &mut self.file),
        };
        let named = written.and_then(|()| self.file.sync_all()).and_then(|()| fs::rename(&self.part, &self.path));
        named.map_err(|source| WriteError { path: self.path.clone(), source })?;
        Ok(self.sha256.finalize().iter().fold(String::new(), |mut hex, byte| {
            let _ = write!(hex, "{byte:02x}");
            hex
        }))
    }
}

/// Fails only after a part of the content is lost.
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

/// Writes as much of `pending` as the file accepts.
fn drain(pending: &mut Vec<u8>, file: &mut impl Write) -> io::Result<()> {
    while !pending.is_empty() {
        match file.write(pending) {
            Ok(0) => return Err(ErrorKind::WriteZero.into()),
            Ok(count) => drop(pending.drain(..count)),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

/// Writes a whole file, readable by its owner only, and returns its SHA-256 in hexadecimal.
///
/// # Errors
/// When it cannot be written. An old file of that name is then unchanged.
pub fn write_file(folder: &Path, name: &str, bytes: &[u8]) -> Result<String, WriteError> {
    let mut file = PartFile::create(&folder.join(name))?;
    file.sha256.update(bytes);
    file.pending.extend_from_slice(bytes);
    file.finish()
}
