//! The captures that a robot offers, and their pieces.

use crate::follow::Grip;
use crate::session::SessionId;
use crate::wire::{MAX_PIECE, Offer, Piece};
use sha2::{Digest as _, Sha256};
use slamd_capture::{CaptureError, CaptureReader};
use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// One offered capture.
#[derive(Clone, Debug)]
pub struct Book {
    /// The drive.
    pub session: SessionId,
    /// The file.
    pub path: PathBuf,
    /// The available part.
    pub extent: Extent,
}

/// The available part of a capture.
#[derive(Clone, Debug)]
pub enum Extent {
    /// The whole file, which still grows.
    Growing,
    /// The part played so far, as in a live drive.
    Played(Grip),
    /// The whole file, which does not grow any more.
    Whole,
}

/// The captures of a robot, oldest first.
#[derive(Debug, Default)]
pub struct Shelf {
    books: Mutex<Vec<Book>>,
    digest: Mutex<Option<Running>>,
}

/// The digest of a capture's beginning, kept because the next piece usually continues the last one.
#[derive(Debug)]
struct Running {
    session: SessionId,
    bytes: u64,
    sha256: Sha256,
}

/// The reason why a piece is not available.
#[derive(Debug, thiserror::Error)]
pub enum PieceError {
    /// The capture does not exist.
    #[error("there is no capture {0}")]
    Unknown(SessionId),
    /// The capture is shorter.
    #[error("the capture has {bytes} bytes, and byte {from} was asked for")]
    Beyond {
        /// Its length.
        bytes: u64,
        /// The requested offset.
        from: u64,
    },
    /// The file cannot be read.
    #[error(transparent)]
    Io(#[from] io::Error),
}

impl Book {
    /// A finished capture; `None` if it holds no record.
    ///
    /// # Errors
    /// When the file is not a capture.
    pub fn finished(path: &Path) -> Result<Option<Self>, CaptureError> {
        let mut capture = CaptureReader::open(path)?;
        let Some(first) = capture.next().transpose()? else { return Ok(None) };
        let session = SessionId::of(capture.info(), &first);
        Ok(Some(Self { session, path: path.into(), extent: Extent::Whole }))
    }

    fn offer(&self) -> io::Result<Offer> {
        let bytes = match &self.extent {
            Extent::Played(grip) => grip.read(),
            Extent::Growing | Extent::Whole => std::fs::metadata(&self.path)?.len(),
        };
        Ok(Offer { session: self.session, bytes, is_whole: matches!(self.extent, Extent::Whole) })
    }
}

impl Shelf {
    /// Offers another capture, or the same one with another extent.
    pub fn put(&self, book: Book) {
        let mut books = self.books.lock().unwrap_or_else(PoisonError::into_inner);
        books.retain(|known| known.session != book.session);
        books.push(book);
        books.sort_by_key(|book| book.session);
    }

    /// The available captures. A file that cannot be read is left out and logged.
    #[must_use]
    pub fn offers(&self) -> Vec<Offer> {
        let books = self.books.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let offer =
            |book: &Book| book.offer().inspect_err(|error| tracing::warn!("{}: {error}", book.path.display())).ok();
        books.iter().filter_map(offer).collect()
    }

    /// The piece of a capture from a byte on; empty at its end.
    ///
    /// # Errors
    /// When there is no such piece.
    pub fn piece(&self, session: SessionId, from: u64) -> Result<Piece, PieceError> {
        let books = self.books.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let book = books.iter().find(|book| book.session == session).ok_or(PieceError::Unknown(session))?;
        let offer = book.offer()?;
        if from > offer.bytes {
            return Err(PieceError::Beyond { bytes: offer.bytes, from });
        }
        let length = (offer.bytes - from).min(MAX_PIECE);
        let mut file = File::open(&book.path)?;
        let mut running = self.digest.lock().unwrap_or_else(PoisonError::into_inner);
        let before = running.take().filter(|running| running.session == session && running.bytes <= from);
        let mut digest = before.unwrap_or_else(|| Running { session, bytes: 0, sha256: Sha256::new() });
        file.seek(SeekFrom::Start(digest.bytes))?;
        digest.take(&mut file, from - digest.bytes)?;
        let bytes = digest.take(&mut file, length)?;
        let sha256 = digest.sha256.clone().finalize().into();
        *running = Some(digest);
        Ok(Piece { session, from, sha256, is_last: offer.is_whole && from + length == offer.bytes, bytes })
    }
}

impl Running {
    /// Adds the next `length` bytes and returns the last of them, one piece at most.
    fn take(&mut self, file: &mut File, length: u64) -> io::Result<Vec<u8>> {
        let mut left = length;
        loop {
            let mut bytes = Vec::new();
            let count = file.by_ref().take(left.min(MAX_PIECE)).read_to_end(&mut bytes)? as u64;
            if count < left.min(MAX_PIECE) {
                return Err(io::ErrorKind::UnexpectedEof.into());
            }
            self.sha256.update(&bytes);
            (self.bytes, left) = (self.bytes + count, left - count);
            if left == 0 {
                return Ok(bytes);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_from_anywhere_carry_the_digest_of_all_in_front_of_their_end() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mcap");
        let content: Vec<u8> = (0..700_000u32).map(|place| (place % 251) as u8).collect();
        std::fs::write(&path, &content).unwrap();
        let session = SessionId::default();
        let shelf = Shelf::default();
        shelf.put(Book { session, path: path.clone(), extent: Extent::Growing });
        let most = usize::try_from(MAX_PIECE).unwrap();
        for from in [0, most, 10, 600_000, 600_000, 700_000] {
            let piece = shelf.piece(session, from as u64).unwrap();
            let end = (from + most).min(content.len());
            assert_eq!(piece.bytes, content[from..end]);
            assert_eq!(piece.sha256, <[u8; 32]>::from(Sha256::digest(&content[..end])));
            assert!(!piece.is_last, "it may grow");
        }
        assert!(matches!(shelf.piece(session, 700_001), Err(PieceError::Beyond { .. })));
        shelf.put(Book { session, path, extent: Extent::Whole });
        assert!(shelf.piece(session, 600_000).unwrap().is_last && !shelf.piece(session, 0).unwrap().is_last);
        assert_eq!(shelf.offers(), [Offer { session, bytes: 700_000, is_whole: true }]);
    }
}
