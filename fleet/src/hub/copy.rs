//! The hub's copy of a capture: it grows by pieces whose digest holds, and gets its name when it is whole.
//!
//! Only checked bytes are written, so what a kill leaves behind is the capture's beginning, and the next piece's digest covers that beginning too: a
//! copy that a broken disk has changed is noticed, and fetched anew.

use crate::session::SessionId;
use crate::wire::Piece;
use sha2::{Digest as _, Sha256};
use std::fs::{File, OpenOptions};
use std::io::{self, Read as _};
use std::os::unix::fs::{FileExt as _, OpenOptionsExt as _};
use std::path::{Path, PathBuf};

/// A copy that is not whole yet.
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

/// A piece that is not taken.
#[derive(Debug, thiserror::Error)]
pub enum CopyError {
    /// It does not go on where the copy ends.
    #[error("a piece from byte {from} was sent where byte {expected} was asked for")]
    Elsewhere {
        /// Where it begins.
        from: u64,
        /// Where the copy ends.
        expected: u64,
    },
    /// The piece or the copy is damaged.
    #[error("the copy or a piece of it is damaged: its digest does not hold")]
    Digest,
    /// The disk refuses.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
}

impl Files {
    /// Those of a session.
    #[must_use]
    pub fn new(folder: &Path, session: SessionId) -> Self {
        Self { folder: folder.into(), session }
    }

    /// The whole capture.
    #[must_use]
    pub fn capture(&self) -> PathBuf {
        self.folder.join(format!("{}.mcap", self.session))
    }

    /// The capture while it is not whole.
    #[must_use]
    pub fn part(&self) -> PathBuf {
        self.folder.join(format!("{}.mcap.part", self.session))
    }

    /// Which puts were heard.
    #[must_use]
    pub fn heard(&self) -> PathBuf {
        self.folder.join(format!("{}.heard", self.session))
    }

    /// The names of the files that are written when all is there: every pose, and the summary, which comes last.
    #[must_use]
    pub fn results(&self) -> [String; 2] {
        [format!("{}.poses.csv", self.session), format!("{}.json", self.session)]
    }

    /// True where the capture is whole and the summary is written.
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
    /// Goes on with what is there, or begins.
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

    /// Begins again from nothing, in another file: who reads the old one must be told.
    ///
    /// # Errors
    /// When that cannot be done.
    pub fn begin_again(self) -> Result<Self, CopyError> {
        std::fs::remove_file(self.files.part()).map_err(self.files.io())?;
        Self::open(self.files)
    }

    /// Bytes there are.
    #[must_use]
    pub const fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Takes the next piece.
    ///
    /// # Errors
    /// Where it is not the next one, or it and all in front of it are not what the robot has; nothing is written then.
    pub fn take(&mut self, piece: &Piece) -> Result<(), CopyError> {
        if piece.from != self.bytes {
            return Err(CopyError::Elsewhere { from: piece.from, expected: self.bytes });
        }
        let sha256 = self.sha256.clone().chain_update(&piece.bytes);
        if <[u8; 32]>::from(sha256.clone().finalize()) != piece.sha256 {
            return Err(CopyError::Digest);
        }
        // At a place of its own: what a failed write has left is written over.
        self.file.write_all_at(&piece.bytes, self.bytes).map_err(self.files.io())?;
        (self.bytes, self.sha256) = (self.bytes + piece.bytes.len() as u64, sha256);
        Ok(())
    }

    /// The copy is whole: it gets its name, once the disk has it.
    ///
    /// # Errors
    /// When the disk refuses.
    pub fn finish(&self) -> Result<(), CopyError> {
        let named = self.file.sync_all().and_then(|()| std::fs::rename(self.files.part(), self.files.capture()));
        named.and_then(|()| File::open(&self.files.folder)?.sync_all()).map_err(self.files.io())
    }
}

/// The length and the digest of what is left of a file.
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
    fn a_copy_grows_over_kills_and_repetitions_and_nothing_wrong_gets_in() {
        let folder = tempfile::tempdir().unwrap();
        let files = Files::new(folder.path(), SessionId::default());
        let mut copy = Copy::open(files.clone()).unwrap();
        copy.take(&piece(0, 7)).unwrap();
        assert!(matches!(copy.take(&piece(0, 7)), Err(CopyError::Elsewhere { .. })));
        let mut wrong = piece(7, 10);
        wrong.bytes[0] ^= 1;
        assert!(matches!(copy.take(&wrong), Err(CopyError::Digest)));
        // Killed and started again.
        let mut copy = Copy::open(files.clone()).unwrap();
        assert_eq!(copy.bytes(), 7);
        copy.take(&piece(7, 10)).unwrap();
        // The disk has lost a bit: the next piece tells.
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
