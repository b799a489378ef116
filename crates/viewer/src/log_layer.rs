//! The log, for the viewers.

use super::mailbox::{Line, Mailbox, SinkUpdate};
use std::fmt::{Debug, Write as _};
use std::sync::{Arc, Mutex, PoisonError};
use tracing::field::{Field, Visit};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::layer::{Context, Layer};

/// Hands each line of the log to the sinks that are there by then.
#[derive(Clone, Copy, Debug, Default)]
pub struct LogLayer;

/// The log is one for the whole process, and so are its readers.
static READERS: Mutex<Vec<Mailbox>> = Mutex::new(Vec::new());

/// Makes these the readers, in place of those before.
pub(super) fn read(mailboxes: Vec<Mailbox>) {
    *READERS.lock().unwrap_or_else(PoisonError::into_inner) = mailboxes;
}

impl<S: Subscriber> Layer<S> for LogLayer {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let metadata = event.metadata();
        // What Rerun says of a queue that is full must not go into that queue.
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
        let update = SinkUpdate::Line(Arc::new(Line { level, text: text.0 }));
        for reader in READERS.lock().unwrap_or_else(PoisonError::into_inner).iter() {
            reader.offer(update.clone());
        }
    }
}

/// The message, and other fields after it.
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
