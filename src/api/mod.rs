//! The session for other programs: JSON lines after gpsd's model, and two HTTP pages for monitoring. Read-only, except for clients with the
//! right to drive where slamd runs with `--drive`: [`crate::drive`].
//!
//! `session → Tap → Mailbox → (thread) Server → Client → lines`
//!
//! The pipeline's thread copies its newest state on request and never waits. A client is a state machine without a socket or a clock; the
//! server is the thread around all of them. `docs/api.md` describes the lines.

mod client;
mod connection;
mod helmsman;
mod http;
mod listener;
mod mailbox;
mod metrics;
mod pace;
mod pages;
mod report;
mod request;
mod right;
mod send_queue;
mod server;
mod tap;
mod token;
mod waiting;

pub use client::{Client, End, Pending};
pub use listener::{Listener, ListenerError};
pub use mailbox::Mailbox;
pub use report::{MAJOR, MINOR, Report, map_line};
pub use request::{Drive as DriveRequest, MAX_LINE_BYTES, Request, RequestError, Watch, parse};
pub use right::Right;
pub use server::{DriveAccess, Server};
pub use slamd_core::Snapshot;
pub use tap::Tap;
pub use token::{Token, TokenError};

#[cfg(test)]
mod tests;
