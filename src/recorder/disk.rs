//! The storage that the parts of a recording are written to.

use rustix::fs::{AtFlags, CWD, Mode, OFlags};
use slamd_files::private;
use std::fs::File;
use std::io::{self, ErrorKind, Write};
use std::os::fd::AsRawFd as _;
use std::os::unix::fs::{FileExt as _, MetadataExt as _};
use std::path::{Path, PathBuf};

/// Storage for the parts of a recording. Tests implement it with injected I/O errors.
pub trait Disk {
    /// A part's file. A failed write must have written nothing.
    type File: Write;

    /// Creates the file of a part; 1 is the first. It may get its name with its first bytes: then the first write fails with
    /// [`io::ErrorKind::AlreadyExists`] where another recording was faster.
    ///
    /// # Errors
    /// When it cannot be created, with [`io::ErrorKind::AlreadyExists`] where it exists: then it belongs to another recording.
    fn create(&mut self, part: u32) -> io::Result<Self::File>;

    /// Looks whether the file of a part still has its name.
    ///
    /// # Errors
    /// When the disk does not answer.
    fn presence(&mut self, part: u32, file: &Self::File) -> io::Result<Presence>;

    /// Deletes the file of a part.
    ///
    /// # Errors
    /// When it cannot be deleted.
    fn remove(&mut self, part: u32) -> io::Result<()>;

    /// Free bytes; none if unknown.
    fn free_bytes(&mut self) -> Option<u64>;

    /// The path of a part, for messages.
    fn path(&self, part: u32) -> PathBuf;
}

/// Where a file is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Presence {
    /// Under its name.
    There,
    /// Under another name.
    Renamed,
    /// Nowhere: what was written is lost.
    Removed,
}

/// Files with a common name in a folder of the file system.
#[derive(Clone, Debug)]
pub struct Folder {
    folder: PathBuf,
    stem: String,
    /// The first part's path, if the user named it.
    first: Option<PathBuf>,
}

impl Folder {
    /// A recording whose first part is `path`; further parts are `NAME-0002.mcap` and so on in the same folder. Where one of these
    /// files exists, the recording takes the next number.
    #[must_use]
    pub fn file(path: &Path) -> Self {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        Self { folder: path.parent().unwrap_or_else(|| Path::new("")).into(), stem, first: Some(path.into()) }
    }

    /// A recording in a folder, which is created if missing; its parts are `NAME-0001.mcap` and so on.
    ///
    /// # Errors
    /// When the folder cannot be created.
    pub fn numbered(folder: &Path, name: &str) -> io::Result<Self> {
        private::create_folder(folder)?;
        Ok(Self { folder: folder.into(), stem: name.into(), first: None })
    }
}

impl Disk for Folder {
    type File = PartFile;

    fn create(&mut self, part: u32) -> io::Result<PartFile> {
        let path = self.path(part);
        if std::fs::symlink_metadata(&path).is_ok() {
            return Err(ErrorKind::AlreadyExists.into());
        }
        if let Some(file) = unnamed_file(&self.folder) {
            return Ok(PartFile { file, written: 0, name: Some(path) });
        }
        Ok(PartFile { file: private::create_new_file(&path)?, written: 0, name: None })
    }

    fn presence(&mut self, part: u32, file: &PartFile) -> io::Result<Presence> {
        if file.name.is_some() {
            return Ok(Presence::There);
        }
        let ours = file.file.metadata()?;
        Ok(match std::fs::symlink_metadata(self.path(part)) {
            Ok(there) if (there.dev(), there.ino()) == (ours.dev(), ours.ino()) => Presence::There,
            Err(error) if error.kind() != ErrorKind::NotFound => return Err(error),
            _ if ours.nlink() == 0 => Presence::Removed,
            _ => Presence::Renamed,
        })
    }

    fn remove(&mut self, part: u32) -> io::Result<()> {
        let path = self.path(part);
        // What others have put in its place stays.
        if std::fs::symlink_metadata(&path)?.is_file() { std::fs::remove_file(path) } else { Ok(()) }
    }

    fn free_bytes(&mut self) -> Option<u64> {
        let folder = if self.folder.as_os_str().is_empty() { Path::new(".") } else { &self.folder };
        let system = rustix::fs::statvfs(folder).ok()?;
        Some(system.f_bavail.saturating_mul(system.f_frsize))
    }

    fn path(&self, part: u32) -> PathBuf {
        match &self.first {
            Some(first) if part == 1 => first.clone(),
            _ => self.folder.join(format!("{}-{part:04}.mcap", self.stem)),
        }
    }
}

/// A file that keeps its own write position, so that a repeated write overwrites what a failed one left.
#[derive(Debug)]
pub struct PartFile {
    file: File,
    written: u64,
    /// The name that the file gets with its first bytes, so that a kill leaves no empty file.
    name: Option<PathBuf>,
}

/// A new file without a name; none where the file system, or the missing `/proc`, does not permit that.
fn unnamed_file(folder: &Path) -> Option<File> {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let flags = OFlags::TMPFILE | OFlags::WRONLY | OFlags::CLOEXEC;
    let file = File::from(rustix::fs::open(folder, flags, Mode::RUSR | Mode::WUSR).ok()?);
    std::fs::symlink_metadata(own_path(&file)).is_ok().then_some(file)
}

fn own_path(file: &File) -> String {
    format!("/proc/self/fd/{}", file.as_raw_fd())
}

impl Write for PartFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = self.file.write_at(bytes, self.written)?;
        if count > 0
            && let Some(name) = &self.name
        {
            rustix::fs::linkat(CWD, own_path(&self.file), CWD, name, AtFlags::SYMLINK_FOLLOW)?;
            self.name = None;
        }
        self.written += count as u64;
        Ok(count)
    }

    /// Syncs the file to the disk.
    fn flush(&mut self) -> io::Result<()> {
        self.file.sync_all()
    }
}
