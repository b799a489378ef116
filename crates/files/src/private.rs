//! Files and folders that only their owner may read: a map of a home, and how its inhabitants' robot moves in it, are nobody else's business.

use std::fs::{DirBuilder, File, OpenOptions, Permissions};
use std::io;
use std::os::unix::fs::{DirBuilderExt as _, OpenOptionsExt as _, PermissionsExt as _};
use std::path::Path;

const FILE: u32 = 0o600;
const FOLDER: u32 = 0o700;

/// Creates a file, or empties the one that is there, and takes it from everybody else.
///
/// # Errors
/// When it cannot be created.
pub fn create_file(path: &Path) -> io::Result<File> {
    let file = OpenOptions::new().write(true).create(true).truncate(true).mode(FILE).open(path)?;
    close_to_others(&file)?;
    Ok(file)
}

/// Creates a file where none is.
///
/// # Errors
/// When there is one, or it cannot be created.
pub fn create_new_file(path: &Path) -> io::Result<File> {
    OpenOptions::new().write(true).create_new(true).mode(FILE).open(path)
}

/// Creates a folder and those above it, where they are missing; one that is there stays as it is.
///
/// # Errors
/// When it cannot be created.
pub fn create_folder(path: &Path) -> io::Result<()> {
    DirBuilder::new().recursive(true).mode(FOLDER).create(path)
}

/// The first line of a [`secret`]: a password or a token.
///
/// # Errors
/// As [`secret`].
pub fn first_line(path: &Path) -> Result<String, String> {
    Ok(secret(path)?.lines().next().unwrap_or_default().to_owned())
}

/// The text of a file that nobody but its owner may read.
///
/// # Errors
/// Where it cannot be read, or others may read it, in words with what to do about it. The text is in none of them.
pub fn secret(path: &Path) -> Result<String, String> {
    let system = |error: io::Error| format!("{error}; name a file that holds the secret");
    let mode = std::fs::metadata(path).map_err(system)?.permissions().mode() & 0o777;
    if mode & 0o077 != 0 {
        return Err(format!("others may use it (mode {mode:o}): `chmod 600` keeps it to its owner"));
    }
    std::fs::read_to_string(path).map_err(system)
}

/// A file that was there before keeps its mode when it is opened. A pipe or a device is whose it is.
fn close_to_others(file: &File) -> io::Result<()> {
    let metadata = file.metadata()?;
    if metadata.is_file() && metadata.permissions().mode() & 0o077 != 0 {
        file.set_permissions(Permissions::from_mode(FILE))?;
    }
    Ok(())
}
