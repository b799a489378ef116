//! The hub's copy of a capture. It grows by verified pieces and is renamed when complete.
//!
//! Only verified bytes are written, so a kill leaves the capture's beginning. The next piece's digest
//! covers that beginning too, so a copy that a bad disk changed is detected and fetched again.

use crate::session::SessionId;
use crate::wire::Piece;
use sha2::{Digest as _, Sha256};
use std::fs::{File, OpenOptions};
use std::io::{self, Read as _};
use std::os::unix::fs::{FileExt as _, OpenOptionsExt as _};
use std::path::{Path, PathBuf};

/// An incomplete copy.
#[derive(Debug)]
pub struct Copy {
    file: File,
    files: Files,
    bytes: u64,
    sha256: Sha256,
}

/// The files of a session, in the folder of its robot.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Files {
    folder: PathBuf,
    session: SessionId,
}

/// A piece that is rejected.
#[derive(Debug, thiserror::Error)]
pub enum CopyError {
    /// The piece does not begin where the copy ends.
    #[error("a piece from byte {from} was sent where byte {expected} was asked for")]
    Elsewhere {
        /// Its first byte.
        from: u64,
        /// The copy's length.
        expected: u64,
    },
    /// The piece or the copy is damaged.
    #[error("the copy or a piece of it is damaged: its digest does not hold")]
    Digest,
    /// The disk fails.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
}

impl Files {
    /// The files of a session in `folder`.
    #[must_use]
    pub fn new(folder: &Path, session: SessionId) -> Self {
        Self { folder: folder.into(), session }
    }

    /// The complete capture.
    #[must_use]
    pub fn capture(&self) -> PathBuf {
        self.folder.join(format!("{}.mcap", self.session))
    }

    /// The incomplete capture.
    #[must_use]
    pub fn part(&self) -> PathBuf {
        self.folder.join(format!("{}.mcap.part", self.session))
    }

    /// The list of received puts.
    #[must_use]
    pub fn heard(&self) -> PathBuf {
        self.folder.join(format!("{}.heard", self.session))
    }

    /// The names of the files written at the end: all poses, then the summary.
    #[must_use]
    pub fn results(&self) -> [String; 2] {
        [format!("{}.poses.csv", self.session), format!("{}.json", self.session)]
    }

    /// True if the capture is complete and the summary is written.
    #[must_use]
    pub fn is_done(&self) -> bool {
        let [_, summary] = self.results();
        self.capture().exists() && self.folder.join(summary).exists()
    }

    /// The folder.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    fn io(&self) -> impl Fn(io::Error) -> CopyError + use<> {
        let path = self.part();
        move |source| CopyError::Io { path: path.clone(), source }
    }
}

impl Copy {
    /// Continues an existing copy, or begins a new one.
    ///
    /// # Errors
    /// When the file cannot be opened or read.
    pub fn open(files: Files) -> Result<Self, CopyError> {
        let mut options = OpenOptions::new();
        options.read(true).write(true).create(true).truncate(false).mode(0o600);
        let mut file = options.open(files.part()).map_err(files.io())?;
        let (bytes, sha256) = digest(&mut file).map_err(files.io())?;
        Ok(Self { file, files, bytes, sha256 })
    }

    /// Begins again with an empty file. Readers of the old file must be stopped.
    ///
    /// # Errors
    /// When the file cannot be removed or created.
    pub fn begin_again(self) -> Result<Self, CopyError> {
        std::fs::remove_file(self.files.part()).map_err(self.files.io())?;
        Self::open(self.files)
    }

    /// Length of the copy, bytes.
    #[must_use]
    pub const fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Appends the next piece.
    ///
    /// # Errors
    /// When it is not the next piece, or when it or the bytes before it differ from the robot's. Nothing
    /// is written then.
    pub fn take(&mut self, piece: &Piece) -> Result<(), CopyError> {
        if piece.from != self.bytes {
            return Err(CopyError::Elsewhere { from: piece.from, expected: self.bytes });
        }
        let sha256 = self.sha256.clone().chain_update(&piece.bytes);
        if <[u8; 32]>::from(sha256.clone().finalize()) != piece.sha256 {
            return Err(CopyError::Digest);
        }
        // Write at an explicit offset, which overwrites what a failed write has left.
        self.file.write_all_at(&piece.bytes, self.bytes).map_err(self.files.io())?;
        (self.bytes, self.sha256) = (self.bytes + piece.bytes.len() as u64, sha256);
        Ok(())
    }

    /// Renames the complete copy, after it is on disk.
    ///
    /// # Errors
    /// When the disk fails.
    pub fn finish(&self) -> Result<(), CopyError> {
        let named = self.file.sync_all().and_then(|()| std::fs::rename(self.files.part(), self.files.capture()));
        named.and_then(|()| File::open(&self.files.folder)?.sync_all()).map_err(self.files.io())
    }
}

/// The length and the digest of the rest of a file.
///
/// # Errors
/// When it cannot be read.
pub fn digest(file: &mut File) -> io::Result<(u64, Sha256)> {
    let (mut bytes, mut sha256, mut block) = (0, Sha256::new(), vec![0; 64 << 10]);
    loop {
        let count = file.read(&mut block)?;
        if count == 0 {
            return Ok((bytes, sha256));
        }
        sha256.update(&block[..count]);
        bytes += count as u64;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONTENT: &[u8] = b"a capture, byte for byte";

    fn piece(from: usize, to: usize) -> Piece {
        Piece {
            session: SessionId::default(),
            from: from as u64,
            sha256: Sha256::digest(&CONTENT[..to]).into(),
            is_last: to == CONTENT.len(),
            bytes: CONTENT[from..to].to_vec(),
        }
    }

    #[test]
    fn a_copy_grows_over_kills_and_repetitions_and_rejects_wrong_pieces() {
        let folder = tempfile::tempdir().unwrap();
        let files = Files::new(folder.path(), SessionId::default());
        let mut copy = Copy::open(files.clone()).unwrap();
        copy.take(&piece(0, 7)).unwrap();
        assert!(matches!(copy.take(&piece(0, 7)), Err(CopyError::Elsewhere { .. })));
        let mut wrong = piece(7, 10);
        wrong.bytes[0] ^= 1;
        assert!(matches!(copy.take(&wrong), Err(CopyError::Digest)));
        // After a kill and a restart.
        let mut copy = Copy::open(files.clone()).unwrap();
        assert_eq!(copy.bytes(), 7);
        copy.take(&piece(7, 10)).unwrap();
        // The disk has changed a bit: the next piece's digest detects it.
        std::fs::write(files.part(), b"a capt_re,").unwrap();
        let mut copy = Copy::open(files.clone()).unwrap();
        assert!(matches!(copy.take(&piece(10, CONTENT.len())), Err(CopyError::Digest)));
        let mut copy = copy.begin_again().unwrap();
        copy.take(&piece(0, CONTENT.len())).unwrap();
        copy.finish().unwrap();
        assert_eq!(std::fs::read(files.capture()).unwrap(), CONTENT);
        assert!(!files.part().exists() && !files.is_done());
    }
}
