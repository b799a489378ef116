//! Reads files that a user names: regular ones only, up to a size, without waiting.

use std::fs::{File, FileType, OpenOptions};
use std::io::{self, ErrorKind, Read as _};
use std::os::unix::fs::{FileTypeExt as _, OpenOptionsExt as _};
use std::path::Path;

/// Opens a regular file. Opening never waits, as that of a pipe would that nobody writes.
///
/// # Errors
/// When it cannot be opened, or is a folder, a pipe, a socket or a device; the error says which.
pub fn open(path: &Path) -> io::Result<File> {
    let flags = rustix::fs::OFlags::NONBLOCK | rustix::fs::OFlags::NOCTTY;
    let opened = OpenOptions::new().read(true).custom_flags(flags.bits().cast_signed()).open(path);
    // A socket cannot be opened.
    let file = opened.map_err(|error| match std::fs::metadata(path) {
        Ok(metadata) if metadata.file_type().is_socket() => unfit("a socket"),
        _ => error,
    })?;
    let kind = file.metadata()?.file_type();
    match other_than_file(kind) {
        None => Ok(file),
        Some(_) if kind.is_dir() => Err(io::Error::from_raw_os_error(rustix::io::Errno::ISDIR.raw_os_error())),
        Some(what) => Err(unfit(what)),
    }
}

/// What it is, if it is no regular file. A link that leads nowhere is one.
pub(crate) fn other_than_file(kind: FileType) -> Option<&'static str> {
    match () {
        () if kind.is_file() || kind.is_symlink() => None,
        () if kind.is_dir() => Some("a folder"),
        () if kind.is_fifo() => Some("a pipe"),
        () if kind.is_socket() => Some("a socket"),
        () => Some("a device"),
    }
}

pub(crate) fn unfit(what: &str) -> io::Error {
    io::Error::new(ErrorKind::InvalidInput, format!("it is {what}, not a file"))
}

/// Reads a whole regular file of at most `most` bytes.
///
/// # Errors
/// As [`open`]; when the file is larger.
pub fn read(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    rest_of(open(path)?, most)
}

/// The same of an open file.
///
/// # Errors
/// When it is larger or cannot be read.
pub fn rest_of(file: File, most: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    // It may grow while it is read.
    if file.metadata()?.len() <= most {
        file.take(most.saturating_add(1)).read_to_end(&mut bytes)?;
        if bytes.len() as u64 <= most {
            return Ok(bytes);
        }
    }
    let limit = if most < 1 << 20 { format!("{} KiB", most >> 10) } else { format!("{} MiB", most >> 20) };
    Err(io::Error::new(ErrorKind::FileTooLarge, format!("it is larger than {limit}, and such a file is small")))
}

/// The same of a text.
///
/// # Errors
/// As [`read`]; [`ErrorKind::InvalidData`] when it is no UTF-8.
pub fn read_text(path: &Path, most: u64) -> io::Result<String> {
    text(read(path, most)?)
}

/// The text of these bytes.
///
/// # Errors
/// [`ErrorKind::InvalidData`] when they are no UTF-8.
pub fn text(bytes: Vec<u8>) -> io::Result<String> {
    String::from_utf8(bytes).map_err(|_| io::Error::new(ErrorKind::InvalidData, "it is no text in UTF-8"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::fs::{CWD, Mode};

    #[test]
    fn other_things_than_files_are_named_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        rustix::fs::mkfifoat(CWD, path("pipe"), Mode::RWXU).unwrap();
        let _socket = std::os::unix::net::UnixListener::bind(path("socket")).unwrap();
        let message = |path: &Path| read(path, 1 << 16).unwrap_err().to_string();
        assert_eq!(message(&path("pipe")), "it is a pipe, not a file");
        assert_eq!(message(&path("socket")), "it is a socket, not a file");
        assert_eq!(message(Path::new("/dev/zero")), "it is a device, not a file");
        assert_eq!(message(folder.path()), "Is a directory (os error 21)");
        assert_eq!(message(&path("none")), "No such file or directory (os error 2)");
    }

    #[test]
    fn a_file_is_read_up_to_its_limit_however_long_it_is() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        std::fs::write(&path, [b'x'; 1 << 10]).unwrap();
        assert_eq!(read_text(&path, 1 << 10).unwrap().len(), 1 << 10);
        assert!(read(&path, 1023).unwrap_err().to_string().starts_with("it is larger than 0 KiB"));
        // Ten gigabytes without a byte on the disk.
        File::create(&path).unwrap().set_len(10 << 30).unwrap();
        let error = read(&path, 64 << 10).unwrap_err();
        assert!(error.to_string().starts_with("it is larger than 64 KiB"), "{error}");
        std::fs::write(&path, [0xFF]).unwrap();
        assert_eq!(read_text(&path, 1).unwrap_err().kind(), ErrorKind::InvalidData);
    }
}
