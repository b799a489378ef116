//! Files and folders that only their owner may read, because the map of a home and the robot's path
//! in it are private.

use crate::regular;
use rustix::fs::{Access, OFlags};
use std::fs::{DirBuilder, File, OpenOptions, Permissions};
use std::io::{self, ErrorKind};
use std::os::unix::fs::{DirBuilderExt as _, MetadataExt as _, OpenOptionsExt as _, PermissionsExt as _};
use std::path::Path;

const FILE: u32 = 0o600;
const FOLDER: u32 = 0o700;
/// Largest file of a secret.
const MAX_SECRET_BYTES: u64 = 64 << 10;

/// Creates a file or empties the existing one, and removes the access of others. A file that is reached through a link, or has another name,
/// may be somebody else's and is kept.
///
/// # Errors
/// When it cannot be created, is no regular file or a link, or has a second name.
pub fn create_file(path: &Path) -> io::Result<File> {
    // A pipe that nobody reads is not waited for.
    let flags = (OFlags::NOFOLLOW | OFlags::NONBLOCK | OFlags::NOCTTY).bits().cast_signed();
    let file = OpenOptions::new().write(true).create(true).truncate(false).mode(FILE).custom_flags(flags).open(path)?;
    let metadata = file.metadata()?;
    if let Some(what) = regular::other_than_file(metadata.file_type()) {
        return Err(regular::unfit(what));
    }
    if metadata.nlink() > 1 {
        return Err(io::Error::new(ErrorKind::AlreadyExists, "the file has another name, too"));
    }
    file.set_len(0)?;
    close_to_others(&file)?;
    Ok(file)
}

/// Creates a new file.
///
/// # Errors
/// When it exists or cannot be created.
pub fn create_new_file(path: &Path) -> io::Result<File> {
    OpenOptions::new().write(true).create_new(true).mode(FILE).open(path)
}

/// Creates a folder and its missing parents. An existing folder keeps its mode.
///
/// # Errors
/// When it cannot be created.
pub fn create_folder(path: &Path) -> io::Result<()> {
    DirBuilder::new().recursive(true).mode(FOLDER).create(path)
}

/// Checks whether [`create_folder`] could create the folder, or files could be created in it if it exists. Creates nothing.
///
/// # Errors
/// When it or the folder above it is none or may not be written.
pub fn check_folder(path: &Path) -> io::Result<()> {
    let mut above = path.ancestors().map(|it| if it.as_os_str().is_empty() { Path::new(".") } else { it });
    let Some(there) = above.find(|it| it.symlink_metadata().is_ok()) else { return Ok(()) };
    if !std::fs::metadata(there)?.is_dir() {
        return Err(rustix::io::Errno::NOTDIR.into());
    }
    Ok(rustix::fs::access(there, Access::WRITE_OK | Access::EXEC_OK)?)
}

/// The first line of a [`secret`]: a password or a token.
///
/// # Errors
/// As [`secret`].
pub fn first_line(path: &Path) -> Result<String, String> {
    Ok(secret(path)?.lines().next().unwrap_or_default().to_owned())
}

/// The text of a file that only its owner may read.
///
/// # Errors
/// When the file cannot be read, or others may read it. The message says what to do and never
/// contains the file's text.
pub fn secret(path: &Path) -> Result<String, String> {
    let system = |error: io::Error| format!("{error}; name a file that holds the secret");
    let file = regular::open(path).map_err(system)?;
    let mode = file.metadata().map_err(system)?.permissions().mode() & 0o777;
    if mode & 0o077 != 0 {
        return Err(format!("others may use it (mode {mode:o}): `chmod 600` keeps it to its owner"));
    }
    regular::rest_of(file, MAX_SECRET_BYTES).and_then(regular::text).map_err(system)
}

/// Removes the access of others, because an existing file keeps its mode when it is opened.
fn close_to_others(file: &File) -> io::Result<()> {
    let metadata = file.metadata()?;
    if metadata.permissions().mode() & 0o077 != 0 {
        file.set_permissions(Permissions::from_mode(FILE))?;
    }
    Ok(())
}
