//! Writes the capture of a live session in a thread of its own: the pipeline never waits for a disk.

use crate::capture::{CaptureError, CaptureInfo, CaptureWriter, FLUSH_PERIOD};
use crate::time::Timestamp;
use bytes::Bytes;
use std::path::Path;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::JoinHandle;

/// What is recorded.
enum Chunk {
    Received(Timestamp, Bytes),
    Sent(Timestamp, Bytes),
}

/// A recording under way.
pub struct Recorder {
    queue: SyncSender<Chunk>,
    thread: JoinHandle<Result<(), CaptureError>>,
    dropped: u64,
}

/// Chunks that may wait for the disk: minutes of them.
const QUEUE: usize = 65_536;

impl Recorder {
    /// Begins a capture.
    ///
    /// # Errors
    /// When the file cannot be created.
    pub fn begin(path: &Path, info: &CaptureInfo) -> Result<Self, CaptureError> {
        let capture = CaptureWriter::create(path, info)?;
        let (queue, chunks) = sync_channel(QUEUE);
        let thread = std::thread::spawn(move || write(capture, &chunks));
        Ok(Self { queue, thread, dropped: 0 })
    }

    /// Records what was read.
    pub fn received(&mut self, at: Timestamp, bytes: Bytes) {
        self.queue(Chunk::Received(at, bytes));
    }

    /// Records what was written.
    pub fn sent(&mut self, at: Timestamp, bytes: Bytes) {
        self.queue(Chunk::Sent(at, bytes));
    }

    /// Writes what waits and closes the file; the number of chunks that found no place in the queue.
    ///
    /// # Errors
    /// When the file could not be written.
    ///
    /// # Panics
    /// When the recording thread has.
    pub fn finish(self) -> Result<u64, CaptureError> {
        drop(self.queue);
        self.thread.join().expect("the recorder does not panic")?;
        Ok(self.dropped)
    }

    fn queue(&mut self, chunk: Chunk) {
        if self.queue.try_send(chunk).is_err() {
            if self.dropped == 0 {
                tracing::error!("the recording has a gap: the disk is full or too slow; mapping goes on");
            }
            self.dropped += 1;
        }
    }
}

fn write(mut capture: CaptureWriter, chunks: &Receiver<Chunk>) -> Result<(), CaptureError> {
    loop {
        match chunks.recv_timeout(FLUSH_PERIOD) {
            Ok(Chunk::Received(at, bytes)) => capture.received(at, &bytes)?,
            Ok(Chunk::Sent(at, bytes)) => capture.sent(at, &bytes)?,
            // Nothing came for a whole period: whatever waits is due.
            Err(RecvTimeoutError::Timeout) => capture.flush_if_due(Timestamp::from_us(u64::MAX))?,
            Err(RecvTimeoutError::Disconnected) => return capture.finish(),
        }
    }
}
