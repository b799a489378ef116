//! The log: its format, its filter and its limits.

mod limit;
mod writer;

use super::{Failure, terminal};
use limit::{Limiter, Sums};
use std::io::{IsTerminal as _, Write as _};
use std::sync::OnceLock;
use tracing::Level;
use tracing_subscriber::filter::Targets;
use tracing_subscriber::fmt::format::{DefaultFields, Format as LineFormat};
use tracing_subscriber::fmt::writer::BoxMakeWriter;
use tracing_subscriber::layer::SubscriberExt as _;
use tracing_subscriber::util::SubscriberInitExt as _;
use writer::LogWriter;

/// Format of the log's lines.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Format {
    /// For people.
    Text,
    /// One JSON object on each line.
    Json,
}

/// The log of a live session.
struct LiveLog {
    writer: LogWriter,
    /// None if nothing is summed up.
    sums: Option<Sums>,
}

static LIVE: OnceLock<LiveLog> = OnceLock::new();

/// Starts the log on standard error. That of a live session blocks nothing and sums up what repeats; that of other commands is complete.
pub(super) fn begin(format: Format, level: Option<Level>, is_live: bool) {
    let writer = is_live.then(LogWriter::to_stderr).flatten();
    // Who asks for more with -v gets all of it.
    let is_limited = writer.is_some() && level.is_none_or(|level| level <= Level::INFO);
    let limiter = is_limited.then(Limiter::begin);
    let to = || match &writer {
        Some(writer) => BoxMakeWriter::new(writer.clone()),
        None => BoxMakeWriter::new(std::io::stderr),
    };
    let text = (format == Format::Text).then(|| {
        let is_terminal = std::io::stderr().is_terminal();
        lines(to()).with_ansi(is_terminal).with_target(false)
    });
    let json = (format == Format::Json).then(|| lines(to()).json().flatten_event(true));
    if let Some(writer) = &writer {
        let _ = LIVE.set(LiveLog { writer: writer.clone(), sums: limiter.as_ref().map(Limiter::sums) });
    }
    let (filter, warning) = match level {
        Some(level) => (of_level(level), None),
        None => filter(),
    };
    tracing_subscriber::registry().with(filter).with(limiter).with(text).with(json).with(for_viewers()).init();
    warning.into_iter().for_each(|warning| tracing::warn!("{warning}"));
    if format == Format::Json {
        std::panic::set_hook(Box::new(|panic| tracing::error!(target: END_TARGET, "{panic}")));
    }
}

/// A layer of the log. Nobody may read it any more (`2>&1 | head`): the library would report that on standard error, and panic.
fn lines<S>(to: BoxMakeWriter) -> tracing_subscriber::fmt::Layer<S, DefaultFields, LineFormat, BoxMakeWriter> {
    tracing_subscriber::fmt::layer().with_writer(to).log_internal_errors(false)
}

/// Logs why the program ends.
pub(super) fn end(format: Format, failure: &Failure) {
    match format {
        Format::Text => {
            let line = format!("slamd: {}", terminal::plain(failure));
            match LIVE.get() {
                Some(live) => drop(writeln!(live.writer.clone(), "{line}")),
                None => terminal::tell(line),
            }
        }
        Format::Json => tracing::error!(target: END_TARGET, exit_code = failure.kind as u8, "{failure}"),
    }
}

/// Writes the rest of a live session's log, but does not wait long for a reader that hangs.
pub(super) fn finish() {
    if let Some(live) = LIVE.get() {
        live.sums.iter().for_each(Sums::finish);
        live.writer.finish();
    }
}

/// The filter from `RUST_LOG`, by level and module, such as `warn` or `info,slamd::recorder=debug`; the reason why the program ends is always
/// logged. Also a warning about an invalid `RUST_LOG`.
pub(super) fn filter() -> (Targets, Option<String>) {
    let setting = std::env::var("RUST_LOG").ok().filter(|setting| !setting.trim().is_empty());
    let (filter, warning) = match setting.as_deref().map(|setting| (setting, setting.parse::<Targets>())) {
        Some((_, Ok(filter))) => (Some(filter), None),
        Some((setting, Err(error))) => (None, Some(format!("RUST_LOG={setting}: {error}; logging at level info"))),
        None => (None, None),
    };
    (filter.unwrap_or_else(|| of_level(Level::INFO)).with_target(END_TARGET, Level::ERROR), warning)
}

/// The level of `-v` and `-q`; none without them.
pub(super) const fn level(verbose: u8, is_quiet: bool) -> Option<Level> {
    match verbose {
        _ if is_quiet => Some(Level::WARN),
        0 => None,
        1 => Some(Level::DEBUG),
        _ => Some(Level::TRACE),
    }
}

/// The filter of a level. The names of Rerun's modules begin with re_.
fn of_level(level: Level) -> Targets {
    let usual = Targets::new().with_default(level).with_target("re_", Level::ERROR);
    usual.with_target(END_TARGET, Level::ERROR)
}

const END_TARGET: &str = "slamd_end";

/// The layer that sends the log to the viewers, if this build has them.
#[cfg(feature = "viewer")]
pub(super) const fn for_viewers() -> slamd_viewer::LogLayer {
    slamd_viewer::LogLayer
}

#[cfg(not(feature = "viewer"))]
pub(super) fn for_viewers() -> tracing_subscriber::layer::Identity {
    tracing_subscriber::layer::Identity::new()
}
