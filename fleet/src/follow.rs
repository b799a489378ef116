//! Reads a capture that is still being written. At the file's end the reader waits for more.

use crate::clock::wait;
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

/// Control of a [`Follow`] reader from other threads.
#[derive(Clone, Debug, Default)]
pub struct Grip {
    is_over: Arc<AtomicBool>,
    read: Arc<AtomicU64>,
}

impl Grip {
    /// Declares the file complete: the reader ends at the file's end.
    pub fn end(&self) {
        self.is_over.store(true, Ordering::Release);
    }

    /// True after [`Grip::end`].
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.is_over.load(Ordering::Acquire)
    }

    /// Number of bytes read.
    #[must_use]
    pub fn read(&self) -> u64 {
        self.read.load(Ordering::Acquire)
    }
}

/// A reader of a growing file.
#[derive(Debug)]
pub struct Follow {
    file: File,
    grip: Grip,
}

/// Polling period for new bytes.
const LOOK: Duration = Duration::from_millis(20);

impl Follow {
    /// Follows a file from its beginning.
    ///
    /// # Errors
    /// When it cannot be opened.
    pub fn open(path: &Path, grip: Grip) -> io::Result<BufReader<Self>> {
        Ok(BufReader::new(Self { file: File::open(path)?, grip }))
    }
}

impl Read for Follow {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            // Test before reading, so that bytes written before the end was declared are still read.
            let is_over = self.grip.is_over();
            let count = self.file.read(buffer)?;
            self.grip.read.fetch_add(count as u64, Ordering::AcqRel);
            if count > 0 || is_over || buffer.is_empty() {
                return Ok(count);
            }
            wait(LOOK);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write as _;

    #[test]
    fn what_is_written_later_is_read_and_the_end_is_told() {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(b"begin").unwrap();
        let grip = Grip::default();
        let mut follow = Follow::open(file.path(), grip.clone()).unwrap();
        let writer = {
            let (mut handle, grip) = (file.reopen().unwrap(), grip.clone());
            std::thread::spawn(move || {
                wait(Duration::from_millis(60));
                io::Seek::seek(&mut handle, io::SeekFrom::End(0)).unwrap();
                handle.write_all(b" and end").unwrap();
                grip.end();
            })
        };
        let mut text = String::new();
        follow.read_to_string(&mut text).unwrap();
        writer.join().unwrap();
        assert_eq!((text.as_str(), grip.read()), ("begin and end", 13));
    }
}
