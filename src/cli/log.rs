//! What is logged, and as what.

use super::{Failure, terminal};
use std::io::IsTerminal as _;
use tracing::Level;
use tracing_subscriber::filter::Targets;
use tracing_subscriber::layer::SubscriberExt as _;
use tracing_subscriber::util::SubscriberInitExt as _;

/// How a line of the log looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Format {
    /// For people.
    Text,
    /// One JSON object on each line.
    Json,
}

/// Begins to log to standard error.
pub(super) fn begin(format: Format) {
    let text = (format == Format::Text).then(|| {
        let is_terminal = std::io::stderr().is_terminal();
        tracing_subscriber::fmt::layer().with_writer(std::io::stderr).with_ansi(is_terminal).with_target(false)
    });
    let json = (format == Format::Json)
        .then(|| tracing_subscriber::fmt::layer().json().flatten_event(true).with_writer(std::io::stderr));
    let (filter, complaint) = filter();
    tracing_subscriber::registry().with(filter).with(text).with(json).with(for_viewers()).init();
    complaint.into_iter().for_each(|complaint| tracing::warn!("{complaint}"));
    if format == Format::Json {
        std::panic::set_hook(Box::new(|panic| tracing::error!(target: LAST_WORDS, "{panic}")));
    }
}

/// Says why the program ends.
pub(super) fn end(format: Format, failure: &Failure) {
    match format {
        Format::Text => eprintln!("slamd: {}", terminal::plain(failure)),
        Format::Json => tracing::error!(target: LAST_WORDS, exit_code = failure.kind as u8, "{failure}"),
    }
}

/// What is logged: as `RUST_LOG` says, by level and module, such as `warn` or `info,slamd::recorder=debug`, and why the program ends in any case;
/// and what is to be said of a `RUST_LOG` that says nothing.
pub(super) fn filter() -> (Targets, Option<String>) {
    let asked = std::env::var("RUST_LOG").ok().filter(|asked| !asked.trim().is_empty());
    let (filter, complaint) = match asked.as_deref().map(|asked| (asked, asked.parse::<Targets>())) {
        Some((_, Ok(filter))) => (Some(filter), None),
        Some((asked, Err(error))) => (None, Some(format!("RUST_LOG={asked}: {error}; info is logged"))),
        None => (None, None),
    };
    // Rerun's modules are named re_something.
    let usual = || Targets::new().with_default(Level::INFO).with_target("re_", Level::ERROR);
    (filter.unwrap_or_else(usual).with_target(LAST_WORDS, Level::ERROR), complaint)
}

const LAST_WORDS: &str = "slamd_end";

/// What takes the log to the viewers, if this build has any.
#[cfg(feature = "viewer")]
pub(super) const fn for_viewers() -> slamd_viewer::LogLayer {
    slamd_viewer::LogLayer
}

#[cfg(not(feature = "viewer"))]
pub(super) fn for_viewers() -> tracing_subscriber::layer::Identity {
    tracing_subscriber::layer::Identity::new()
}
