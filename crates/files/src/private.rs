//! Files and folders that only their owner may read, because the map of a home and the robot's path
//! in it are private.

use std::fs::{DirBuilder, File, OpenOptions, Permissions};
use std::io;
use std::os::unix::fs::{DirBuilderExt as _, OpenOptionsExt as _, PermissionsExt as _};
use std::path::Path;

const FILE: u32 = 0o600;
const FOLDER: u32 = 0o700;

/// Creates a file or empties the existing one, and removes the access of others.
///
/// # Errors
/// When it cannot be created.
pub fn create_file(path: &Path) -> io::Result<File> {
    let file = OpenOptions::new().write(true).create(true).truncate(true).mode(FILE).open(path)?;
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
    let mode = std::fs::metadata(path).map_err(system)?.permissions().mode() & 0o777;
    if mode & 0o077 != 0 {
        return Err(format!("others may use it (mode {mode:o}): `chmod 600` keeps it to its owner"));
    }
    std::fs::read_to_string(path).map_err(system)
}

/// Removes the access of others, because an existing file keeps its mode when it is opened. Pipes and
/// devices keep theirs.
fn close_to_others(file: &File) -> io::Result<()> {
    let metadata = file.metadata()?;
    if metadata.is_file() && metadata.permissions().mode() & 0o077 != 0 {
        file.set_permissions(Permissions::from_mode(FILE))?;
    }
    Ok(())
}
