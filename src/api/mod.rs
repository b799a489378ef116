//! What the robot knows, for other programs: JSON lines after gpsd's model, and two pages for a watching machine. Read-only.
//!
//! `session → Tap → Mailbox → (thread) Server → Client → lines`
//!
//! The pipeline's thread copies what is newest and goes on, and only while somebody wants it; it never waits. A client is a state machine
//! without a socket or a clock; the server is the thread around all of them. `docs/api.md` describes the lines.

mod client;
mod http;
mod listener;
mod mailbox;
mod metrics;
mod outbox;
mod pages;
mod report;
mod request;
mod server;
mod tap;
mod token;
mod visit;

pub use client::{Asks, Client, End};
pub use listener::{Listener, ListenerError};
pub use mailbox::Mailbox;
pub use report::{MAJOR, MINOR, Report, map_line};
pub use request::{LONGEST_LINE, Request, RequestError, Watch, parse};
pub use server::Server;
pub use slamd_core::Snapshot;
pub use tap::Tap;
pub use token::{Token, TokenError};

#[cfg(test)]
mod tests;
