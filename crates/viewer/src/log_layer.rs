//! Shows the log in the viewers.

use super::mailbox::{LogLine, Mailbox, SinkUpdate};
use std::fmt::{Debug, Write as _};
use std::sync::{Arc, Mutex, PoisonError};
use tracing::field::{Field, Visit};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::layer::{Context, Layer};

/// Sends each log line to the current sinks.
#[derive(Clone, Copy, Debug, Default)]
pub struct LogLayer;

/// The sinks that show the log. The log is global, so they are too.
static READERS: Mutex<Vec<Mailbox>> = Mutex::new(Vec::new());

/// Replaces the readers.
pub(super) fn read(mailboxes: Vec<Mailbox>) {
    *READERS.lock().unwrap_or_else(PoisonError::into_inner) = mailboxes;
}

impl<S: Subscriber> Layer<S> for LogLayer {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let metadata = event.metadata();
        // Rerun's messages about a full queue must not enter that queue.
        if metadata.target().starts_with("re_") {
            return;
        }
        let level = match *metadata.level() {
            Level::ERROR => rerun::TextLogLevel::ERROR,
            Level::WARN => rerun::TextLogLevel::WARN,
            Level::INFO => rerun::TextLogLevel::INFO,
            Level::DEBUG => rerun::TextLogLevel::DEBUG,
            Level::TRACE => rerun::TextLogLevel::TRACE,
        };
        let mut text = Text::default();
        event.record(&mut text);
        let update = SinkUpdate::LogLine(Arc::new(LogLine { level, text: text.0 }));
        for reader in READERS.lock().unwrap_or_else(PoisonError::into_inner).iter() {
            reader.offer(update.clone());
        }
    }
}

/// The message, followed by the other fields.
#[derive(Default)]
struct Text(String);

impl Visit for Text {
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        let _ = match field.name() {
            "message" => write!(self.0, "{value:?}"),
            name => write!(self.0, " {name}={value:?}"),
        };
    }
}
