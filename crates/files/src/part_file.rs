//! A file that is complete or absent: it is written under a temporary name in the same folder and renamed at the end.
//!
//! A temporary disk failure does not end the run: unwritten bytes stay in memory, up to a limit, and
//! are written with the bytes that follow. Only [`PartFile::finish`] reports an error.

use crate::existing::{folder_of, is_stream, mark_as_written};
use crate::guard::Output;
use crate::private;
use sha2::{Digest, Sha256};
use std::fmt::Write as _;
use std::fs::{self, File};
use std::hash::{BuildHasher as _, Hasher as _, RandomState};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};
use tempfile::TempPath;

/// A file that cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("{}: {source}", path.display())]
pub struct WriteError {
    /// The file.
    pub path: PathBuf,
    /// The system's error.
    pub source: io::Error,
}

/// A file being written. If it is dropped, nothing is left; a killed run may leave `.NAME.XXXXXX.part`.
pub struct PartFile {
    path: PathBuf,
    file: File,
    /// The temporary name; none once the file has its own.
    temporary: Option<TempPath>,
    /// True if the file may take the place of another.
    replaces: bool,
    is_stream: bool,
    pending: Vec<u8>,
    /// Number of pending bytes that triggers the next write.
    write_at: usize,
    /// The error that made the file incomplete for good.
    failure: Option<io::Error>,
    sha256: Sha256,
}

/// A file with all its content on the disk, under a temporary name.
pub struct CompleteFile {
    path: PathBuf,
    temporary: Option<TempPath>,
    replaces: bool,
    sha256: String,
}

const BLOCK: usize = 8 << 10;
/// Limit of the pending bytes: an hour of poses.
const MAX_PENDING: usize = 4 << 20;
/// The end of temporary names.
const SUFFIX: &str = ".part";
const MAX_ATTEMPTS: u32 = 100;

impl PartFile {
    /// Begins a file in a folder that is slamd's own: it takes the place of an older file.
    ///
    /// # Errors
    /// When the file cannot be created.
    pub fn create(path: &Path) -> Result<Self, WriteError> {
        Self::open(path, true)
    }

    /// Begins a file that an [`OutputGuard`](crate::OutputGuard) has allowed.
    ///
    /// # Errors
    /// When the file cannot be created.
    pub fn begin(output: Output) -> Result<Self, WriteError> {
        Self::open(output.path(), output.replaces())
    }

    fn open(path: &Path, replaces: bool) -> Result<Self, WriteError> {
        let is_stream = fs::metadata(path).is_ok_and(|metadata| is_stream(&metadata));
        let opened = if is_stream {
            private::open_stream(path).map(|file| (file, None))
        } else {
            temporary(path).inspect(|(file, _)| mark_as_written(file)).map(|(file, path)| (file, Some(path)))
        };
        let (file, temporary) = opened.map_err(|source| WriteError { path: path.into(), source })?;
        let (pending, write_at) = (Vec::with_capacity(BLOCK), BLOCK);
        let sha256 = Sha256::new();
        Ok(Self { path: path.into(), file, temporary, replaces, is_stream, pending, write_at, failure: None, sha256 })
    }

    /// Appends bytes.
    pub fn append(&mut self, bytes: &[u8]) {
        self.sha256.update(bytes);
        if self.failure.is_some() {
            return;
        }
        self.pending.extend_from_slice(bytes);
        if self.pending.len() >= self.write_at {
            self.drain();
        }
    }

    /// Writes what is pending; what the disk refuses stays pending.
    fn drain(&mut self) {
        let was_working = self.write_at == BLOCK;
        match drain(&mut self.pending, &mut self.file) {
            Ok(()) if was_working => {}
            Ok(()) => {
                self.write_at = BLOCK;
                tracing::info!("{}: written again, and nothing is missing", self.path.display());
            }
            Err(error) if self.pending.len() > MAX_PENDING => {
                tracing::error!("{}: {error}; given up", self.path.display());
                (self.pending, self.failure) = (Vec::new(), Some(error));
            }
            Err(error) => {
                self.write_at = self.pending.len() + BLOCK;
                if was_working {
                    tracing::warn!("{}: {error}; it waits in memory", self.path.display());
                }
            }
        }
    }

    /// Gives the file its name before it is complete, so that a power cut leaves what was written so far. It grows from then on.
    /// Returns a handle for [`File::sync_data`], which may block.
    ///
    /// # Errors
    /// When the file cannot be renamed.
    pub fn publish(&mut self) -> Result<File, WriteError> {
        if self.failure.is_none() && !self.pending.is_empty() {
            self.drain();
        }
        let error = |source| WriteError { path: self.path.clone(), source };
        if let Some(temporary) = self.temporary.take() {
            name(temporary, &self.path, self.replaces).map_err(error)?;
        }
        self.file.try_clone().map_err(error)
    }

    /// Completes the content, still under its temporary name.
    ///
    /// # Errors
    /// When a part of the content could not be written. Then the file is removed.
    pub fn complete(mut self) -> Result<CompleteFile, WriteError> {
        let written = match self.failure.take() {
            Some(failure) => Err(failure),
            None => drain(&mut self.pending, &mut self.file),
        };
        let synced = written.and_then(|()| if self.is_stream { Ok(()) } else { self.file.sync_all() });
        synced.map_err(|source| WriteError { path: self.path.clone(), source })?;
        let sha256 = self.sha256.finalize().iter().fold(String::new(), |mut hex, byte| {
            let _ = write!(hex, "{byte:02x}");
            hex
        });
        Ok(CompleteFile { path: self.path, temporary: self.temporary, replaces: self.replaces, sha256 })
    }

    /// Gives the file its name and returns the SHA-256 of its content in hexadecimal.
    ///
    /// # Errors
    /// When a part of the content could not be written, or a file of that name has appeared that may not be replaced. Then nothing is
    /// left, and an older file is unchanged.
    pub fn finish(self) -> Result<String, WriteError> {
        self.complete()?.name()
    }
}

impl CompleteFile {
    /// SHA-256 of the content in hexadecimal.
    #[must_use]
    pub fn sha256(&self) -> &str {
        &self.sha256
    }

    /// Gives the file its name and returns its SHA-256 in hexadecimal.
    ///
    /// # Errors
    /// When the file cannot be renamed.
    pub fn name(self) -> Result<String, WriteError> {
        if let Some(temporary) = self.temporary {
            name(temporary, &self.path, self.replaces)
                .map_err(|source| WriteError { path: self.path.clone(), source })?;
        }
        Ok(self.sha256)
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

/// A new file, for its owner alone, with a name that nobody can foresee.
fn temporary(path: &Path) -> io::Result<(File, TempPath)> {
    let name = path.file_name().ok_or(ErrorKind::InvalidFilename)?.to_string_lossy();
    // Room for the rest of the name within the system's 255 bytes.
    let name: String = name.chars().take(50).collect();
    let mut attempts = 0;
    loop {
        let random = RandomState::new().build_hasher().finish();
        let part = folder_of(path).join(format!(".{name}.{random:016x}{SUFFIX}"));
        match private::create_new_file(&part) {
            Ok(file) => return Ok((file, TempPath::try_from_path(part)?)),
            Err(error) if error.kind() == ErrorKind::AlreadyExists && attempts < MAX_ATTEMPTS => attempts += 1,
            Err(error) => return Err(error),
        }
    }
}

fn name(temporary: TempPath, path: &Path, replaces: bool) -> io::Result<()> {
    let named = if replaces { temporary.persist(path) } else { temporary.persist_noclobber(path) };
    named.map_err(|error| error.error)?;
    // The folder is synced so that the name survives a power cut. Some file systems cannot do that.
    let _ = File::open(folder_of(path)).and_then(|folder| folder.sync_all());
    Ok(())
}

/// Removes what killed runs have left of files of these names. Nobody else may be writing into the folder.
pub(crate) fn remove_parts(folder: &Path, names: &[&str]) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let file = entry.file_name();
        let file = file.to_string_lossy();
        let is_part = |name: &&str| {
            let rest = file.strip_prefix('.').and_then(|file| file.strip_prefix(*name)).unwrap_or_default();
            rest.starts_with('.') && rest.ends_with(SUFFIX)
        };
        if names.iter().any(is_part) && entry.file_type().is_ok_and(|kind| kind.is_file()) {
            let _ = fs::remove_file(entry.path());
        }
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

/// Writes a whole file, readable by its owner only, into a folder that is slamd's own, and returns its SHA-256 in hexadecimal.
///
/// # Errors
/// When it cannot be written. An old file of that name is then unchanged.
pub fn write_file(folder: &Path, name: &str, bytes: &[u8]) -> Result<String, WriteError> {
    complete_file(folder, name, bytes)?.name()
}

/// The same, still under a temporary name.
///
/// # Errors
/// As [`write_file`].
pub fn complete_file(folder: &Path, name: &str, bytes: &[u8]) -> Result<CompleteFile, WriteError> {
    let mut file = PartFile::create(&folder.join(name))?;
    file.sha256.update(bytes);
    file.pending.extend_from_slice(bytes);
    file.complete()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dropped_file_leaves_nothing_and_a_published_one_what_it_has() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.tum");
        fs::write(&path, "old").unwrap();
        let mut file = PartFile::create(&path).unwrap();
        file.append(b"new");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
        drop(file);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        let mut file = PartFile::create(&path).unwrap();
        file.append(b"new 1\n");
        file.publish().unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "new 1\n");
        file.append(b"new 2\n");
        file.publish().unwrap();
        file.append(b"new 3\n");
        let sum = file.finish().unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "new 1\nnew 2\nnew 3\n");
        assert_eq!(sum, write_file(folder.path(), "b", b"new 1\nnew 2\nnew 3\n").unwrap());
    }

    #[test]
    fn a_name_that_others_have_guessed_is_not_followed() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("precious"), "precious").unwrap();
        std::os::unix::fs::symlink("precious", folder.path().join("x.part")).unwrap();
        std::os::unix::fs::symlink("precious", folder.path().join("x")).unwrap();
        write_file(folder.path(), "x", b"ours").unwrap();
        assert_eq!(fs::read_to_string(folder.path().join("precious")).unwrap(), "precious");
        assert_eq!(fs::read_to_string(folder.path().join("x")).unwrap(), "ours");
    }

    #[test]
    fn what_killed_runs_left_is_removed_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        for name in [".map.pgm.aB3dE9.part", ".mine.pgm.aB3dE9.part", "map.pgm.part", ".map.pgm", "map.pgm"] {
            fs::write(folder.path().join(name), "").unwrap();
        }
        remove_parts(folder.path(), &["map.pgm"]);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 4);
        assert!(!folder.path().join(".map.pgm.aB3dE9.part").exists());
    }

    #[test]
    fn errors_name_the_file_and_not_its_temporary_name() {
        let error = write_file(Path::new("/nowhere"), "map.pgm", b"").err().unwrap().to_string();
        assert_eq!(error, "/nowhere/map.pgm: No such file or directory (os error 2)");
    }

    #[test]
    fn a_file_that_is_being_written_is_kept_even_with_force() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("drive.mcap");
        let begin = || crate::OutputGuard::new(true).output(&path);
        let mut live = begin().unwrap().begin().unwrap();
        live.append(b"so far");
        live.publish().unwrap();
        let refusal = begin().unwrap_err();
        assert!(matches!(refusal, crate::Refusal::InUse(_)), "{refusal}");
        assert!(refusal.to_string().contains("is being written at this moment"), "{refusal}");
        live.finish().unwrap();
        assert!(begin().is_ok(), "it is complete");
    }
}
