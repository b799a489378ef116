//! Keeps the log's last lines for the screen.

use crate::monitor::clock;
use slamd_core::Timestamp;
use std::collections::VecDeque;
use std::io::{self, Write};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use tracing_subscriber::fmt::format::Writer;
use tracing_subscriber::fmt::time::FormatTime;
use tracing_subscriber::layer::SubscriberExt as _;
use tracing_subscriber::util::SubscriberInitExt as _;

/// The last lines; clones share them.
#[derive(Clone, Default)]
pub(super) struct Log {
    lines: Arc<Mutex<VecDeque<String>>>,
    clock: Clock,
}

/// The session's time in microseconds, which the title shows too; clones share it.
#[derive(Clone, Default)]
pub(super) struct Clock(Arc<AtomicU64>);

impl Clock {
    /// The session is at this time now.
    pub(super) fn set(&self, now: Timestamp) {
        self.0.store(now.us(), Ordering::Relaxed);
    }
}

/// More rows than a screen has.
const MAX_LINES: usize = 200;
/// Longest line, bytes; a longer one is cut.
const MAX_LINE_BYTES: usize = 1_000;

impl Log {
    /// Receives everything that is logged from now on.
    pub(super) fn begin() -> Self {
        let log = Self::default();
        let writer = log.clone();
        let lines = tracing_subscriber::fmt::layer()
            .with_writer(move || writer.clone())
            .with_ansi(false)
            .with_target(false)
            .with_timer(log.clock.clone());
        let (filter, warning) = crate::cli::log::filter();
        tracing_subscriber::registry().with(filter).with(lines).with(crate::cli::log::for_viewers()).init();
        warning.into_iter().for_each(|warning| tracing::warn!("{warning}"));
        log
    }

    /// The clock of its lines.
    pub(super) fn clock(&self) -> Clock {
        self.clock.clone()
    }

    /// The lines, oldest first.
    pub(super) fn lines(&self) -> Vec<String> {
        self.lines.lock().unwrap_or_else(PoisonError::into_inner).iter().cloned().collect()
    }
}

impl Write for Log {
    /// Each call writes one log event.
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let text = String::from_utf8_lossy(bytes.get(..MAX_LINE_BYTES).unwrap_or(bytes));
        let mut lines = self.lines.lock().unwrap_or_else(PoisonError::into_inner);
        lines.extend(text.lines().map(str::to_owned));
        let surplus = lines.len().saturating_sub(MAX_LINES);
        lines.drain(..surplus);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl FormatTime for Clock {
    fn format_time(&self, writer: &mut Writer<'_>) -> std::fmt::Result {
        write!(writer, "{}", clock(Timestamp::from_us(self.0.load(Ordering::Relaxed))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_last_lines_are_kept() {
        let mut log = Log::default();
        for line in 0..1_000 {
            writeln!(log, "{line}").unwrap();
        }
        log.write_all(&[b'x'; 5_000]).unwrap();
        let lines = log.lines();
        assert!(lines.len() <= MAX_LINES, "{}", lines.len());
        assert!(lines.contains(&"999".to_owned()) && !lines.contains(&"700".to_owned()));
        assert!(lines.iter().all(|line| line.len() <= MAX_LINE_BYTES));
    }
}
