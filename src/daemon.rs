//! The daemon's select loop over serial port, deadlines and shutdown.

use crate::port::{self, PortError, PortName};
use crate::recorder::{Chunk, Recorder};
use crate::session_file::Saver;
use crate::source::checkpoints::Checkpoints;
use crate::source::live::LiveSession;
use crate::source::session::Session;
use bytes::Bytes;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::flag::register_conditional_shutdown;
use slamd_core::{
    Timestamp,
    link::{Link, LinkState, Remedy},
};
use std::hash::{BuildHasher, Hasher, RandomState};
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::{Context, Poll, ready};
use std::time::{Duration, Instant};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::signal::unix::{Signal, SignalKind, signal};
use tokio::sync::Notify;
use tokio_serial::{SerialPort, SerialStream};

/// Options of a live session.
#[derive(Clone, Copy, Debug)]
pub struct Options<'a> {
    /// The serial port.
    pub port: &'a PortName,
    /// Bits per second.
    pub baud: u32,
    /// Ends the session when the port hangs up, instead of waiting for its return.
    pub exit_on_hangup: bool,
}

/// A live session cannot begin because signal handlers cannot be installed.
#[derive(Debug, thiserror::Error)]
#[error("cannot handle signals: {0}")]
pub struct DaemonError(pub std::io::Error);

/// Session time. It continues during system suspend, as the board's clock and the calendar do.
#[derive(Clone, Copy, Debug)]
pub struct SessionClock {
    begin: Duration,
}

impl SessionClock {
    /// A clock that begins now.
    #[must_use]
    pub fn begin() -> Self {
        Self { begin: since_boot() }
    }

    /// The time now.
    #[must_use]
    pub fn now(&self) -> Timestamp {
        Timestamp::default() + since_boot().saturating_sub(self.begin)
    }
}

/// Time since boot, suspend included; [`Instant`] would stop during suspend.
fn since_boot() -> Duration {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Boottime);
    Duration::new(u64::try_from(now.tv_sec).unwrap_or_default(), u32::try_from(now.tv_nsec).unwrap_or_default())
}

/// Called between any two steps with the link and, once there is one, the session. It must not block.
pub type Observer<'a> = dyn FnMut(&Link, Option<&Session>) + 'a;

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

/// Search period for a missing port: short, so that a replugged board is used at once.
const SEARCH_PERIOD: Duration = Duration::from_millis(100);
/// The first wait before a port that exists but cannot be opened is tried again; it doubles up to the last.
const FIRST_RETRY: Duration = Duration::from_millis(250);
const LAST_RETRY: Duration = Duration::from_secs(2);

/// An open port.
pub struct OpenPort {
    name: String,
    stream: SerialStream,
}

const CHUNK: usize = 4096;

/// A completed read or write.
enum Traffic {
    /// The bytes, with the time when the read returned.
    Read(Instant, Bytes),
    /// The number of outgoing bytes written.
    Wrote(usize),
}

impl OpenPort {
    /// Applies a recovery action. Returns why the port must be closed, if it must.
    fn apply(&mut self, remedy: Remedy) -> Option<String> {
        match remedy {
            Remedy::Baud(baud) => self.stream.set_baud_rate(baud).err().map(|error| error.to_string()),
            Remedy::Reopen => Some("silent for 10 s: reopening the port".into()),
        }
    }

    async fn traffic(&mut self, outgoing: Option<&[u8]>) -> std::io::Result<Traffic> {
        std::future::poll_fn(|context| self.poll_traffic(context, outgoing)).await
    }

    #[expect(
        clippy::disallowed_methods,
        reason = "the latency of a pose is measured from here; it is reported and changes nothing"
    )]
    fn poll_traffic(&mut self, context: &mut Context<'_>, outgoing: Option<&[u8]>) -> Poll<std::io::Result<Traffic>> {
        if let Some(outgoing) = outgoing
            && let Poll::Ready(written) = Pin::new(&mut self.stream).poll_write(context, outgoing)
        {
            return Poll::Ready(written.map(Traffic::Wrote));
        }
        let mut chunk = [0; CHUNK];
        let mut read = ReadBuf::new(&mut chunk);
        ready!(Pin::new(&mut self.stream).poll_read(context, &mut read))?;
        let now = Instant::now();
        Poll::Ready(match read.filled() {
            // A hang-up: further reads would return nothing for ever.
            [] => Err(std::io::Error::other("it hung up")),
            bytes => Ok(Traffic::Read(now, Bytes::copy_from_slice(bytes))),
        })
    }
}

/// Opens the port, and retries without limit; `now` is session time, zero before there is a session. None if the end was requested first.
///
/// # Errors
/// Why the port cannot be opened, if `options.exit_on_hangup` forbids waiting.
pub async fn search(
    options: Options<'_>,
    link: &mut Link,
    now: impl Fn() -> Timestamp,
    shutdown: &mut Shutdown,
    observe: &mut dyn FnMut(&Link),
) -> Result<Option<OpenPort>, PortError> {
    let mut retry = FIRST_RETRY;
    loop {
        let opened = options.port.resolve().and_then(|path| {
            let stream = port::open(&path, link.baud())?;
            Ok(OpenPort { name: path.display().to_string(), stream })
        });
        let error = match opened {
            Ok(opened) => return Ok(Some(opened)),
            Err(error) if options.exit_on_hangup => return Err(error.or_shortage()),
            Err(error) => error.or_shortage(),
        };
        link.closed(now(), error.to_string());
        log_changes(link);
        observe(link);
        let wait = if error.is_missing() { SEARCH_PERIOD } else { retry };
        retry = if error.is_missing() { FIRST_RETRY } else { (retry * 2).min(LAST_RETRY) };
        tokio::select! {
            () = tokio::time::sleep(jittered(wait)) => {}
            () = shutdown.requested() => return Ok(None),
        }
    }
}

/// Period of the statistics in the log.
const STATISTICS_PERIOD: Duration = Duration::from_secs(300);

/// What woke the loop.
enum Wake {
    Traffic(std::io::Result<Traffic>),
    Deadline,
    End,
}

/// The parts of a live session.
pub struct Live<'a> {
    /// Session time.
    pub clock: SessionClock,
    /// The pipeline and its outputs.
    pub session: &'a mut Session,
    /// Records the traffic.
    pub recorder: &'a mut Option<Recorder>,
    /// Saves the state for the next session.
    pub saver: &'a mut Option<Saver>,
    /// Writes the map meanwhile.
    pub checkpoints: &'a mut Checkpoints,
}

/// Runs until the end is requested, or until a hang-up if `options.exit_on_hangup` is set.
pub async fn run(
    options: Options<'_>,
    mut port: OpenPort,
    link: &mut Link,
    shutdown: &mut Shutdown,
    live: Live<'_>,
    observe: &mut Observer<'_>,
) {
    let Live { clock, session, recorder, saver, checkpoints } = live;
    let now = || clock.now();
    let mut live = LiveSession::begin(port.name.clone(), now(), link, session);
    let mut statistics = Timestamp::default() + STATISTICS_PERIOD;
    loop {
        let (link, session) = live.parts();
        log_changes(link);
        log_statistics(session, &mut statistics);
        observe(link, Some(session));
        let wait = Duration::from_micros(live.deadline().us().saturating_sub(now().us()));
        let wake = tokio::select! {
            traffic = port.traffic(live.outgoing()) => Wake::Traffic(traffic),
            () = tokio::time::sleep(wait) => Wake::Deadline,
            () = shutdown.requested() => Wake::End,
        };
        let (mut gone, mut hung_up) = (None, false);
        let chunk = match wake {
            Wake::Traffic(Ok(Traffic::Read(read, bytes))) => {
                let chunk = live.read(now(), bytes);
                live.parts().1.delay(read.elapsed());
                Some(chunk)
            }
            Wake::Traffic(Ok(Traffic::Wrote(count))) => Some(live.wrote(now(), count)),
            Wake::Traffic(Err(error)) => {
                (gone, hung_up) = (Some(format!("{} is gone: {error}", live.port())), true);
                None
            }
            Wake::Deadline => {
                live.tick(now());
                None
            }
            Wake::End => return,
        };
        record(recorder, chunk);
        if let Some(saver) = saver {
            let (_, session) = live.parts();
            saver.tick(session.now(), || session.saved_state());
        }
        checkpoints.tick(live.parts().1);
        if recorder.as_mut().is_some_and(Recorder::take_new_part) {
            live.introduce();
        }
        gone = gone.or_else(|| port.apply(live.take_remedy()?));
        if let Some(cause) = gone {
            live.closed(now(), cause);
            log_changes(live.parts().0);
            if hung_up && options.exit_on_hangup {
                return;
            }
            // Closes the port at once; while it is open, the kernel gives a returning device another name.
            drop(port);
            let (link, session) = live.parts();
            let mut look = |link: &Link| observe(link, Some(session));
            let Ok(Some(found)) = search(options, link, now, shutdown, &mut look).await else {
                return;
            };
            port = found;
            record(recorder, Some(live.reopened(port.name.clone(), now())));
        }
    }
}

fn record(recorder: &mut Option<Recorder>, chunk: Option<Chunk>) {
    if let (Some(recorder), Some(chunk)) = (recorder, chunk) {
        recorder.record(chunk);
    }
}

/// Logs each change of the link.
fn log_changes(link: &mut Link) {
    while let Some(change) = link.poll_change() {
        match change.state {
            LinkState::Searching | LinkState::Stale | LinkState::Lost => tracing::warn!("{change}"),
            _ => tracing::info!("{change}"),
        }
    }
}

/// Logs the statistics if they are due.
fn log_statistics(session: &Session, due: &mut Timestamp) {
    if session.now() >= *due {
        *due = session.now() + STATISTICS_PERIOD;
        tracing::info!("{}", session.statistics());
    }
}

/// `wait` with a random change of up to a quarter, so that several programs that lost the same hub do not retry in step.
fn jittered(wait: Duration) -> Duration {
    let random = RandomState::new().build_hasher().finish() % 1_000;
    wait.mul_f64(0.75 + 0.5e-3 * random as f64)
}
