//! The session for other programs: JSON lines after gpsd's model, and two HTTP pages for monitoring. Read-only.
//!
//! `session → Tap → Mailbox → (thread) Server → Client → lines`
//!
//! The pipeline's thread copies its newest state on request and never waits. A client is a state machine without a socket or a clock; the
//! server is the thread around all of them. `docs/api.md` describes the lines.

mod client;
mod connection;
mod http;
mod listener;
mod mailbox;
mod metrics;
mod pages;
mod report;
mod request;
mod send_queue;
mod server;
mod tap;
mod token;
mod waiting;

pub use client::{Client, End, Pending};
pub use listener::{Listener, ListenerError};
pub use mailbox::Mailbox;
pub use report::{MAJOR, MINOR, Report, map_line};
pub use request::{MAX_LINE_BYTES, Request, RequestError, Watch, parse};
pub use server::Server;
pub use slamd_core::Snapshot;
pub use tap::Tap;
pub use token::{Token, TokenError};

#[cfg(test)]
mod tests;
