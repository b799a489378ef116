//! Messages to the service manager: readiness, the link's state, and a watchdog signal from the pipeline's loop.
//!
//! systemd starts a `Type=notify` unit with the path of a datagram socket in `$NOTIFY_SOCKET` and, where it has a `WatchdogSec`, with
//! `$WATCHDOG_USEC`; sd_notify(3) describes both. Everything happens inside [`Service::look`], which the pipeline's thread calls in each
//! iteration of its loop, with or without a board. There is no timer and no thread: a pipeline that hangs sends nothing and is restarted.

mod feeder;
mod socket;
mod status;

pub use feeder::Feeder;

use crate::source::session::{Session, copy_state};
use slamd_core::{Snapshot, Timestamp, link::Link};
use socket::Socket;
use status::write_status;
use std::time::{Duration, Instant};

/// The connection to the service manager.
#[derive(Debug)]
pub struct Service {
    socket: Socket,
    begin: Instant,
    feeder: Option<Feeder>,
    /// Filled in place, so that a look allocates nothing.
    snapshot: Snapshot,
    /// The message sent last and the present one, kept so that a look allocates nothing.
    sent: String,
    message: String,
    is_up: bool,
}

impl Service {
    /// Connects to the service manager that started this process; none if there is none. An unusable socket is logged.
    #[must_use]
    #[expect(clippy::disallowed_methods, reason = "the watchdog measures real time")]
    pub fn begin() -> Option<Self> {
        let path = std::env::var_os("NOTIFY_SOCKET").filter(|path| !path.is_empty())?;
        let socket = match Socket::connect(&path) {
            Ok(socket) => socket,
            Err(error) => {
                tracing::warn!("no connection to the service manager: NOTIFY_SOCKET={}: {error}", path.display());
                return None;
            }
        };
        let begin = Instant::now();
        let feeder = watchdog().map(Feeder::new);
        Some(Self {
            socket,
            begin,
            feeder,
            snapshot: Snapshot::default(),
            sent: String::new(),
            message: String::new(),
            is_up: false,
        })
    }

    /// Call in each iteration of the loop: sends a changed status and feeds the watchdog if that is due. It never waits; a message that found the
    /// socket full is sent again the next time.
    pub fn look(&mut self, link: &Link, session: Option<&Session>) {
        self.message.clear();
        self.message.push_str(if self.is_up { "" } else { "READY=1\n" });
        self.message.push_str("STATUS=");
        copy_state(&mut self.snapshot, link, session);
        write_status(&mut self.message, &self.snapshot);
        if self.message != self.sent && self.socket.send(&self.message) {
            if !self.is_up {
                self.is_up = true;
                self.message.drain(.."READY=1\n".len());
            }
            std::mem::swap(&mut self.message, &mut self.sent);
        }
        let now = Timestamp::default() + self.begin.elapsed();
        if let Some(feeder) = &mut self.feeder
            && feeder.is_due(now)
            && self.socket.send("WATCHDOG=1")
        {
            feeder.fed(now);
        }
    }

    /// The session ends and writes its files.
    pub fn stopping(&self) {
        self.socket.send("STOPPING=1\nSTATUS=stopping: map and session are written");
    }
}

/// The timeout of the watchdog, if it watches this process.
fn watchdog() -> Option<Duration> {
    let number = |name| std::env::var(name).ok()?.parse::<u64>().ok();
    let is_ours = number("WATCHDOG_PID").is_none_or(|pid| pid == u64::from(std::process::id()));
    number("WATCHDOG_USEC").filter(|us| is_ours && *us > 0).map(Duration::from_micros)
}
