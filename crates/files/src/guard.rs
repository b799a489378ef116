//! Whether a command may write a file: never onto one of its inputs, and onto an existing file only if it is told to.

use crate::existing::{existing, folder_of, is_being_written, is_read_only};
use crate::regular::other_than_file;
use crate::{PartFile, WriteError};
use std::fs;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};

/// Checks every output of one command. It knows the command's inputs, its earlier outputs, and whether the user gave `--force`.
#[derive(Clone, Debug, Default)]
pub struct OutputGuard {
    force: bool,
    inputs: Vec<Identity>,
    outputs: Vec<Identity>,
    /// Folders that the command creates before it writes.
    folders: Vec<PathBuf>,
    /// Files that the command numbers: their folder, and how their names begin and end.
    series: Vec<(PathBuf, [String; 2])>,
}

/// A file that a command may write.
#[derive(Clone, Debug)]
pub struct Output {
    path: PathBuf,
    replaces: bool,
}

/// Why a command may not write a file.
#[derive(Debug, thiserror::Error)]
pub enum Refusal {
    /// It is one of the command's inputs.
    #[error("{} would be written over; name another file", .0.display())]
    Input(PathBuf),
    /// Two outputs are the same file.
    #[error("{} would be written over: two outputs have this name; name another file", .0.display())]
    Twice(PathBuf),
    /// It is a folder.
    #[error("{} is a folder; name a file", .0.display())]
    Folder(PathBuf),
    /// It is a pipe, a socket or a device, or a folder among a run's results. Writing could wait for a reader without end, or never be full.
    #[error("{} is {what}, not a file; choose another place for the output", path.display())]
    NoFile {
        /// The output.
        path: PathBuf,
        /// What it is.
        what: &'static str,
    },
    /// A file of this name exists.
    #[error("{} exists and is kept; name another file, or --force replaces it", .0.display())]
    Exists(PathBuf),
    /// Another program is writing it.
    #[error("{} is being written at this moment, as by a recording, and is kept; wait for its end, or name another file", .0.display())]
    InUse(PathBuf),
    /// It is a hyphen, which other programs take for standard output.
    #[error("`-` is no file; name a file, or /dev/stdout for standard output into a pipe")]
    Hyphen,
    /// The file may not be written.
    #[error("{} is read-only and is kept; name another file", .0.display())]
    ReadOnly(PathBuf),
    /// The file cannot be created.
    #[error(transparent)]
    Write(#[from] WriteError),
}

impl Refusal {
    /// True if the command line names a file that is no output; otherwise the file cannot be created.
    #[must_use]
    pub const fn is_usage(&self) -> bool {
        matches!(self, Self::Input(_) | Self::Twice(_) | Self::Folder(_) | Self::Hyphen)
    }
}

/// A file, whatever it is called: its device and inode if it exists, otherwise its folder and name.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Identity {
    Inode(u64, u64),
    Name(PathBuf),
}

impl Identity {
    /// Follows links.
    fn of(path: &Path) -> Self {
        match fs::metadata(path) {
            Ok(metadata) => Self::Inode(metadata.dev(), metadata.ino()),
            Err(_) => Self::Name(resolved(folder_of(path)).join(path.file_name().unwrap_or_default())),
        }
    }
}

/// The absolute path of a folder, of which the last parts need not exist yet.
fn resolved(folder: &Path) -> PathBuf {
    folder.canonicalize().unwrap_or_else(|_| match (folder.parent(), folder.file_name()) {
        (Some(_), Some(name)) => resolved(folder_of(folder)).join(name),
        _ => folder.into(),
    })
}

impl OutputGuard {
    /// A guard; with `force` existing files may be replaced, inputs never.
    #[must_use]
    pub const fn new(force: bool) -> Self {
        Self { force, inputs: Vec::new(), outputs: Vec::new(), folders: Vec::new(), series: Vec::new() }
    }

    /// The command reads this file.
    #[must_use]
    pub fn reads(mut self, path: &Path) -> Self {
        self.inputs.push(Identity::of(path));
        self
    }

    /// The command reads these files.
    #[must_use]
    pub fn reads_all<'a>(self, paths: impl IntoIterator<Item = &'a Path>) -> Self {
        paths.into_iter().fold(self, Self::reads)
    }

    /// The command creates this folder, with those above it, before it writes a file; then it fills it with files of these names, which no
    /// other output may have.
    #[must_use]
    pub fn fills(mut self, folder: &Path, names: &[&str]) -> Self {
        self.folders.push(folder.into());
        self.outputs.extend(names.iter().map(|name| Identity::of(&folder.join(name))));
        self
    }

    /// The command writes a file of this name by other means, which decide whether it may. No other output may have the name.
    ///
    /// # Errors
    /// When another output has it, or it is a hyphen, a folder, a pipe, a socket or a device.
    pub fn claim(&mut self, path: &Path) -> Result<(), Refusal> {
        no_hyphen(path)?;
        no_other_than_file(path)?;
        let identity = Identity::of(path);
        if self.outputs.contains(&identity) || self.is_of_series(path) {
            return Err(Refusal::Twice(path.into()));
        }
        self.outputs.push(identity);
        Ok(())
    }

    /// The command creates files in this folder with digits and hyphens between these parts of the name. No other output may.
    pub fn claim_series(&mut self, folder: &Path, name: [String; 2]) {
        self.series.push((resolved(folder), name));
    }

    fn is_of_series(&self, path: &Path) -> bool {
        let (folder, name) = (resolved(folder_of(path)), path.file_name().unwrap_or_default().to_string_lossy());
        let is_number = |number: &str| number.bytes().all(|byte| byte.is_ascii_digit() || byte == b'-');
        self.series.iter().any(|(of, [begin, end])| {
            let number = name.strip_prefix(begin.as_str()).and_then(|rest| rest.strip_suffix(end.as_str()));
            *of == folder && number.is_some_and(is_number)
        })
    }

    /// True if existing files may be replaced.
    #[must_use]
    pub const fn is_forced(&self) -> bool {
        self.force
    }

    /// A file that the command creates.
    ///
    /// # Errors
    /// When it is an input, another output, a folder, a pipe, a socket or a device; when it exists and `--force` was not given, or is read-only; when its folder
    /// does not exist or cannot be written.
    pub fn output(&mut self, path: &Path) -> Result<Output, Refusal> {
        self.output_replacing(path, |_| false)
    }

    /// The same, but an existing file that `may_be_replaced` names as the command's own is replaced without `--force`.
    ///
    /// # Errors
    /// As [`OutputGuard::output`].
    pub fn output_replacing(
        &mut self,
        path: &Path,
        may_be_replaced: impl FnOnce(&Path) -> bool,
    ) -> Result<Output, Refusal> {
        self.check(path)?;
        let error = |source| WriteError { path: path.into(), source };
        let replaces = match existing(path).map_err(error)? {
            None => self.force,
            Some(_) if is_being_written(path) => return Err(Refusal::InUse(path.into())),
            Some(metadata) if is_read_only(&metadata) => return Err(Refusal::ReadOnly(path.into())),
            Some(_) if self.force || may_be_replaced(path) => true,
            Some(_) => return Err(Refusal::Exists(path.into())),
        };
        self.outputs.push(Identity::of(path));
        Ok(Output { path: path.into(), replaces })
    }

    /// Checks only what can never be right: the file is an input, another output, a folder, a pipe, a socket or a device, or its folder cannot
    /// be written.
    ///
    /// # Errors
    /// As [`OutputGuard::output`], except for an existing file.
    pub fn check(&self, path: &Path) -> Result<(), Refusal> {
        no_hyphen(path)?;
        if !path.is_dir() {
            no_other_than_file(path)?;
        }
        self.check_name(path)
    }

    /// The same of a socket to listen on, which may exist.
    ///
    /// # Errors
    /// As [`OutputGuard::check`], except for what exists.
    pub fn check_name(&self, path: &Path) -> Result<(), Refusal> {
        let identity = Identity::of(path);
        if self.inputs.contains(&identity) {
            return Err(Refusal::Input(path.into()));
        }
        if self.outputs.contains(&identity) || self.is_of_series(path) {
            return Err(Refusal::Twice(path.into()));
        }
        if path.is_dir() || path.as_os_str().as_encoded_bytes().ends_with(b"/") {
            return Err(Refusal::Folder(path.into()));
        }
        let error = |source| Refusal::Write(WriteError { path: path.into(), source });
        let folder = folder_of(path);
        if !folder.exists() && self.folders.iter().any(|created| created.starts_with(folder)) {
            return Ok(());
        }
        let metadata = fs::metadata(folder).map_err(error)?;
        if !metadata.is_dir() {
            return Err(error(rustix::io::Errno::NOTDIR.into()));
        }
        rustix::fs::access(folder, rustix::fs::Access::WRITE_OK).map_err(|errno| error(errno.into()))
    }

    /// Checks that what has these names in a folder are files, and none of the command's inputs.
    ///
    /// # Errors
    /// Which is not.
    pub fn check_folder(&self, folder: &Path, names: &[&str]) -> Result<(), Refusal> {
        names.iter().map(|name| folder.join(name)).try_for_each(|path| {
            no_other_than_file(&path)?;
            if self.inputs.contains(&Identity::of(&path)) { Err(Refusal::Input(path)) } else { Ok(()) }
        })
    }
}

impl Output {
    /// Where the file will be.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// True if it may take the place of an existing file.
    pub(crate) const fn replaces(&self) -> bool {
        self.replaces
    }

    /// Begins the file. Until it is finished, an existing file of this name is unchanged.
    ///
    /// # Errors
    /// When it cannot be created.
    pub fn begin(self) -> Result<PartFile, WriteError> {
        PartFile::begin(self)
    }

    /// Writes the whole file.
    ///
    /// # Errors
    /// When it cannot be written. An existing file is then unchanged.
    pub fn write(self, bytes: &[u8]) -> Result<(), WriteError> {
        let mut file = self.begin()?;
        file.append(bytes);
        file.finish().map(drop)
    }
}

/// A hyphen stands for standard output elsewhere; here it would become a file of that name.
fn no_hyphen(path: &Path) -> Result<(), Refusal> {
    if path.as_os_str() == "-" { Err(Refusal::Hyphen) } else { Ok(()) }
}

/// Refuses what exists and is no file. What cannot be examined is left to the command's own error.
fn no_other_than_file(path: &Path) -> Result<(), Refusal> {
    let Ok(Some(metadata)) = existing(path) else { return Ok(()) };
    other_than_file(metadata.file_type()).map_or(Ok(()), |what| Err(Refusal::NoFile { path: path.into(), what }))
}

#[cfg(test)]
mod tests;
