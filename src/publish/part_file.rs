//! A file that appears whole or not at all: written as `NAME.part` in the same folder and renamed at the end.

use super::PublishError;
use sha2::{Digest, Sha256};
use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// A file being written. What a killed run leaves behind is `NAME.part`.
pub(super) struct PartFile {
    path: PathBuf,
    part: PathBuf,
    file: BufWriter<File>,
    sha256: Sha256,
}

impl PartFile {
    pub(super) fn create(folder: &Path, name: &str) -> Result<Self, PublishError> {
        let part = folder.join(format!("{name}.part"));
        let file = File::create(&part).map_err(|source| PublishError { path: part.clone(), source })?;
        Ok(Self { path: folder.join(name), part, file: BufWriter::new(file), sha256: Sha256::new() })
    }

    pub(super) fn write(&mut self, bytes: &[u8]) -> Result<(), PublishError> {
        self.sha256.update(bytes);
        self.file.write_all(bytes).map_err(|source| PublishError { path: self.part.clone(), source })
    }

    /// Gives the file its name and returns the SHA-256 of its content in hexadecimal.
    pub(super) fn finish(self) -> Result<String, PublishError> {
        let error = |source| PublishError { path: self.path.clone(), source };
        let file = self.file.into_inner().map_err(io::IntoInnerError::into_error).map_err(error)?;
        file.sync_all().map_err(error)?;
        fs::rename(&self.part, &self.path).map_err(error)?;
        Ok(self.sha256.finalize().iter().fold(String::new(), |mut hex, byte| {
            let _ = write!(hex, "{byte:02x}");
            hex
        }))
    }
}

/// Writes a whole file at once and returns its SHA-256.
pub(super) fn write_file(folder: &Path, name: &str, bytes: &[u8]) -> Result<String, PublishError> {
    let mut file = PartFile::create(folder, name)?;
    file.write(bytes)?;
    file.finish()
}
