//! What the service manager is told: that the daemon is up, how the line fares, and that the pipeline's own loop still goes round.
//!
//! systemd starts a `Type=notify` unit with the path of a datagram socket in `$NOTIFY_SOCKET` and, where it has a `WatchdogSec`, with
//! `$WATCHDOG_USEC`; sd_notify(3) describes both. Everything here happens inside [`Service::look`], which the pipeline's thread calls each time its
//! loop goes round, board or no board. There is no timer and no thread: a pipeline that hangs says nothing, and is started anew.

mod feeder;
mod socket;
mod status;

pub use feeder::Feeder;

use crate::source::session::{Session, copy_state};
use slamd_core::{Snapshot, Timestamp, link::Link};
use socket::Socket;
use status::write_status;
use std::time::{Duration, Instant};

/// The service manager, where there is one.
#[derive(Debug)]
pub struct Service {
    socket: Socket,
    begin: Instant,
    feeder: Option<Feeder>,
    /// Filled in place, so that a look allocates nothing.
    snapshot: Snapshot,
    /// What was said last, and what is to be said now: kept, so that a look allocates nothing.
    said: String,
    now: String,
    is_up: bool,
}

impl Service {
    /// The service manager that has started this process; none where nobody wants to be told. A socket that cannot be used is told to the log.
    #[must_use]
    #[expect(clippy::disallowed_methods, reason = "the watchdog measures real time")]
    pub fn begin() -> Option<Self> {
        let place = std::env::var_os("NOTIFY_SOCKET").filter(|place| !place.is_empty())?;
        let socket = match Socket::connect(&place) {
            Ok(socket) => socket,
            Err(error) => {
                tracing::warn!(
                    "the service manager cannot be told anything: NOTIFY_SOCKET={}: {error}",
                    place.display()
                );
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
            said: String::new(),
            now: String::new(),
            is_up: false,
        })
    }

    /// The loop has gone round: tells what is new, and feeds the watchdog where that is due. It never waits; what the service manager had no
    /// room for is said again the next time.
    pub fn look(&mut self, link: &Link, session: Option<&Session>) {
        self.now.clear();
        self.now.push_str(if self.is_up { "" } else { "READY=1\n" });
        self.now.push_str("STATUS=");
        copy_state(&mut self.snapshot, link, session);
        write_status(&mut self.now, &self.snapshot);
        if self.now != self.said && self.socket.send(&self.now) {
            if !self.is_up {
                self.is_up = true;
                self.now.drain(.."READY=1\n".len());
            }
            std::mem::swap(&mut self.now, &mut self.said);
        }
        let now = Timestamp::default() + self.begin.elapsed();
        if let Some(feeder) = &mut self.feeder
            && feeder.is_due(now)
            && self.socket.send("WATCHDOG=1")
        {
            feeder.fed(now);
        }
    }

    /// The session ends: what is left is to write its files.
    pub fn stopping(&self) {
        self.socket.send("STOPPING=1\nSTATUS=stopping: map and session are written");
    }
}

/// How long the watchdog waits before it takes this process for dead, if it watches this process.
fn watchdog() -> Option<Duration> {
    let number = |name| std::env::var(name).ok()?.parse::<u64>().ok();
    let is_ours = number("WATCHDOG_PID").is_none_or(|pid| pid == u64::from(std::process::id()));
    number("WATCHDOG_USEC").filter(|us| is_ours && *us > 0).map(Duration::from_micros)
}
