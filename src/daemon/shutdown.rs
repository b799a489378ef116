//! What ends a session: signals, a closed terminal, the end of its duration, or a notification.

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::flag::register_conditional_shutdown;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tokio::signal::unix::{Signal, SignalKind, signal};
use tokio::sync::Notify;

/// A live session cannot begin because signal handlers cannot be installed.
#[derive(Debug, thiserror::Error)]
#[error("cannot handle signals: {0}")]
pub struct DaemonError(pub std::io::Error);

/// What ends a session: Ctrl-C, SIGTERM, SIGHUP (a closed terminal), the end of its duration, or a notification.
#[derive(Debug)]
pub struct Shutdown {
    asked: Arc<Notify>,
    interrupt: Signal,
    terminate: Signal,
    /// None under `nohup`.
    hangup: Option<Signal>,
    /// While it is set, a signal ends the program at once.
    at_once: Arc<AtomicBool>,
    end: Option<tokio::time::Instant>,
}

impl Shutdown {
    /// Listens for signals, and ends after `duration` if given.
    ///
    /// # Errors
    /// When signal handlers cannot be installed.
    pub fn new(duration: Option<Duration>) -> Result<Self, DaemonError> {
        let (at_once, hangs_up) = (Arc::new(AtomicBool::new(false)), !ignores_hangup());
        for number in [SIGINT, SIGTERM].into_iter().chain(hangs_up.then_some(SIGHUP)) {
            register_conditional_shutdown(number, 128 + number, Arc::clone(&at_once)).map_err(DaemonError)?;
        }
        Ok(Self {
            at_once,
            asked: Arc::default(),
            interrupt: signal(SignalKind::interrupt()).map_err(DaemonError)?,
            terminate: signal(SignalKind::terminate()).map_err(DaemonError)?,
            hangup: hangs_up.then(|| signal(SignalKind::hangup())).transpose().map_err(DaemonError)?,
            end: duration.map(|duration| tokio::time::Instant::now() + duration),
        })
    }

    /// Whether a signal ends the program at once, as while files are read at the beginning and nothing would be lost.
    pub fn at_once(&self, is_at_once: bool) {
        self.at_once.store(is_at_once, Ordering::Relaxed);
    }

    /// Notify this from any thread to end the session.
    #[must_use]
    pub fn asked(&self) -> Arc<Notify> {
        Arc::clone(&self.asked)
    }

    /// Returns when the session must end.
    pub async fn requested(&mut self) {
        let end = self.end;
        let hangup = &mut self.hangup;
        let hung_up = async {
            match hangup {
                Some(hangup) => hangup.recv().await,
                None => std::future::pending().await,
            }
        };
        let is_over = async {
            match end {
                Some(end) => tokio::time::sleep_until(end).await,
                None => std::future::pending().await,
            }
        };
        tokio::select! {
            _ = self.interrupt.recv() => {}
            _ = self.terminate.recv() => {}
            _ = hung_up => {}
            () = self.asked.notified() => {}
            () = is_over => {}
        }
    }
}

/// True if the program was started with SIGHUP ignored, as `nohup` does: then it shall survive its terminal.
fn ignores_hangup() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).is_some_and(|mask| mask & 1 != 0)
}
