//! Whether a command may write a file: never onto one of its inputs, and onto an existing file only if it is told to.

use crate::existing::{existing, folder_of, is_being_written, is_read_only, is_stream};
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
    /// When another output has it, or it is a hyphen.
    pub fn claim(&mut self, path: &Path) -> Result<(), Refusal> {
        if path.as_os_str() == "-" {
            return Err(Refusal::Hyphen);
        }
        if fs::metadata(path).is_ok_and(|metadata| is_stream(&metadata) || metadata.is_dir()) {
            return Ok(());
        }
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
    /// When it is an input, another output or a folder; when it exists and `--force` was not given, or is read-only; when its folder
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
            // A pipe or a device holds nothing that could be lost.
            Some(metadata) if is_stream(&metadata) => true,
            Some(_) if is_being_written(path) => return Err(Refusal::InUse(path.into())),
            Some(metadata) if is_read_only(&metadata) => return Err(Refusal::ReadOnly(path.into())),
            Some(_) if self.force || may_be_replaced(path) => true,
            Some(_) => return Err(Refusal::Exists(path.into())),
        };
        self.outputs.push(Identity::of(path));
        Ok(Output { path: path.into(), replaces })
    }

    /// Checks only what can never be right: the file is an input, another output or a folder, or its folder cannot be written.
    ///
    /// # Errors
    /// As [`OutputGuard::output`], except for an existing file.
    pub fn check(&self, path: &Path) -> Result<(), Refusal> {
        if path.as_os_str() == "-" {
            return Err(Refusal::Hyphen);
        }
        let identity = Identity::of(path);
        let is_stream = fs::metadata(path).is_ok_and(|metadata| is_stream(&metadata));
        if self.inputs.contains(&identity) && !is_stream {
            return Err(Refusal::Input(path.into()));
        }
        if (self.outputs.contains(&identity) || self.is_of_series(path)) && !is_stream {
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
        if !is_stream {
            rustix::fs::access(folder, rustix::fs::Access::WRITE_OK).map_err(|errno| error(errno.into()))?;
        }
        Ok(())
    }

    /// Checks that files of these names in a folder are none of the command's inputs.
    ///
    /// # Errors
    /// Which is.
    pub fn check_folder(&self, folder: &Path, names: &[&str]) -> Result<(), Refusal> {
        let paths = names.iter().map(|name| folder.join(name));
        match paths.into_iter().find(|path| self.inputs.contains(&Identity::of(path))) {
            Some(path) => Err(Refusal::Input(path)),
            None => Ok(()),
        }
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::{PermissionsExt as _, symlink};

    struct Folder(tempfile::TempDir);

    impl Folder {
        fn new() -> Self {
            let folder = tempfile::tempdir().unwrap();
            fs::write(folder.path().join("drive.csv"), "input").unwrap();
            fs::write(folder.path().join("old.mcap"), "old").unwrap();
            Self(folder)
        }

        fn path(&self, name: &str) -> PathBuf {
            self.0.path().join(name)
        }

        fn guard(&self, force: bool) -> OutputGuard {
            OutputGuard::new(force).reads(&self.path("drive.csv"))
        }

        fn text(&self, name: &str) -> String {
            fs::read_to_string(self.path(name)).unwrap()
        }
    }

    #[test]
    fn an_input_is_never_written_whatever_it_is_called() {
        let folder = Folder::new();
        symlink("drive.csv", folder.path("link")).unwrap();
        fs::hard_link(folder.path("drive.csv"), folder.path("hard")).unwrap();
        fs::create_dir(folder.path("sub")).unwrap();
        for name in ["drive.csv", "link", "hard", "sub/../drive.csv", "./drive.csv"] {
            for force in [false, true] {
                let refusal = folder.guard(force).output(&folder.path(name)).unwrap_err();
                assert!(refusal.is_usage() && refusal.to_string().contains("would be written over"), "{refusal}");
            }
        }
        let refusal = folder.guard(true).check_folder(folder.0.path(), &["map.png", "drive.csv"]).unwrap_err();
        assert!(matches!(refusal, Refusal::Input(_)));
    }

    #[test]
    fn an_existing_file_is_kept_unless_forced() {
        let folder = Folder::new();
        let old = folder.path("old.mcap");
        assert!(matches!(folder.guard(false).output(&old), Err(Refusal::Exists(_))));
        symlink("nowhere", folder.path("dangling")).unwrap();
        assert!(matches!(folder.guard(false).output(&folder.path("dangling")), Err(Refusal::Exists(_))));
        let own = folder.guard(false).output_replacing(&old, |path| path.ends_with("old.mcap"));
        own.unwrap().write(b"own").unwrap();
        assert_eq!(folder.text("old.mcap"), "own");
        folder.guard(true).output(&old).unwrap().write(b"forced").unwrap();
        assert_eq!(folder.text("old.mcap"), "forced");
        fs::set_permissions(&old, fs::Permissions::from_mode(0o444)).unwrap();
        assert!(matches!(folder.guard(true).output(&old), Err(Refusal::ReadOnly(_))));
    }

    #[test]
    fn folders_missing_folders_and_second_uses_are_named() {
        let folder = Folder::new();
        fs::create_dir(folder.path("dir")).unwrap();
        let mut guard = folder.guard(true);
        for name in ["dir", "new/"] {
            assert!(matches!(guard.output(&folder.path(name)), Err(Refusal::Folder(_))), "{name}");
        }
        let missing = guard.output(&folder.path("nowhere/x")).unwrap_err();
        assert!(!missing.is_usage() && missing.to_string().contains("nowhere/x: No such file"), "{missing}");
        assert!(guard.output(&folder.path("old.mcap/x")).unwrap_err().to_string().contains("Not a directory"));
        let mut coming = folder.guard(false).fills(&folder.path("a/out"), &["map.png"]);
        coming.output(&folder.path("a/home.session")).unwrap();
        assert!(coming.output(&folder.path("b/home.session")).is_err());
        guard.output(&folder.path("new")).unwrap();
        assert!(matches!(guard.output(&folder.path("dir/../new")), Err(Refusal::Twice(_))));
        guard.output(Path::new("/dev/null")).unwrap().write(b"gone").unwrap();
        assert!(guard.output(Path::new("/dev/null")).is_ok(), "a device may be used twice");
    }

    #[test]
    fn a_claimed_name_is_no_other_outputs() {
        let folder = Folder::new();
        let mut guard = folder.guard(true).fills(&folder.path("a/out"), &["map.png"]);
        for name in ["old.mcap", "a/out/drive.mcap", "drive.csv"] {
            guard.claim(&folder.path(name)).unwrap();
            assert!(matches!(guard.claim(&folder.path(name)), Err(Refusal::Twice(_))), "{name}");
        }
        for name in ["./old.mcap", "a/out/map.png", "a/./out/map.png"] {
            assert!(matches!(guard.output(&folder.path(name)), Err(Refusal::Twice(_))), "{name}");
        }
        guard.output(&folder.path("a/out/other.session")).unwrap();
        (0..2).for_each(|_| guard.claim(Path::new("/dev/null")).unwrap());
    }

    #[test]
    fn numbered_files_are_no_other_outputs() {
        let folder = Folder::new();
        let mut guard = folder.guard(true);
        guard.claim_series(folder.0.path(), ["drive-".into(), ".mcap".into()]);
        let mut is_taken = |name: &str| matches!(guard.output(&folder.path(name)), Err(Refusal::Twice(_)));
        assert!(["drive-0002.mcap", "./drive-0003.mcap", "drive-10-0004.mcap"].into_iter().all(&mut is_taken));
        assert!(!["drive-2.session", "drive-a.mcap", "my-drive-0002.mcap"].into_iter().any(is_taken));
    }

    #[test]
    fn a_file_that_appears_meanwhile_is_kept() {
        let folder = Folder::new();
        let mut file = folder.guard(false).output(&folder.path("new")).unwrap().begin().unwrap();
        file.append(b"ours");
        fs::write(folder.path("new"), "theirs").unwrap();
        let error = file.finish().unwrap_err();
        assert!(error.to_string().ends_with("new: File exists (os error 17)"), "{error}");
        assert_eq!(folder.text("new"), "theirs");
        assert_eq!(fs::read_dir(folder.0.path()).unwrap().count(), 3, "no half file is left");
    }
}
