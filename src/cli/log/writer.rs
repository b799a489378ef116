//! Writes the log from a thread of its own, so that a reader that hangs (Ctrl-S on the terminal, a full pipe) blocks nothing else.
//!
//! tracing-appender does the same, but prints to standard output when its reader hangs, where slamd prints its summary.

use crate::log_counts::DROPPED;
use std::fs::File;
use std::io::{self, Write};
use std::os::fd::AsFd as _;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::time::Duration;
use tracing_subscriber::fmt::MakeWriter;

/// Length of the queue, lines.
const QUEUE: usize = 4_096;
/// Longest line, bytes; a longer one is cut.
const MAX_LINE_BYTES: usize = 16 << 10;
/// Longest time that the end of the program waits for the reader.
const PATIENCE: Duration = Duration::from_secs(2);

/// The log's end of the queue; a line that finds it full is counted and dropped.
#[derive(Clone, Debug)]
pub(super) struct LogWriter {
    queue: SyncSender<Entry>,
}

enum Entry {
    Line(Box<[u8]>),
    /// Answered when all lines before it are written.
    Flush(SyncSender<()>),
}

impl LogWriter {
    /// A log on standard error; none if the system gives no descriptor or no thread.
    pub(super) fn to_stderr() -> Option<Self> {
        // Without the lock of `io::stderr`, which a blocked write holds.
        let stderr = File::from(io::stderr().as_fd().try_clone_to_owned().ok()?);
        Self::to(stderr)
    }

    fn to(mut file: impl Write + Send + 'static) -> Option<Self> {
        let (queue, entries) = sync_channel(QUEUE);
        let thread = std::thread::Builder::new().name("log".into());
        thread.spawn(move || write(&mut file, &entries)).ok()?;
        Some(Self { queue })
    }

    /// Waits until everything is written, but not for a reader that hangs.
    pub(super) fn finish(&self) {
        let (sender, done) = sync_channel(1);
        let mut entry = Entry::Flush(sender);
        // A slow reader may have left the queue full.
        for _ in 0..20 {
            match self.queue.try_send(entry) {
                Ok(()) => {
                    let _ = done.recv_timeout(PATIENCE);
                    return;
                }
                Err(TrySendError::Full(back)) => entry = back,
                Err(TrySendError::Disconnected(_)) => return,
            }
            // Nobody answers: only the time passes.
            let _ = done.recv_timeout(PATIENCE / 20);
        }
    }
}

fn write(file: &mut impl Write, entries: &Receiver<Entry>) {
    for entry in entries {
        match entry {
            // A closed pipe is no failure of the session.
            Entry::Line(line) => drop(file.write_all(&line)),
            Entry::Flush(done) => drop(done.send(())),
        }
    }
}

impl Write for LogWriter {
    /// Each call writes one log event.
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let line = match bytes.split_at_checked(MAX_LINE_BYTES) {
            Some((head, rest)) if !rest.is_empty() => [head, b"...\n"].concat().into(),
            _ => bytes.into(),
        };
        if self.queue.try_send(Entry::Line(line)).is_err() {
            DROPPED.increment();
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl<'a> MakeWriter<'a> for LogWriter {
    type Writer = Self;

    fn make_writer(&'a self) -> Self {
        self.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::{Arc, Mutex};

    /// A reader that hangs while the lock is held.
    #[derive(Clone, Default)]
    struct Terminal(Arc<Mutex<Vec<u8>>>);

    impl Write for Terminal {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0.lock().unwrap().extend(bytes);
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_reader_that_hangs_blocks_nothing_and_what_it_misses_is_counted() {
        let terminal = Terminal::default();
        let mut log = LogWriter::to(terminal.clone()).unwrap();
        let before = DROPPED.get();
        let held = terminal.0.lock().unwrap();
        for _ in 0..2 * QUEUE {
            log.write_all(b"line\n").unwrap();
        }
        drop(held);
        log.finish();
        let written = terminal.0.lock().unwrap().len() / 5;
        assert!((QUEUE..=QUEUE + 1).contains(&written), "{written}");
        assert_eq!(written as u64 + DROPPED.get() - before, 2 * QUEUE as u64);
        log.write_all(&[b'x'; 2 * MAX_LINE_BYTES]).unwrap();
        log.finish();
        assert!(terminal.0.lock().unwrap().ends_with(b"xxx...\n"));
    }
}
