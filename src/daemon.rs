//! The only select loop: the serial port, the deadlines, the end.

use crate::port::{self, PortName, Trouble};
use crate::recorder::{Chunk, Recorder};
use crate::session_file::Saver;
use crate::source::live::LiveSession;
use crate::source::session::Session;
use bytes::Bytes;
use slamd_core::{
    Timestamp,
    link::{Link, LinkState, Remedy},
};
use std::hash::{BuildHasher, Hasher, RandomState};
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll, ready};
use std::time::{Duration, Instant};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::signal::unix::{Signal, SignalKind, signal};
use tokio::sync::Notify;
use tokio_serial::{SerialPort, SerialStream};

/// How a live session is run.
#[derive(Clone, Copy, Debug)]
pub struct Options<'a> {
    /// The serial port.
    pub port: &'a PortName,
    /// Bits per second.
    pub baud: u32,
    /// Ends the session when the port hangs up, instead of waiting for its return.
    pub exit_on_hangup: bool,
}

/// A live session that cannot begin: signals cannot be heard.
#[derive(Debug, thiserror::Error)]
#[error("signals cannot be heard: {0}")]
pub struct DaemonError(pub std::io::Error);

/// Session time. It goes on while the machine sleeps, as the board's clock and the calendar do.
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

/// [`Instant`] would stand still while the machine sleeps.
fn since_boot() -> Duration {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Boottime);
    Duration::new(u64::try_from(now.tv_sec).unwrap_or_default(), u32::try_from(now.tv_nsec).unwrap_or_default())
}

/// Sees how it fares, between any two steps: the line, and the session once there is one. It must not wait.
pub type Observer<'a> = dyn FnMut(&Link, Option<&Session>) + 'a;

/// What ends a session: Ctrl-C, SIGTERM, its time is over, or somebody asks for it.
#[derive(Debug)]
pub struct Shutdown {
    asked: Arc<Notify>,
    interrupt: Signal,
    terminate: Signal,
    end: Option<tokio::time::Instant>,
}

impl Shutdown {
    /// Listens for signals, and ends after `duration` where that is given.
    ///
    /// # Errors
    /// When signals cannot be heard.
    pub fn new(duration: Option<Duration>) -> Result<Self, DaemonError> {
        Ok(Self {
            asked: Arc::default(),
            interrupt: signal(SignalKind::interrupt()).map_err(DaemonError)?,
            terminate: signal(SignalKind::terminate()).map_err(DaemonError)?,
            end: duration.map(|duration| tokio::time::Instant::now() + duration),
        })
    }

    /// Notify this, from any thread, to end the session.
    #[must_use]
    pub fn asked(&self) -> Arc<Notify> {
        Arc::clone(&self.asked)
    }

    /// Returns when the session shall end.
    pub async fn requested(&mut self) {
        let end = self.end;
        let is_over = async {
            match end {
                Some(end) => tokio::time::sleep_until(end).await,
                None => std::future::pending().await,
            }
        };
        tokio::select! {
            _ = self.interrupt.recv() => {}
            _ = self.terminate.recv() => {}
            () = self.asked.notified() => {}
            () = is_over => {}
        }
    }
}

/// A missing port is looked for this often: its return should not be waited for.
const LOOK: Duration = Duration::from_millis(100);
/// A port that is there but cannot be opened is tried again after this long, then twice as long, up to the last.
const FIRST_RETRY: Duration = Duration::from_millis(250);
const LAST_RETRY: Duration = Duration::from_secs(2);

/// An open port.
pub struct OpenPort {
    name: String,
    stream: SerialStream,
}

const CHUNK: usize = 4096;

/// What went over the line.
enum Traffic {
    /// With the instant when the read returned.
    Read(Instant, Bytes),
    /// So many of the outgoing bytes.
    Wrote(usize),
}

impl OpenPort {
    /// Does what may bring a silent line back; why the port must be closed, where it must.
    fn heal(&mut self, remedy: Remedy) -> Option<String> {
        match remedy {
            Remedy::Baud(baud) => self.stream.set_baud_rate(baud).err().map(|error| error.to_string()),
            Remedy::Reopen => Some("silent for 10 s: the port is closed and opened anew".into()),
        }
    }

    async fn traffic(&mut self, outgoing: Option<&[u8]>) -> std::io::Result<Traffic> {
        std::future::poll_fn(|context| self.poll_traffic(context, outgoing)).await
    }

    #[expect(
        clippy::disallowed_methods,
        reason = "how late a pose is begins here; it is reported, and changes nothing"
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
            // A hang-up: it would be read for ever.
            [] => Err(std::io::Error::other("it hung up")),
            bytes => Ok(Traffic::Read(now, Bytes::copy_from_slice(bytes))),
        })
    }
}

/// Opens the port, and tries for as long as it takes; `now` is session time, zero before there is a session. None where the end was requested first.
///
/// # Errors
/// Why the port cannot be opened, where nobody shall wait for it.
pub async fn search(
    options: Options<'_>,
    link: &mut Link,
    now: impl Fn() -> Timestamp,
    shutdown: &mut Shutdown,
    observe: &mut dyn FnMut(&Link),
) -> Result<Option<OpenPort>, Trouble> {
    let mut retry = FIRST_RETRY;
    loop {
        let opened = options.port.resolve().and_then(|path| {
            let stream = port::open(&path, link.baud())?;
            Ok(OpenPort { name: path.display().to_string(), stream })
        });
        let trouble = match opened {
            Ok(opened) => return Ok(Some(opened)),
            Err(trouble) if options.exit_on_hangup => return Err(trouble),
            Err(trouble) => trouble,
        };
        link.closed(now(), trouble.to_string());
        tell(link);
        observe(link);
        let wait = if trouble.is_missing() { LOOK } else { retry };
        retry = if trouble.is_missing() { FIRST_RETRY } else { (retry * 2).min(LAST_RETRY) };
        tokio::select! {
            () = tokio::time::sleep(jittered(wait)) => {}
            () = shutdown.requested() => return Ok(None),
        }
    }
}

/// From one line of statistics in the log to the next.
const STATISTICS: Duration = Duration::from_secs(300);

/// What woke the loop.
enum Wake {
    Traffic(std::io::Result<Traffic>),
    Deadline,
    End,
}

/// What a live session feeds.
pub struct Live<'a> {
    /// Session time.
    pub clock: SessionClock,
    /// The pipeline and its outputs.
    pub session: &'a mut Session,
    /// Where the traffic is recorded.
    pub recorder: &'a mut Option<Recorder>,
    /// Where what is known is saved for the next session.
    pub saver: &'a mut Option<Saver>,
}

/// Runs until the end is requested, or a hang-up where that is the end.
pub async fn run(
    options: Options<'_>,
    mut port: OpenPort,
    link: &mut Link,
    shutdown: &mut Shutdown,
    live: Live<'_>,
    observe: &mut Observer<'_>,
) {
    let Live { clock, session, recorder, saver } = live;
    let now = || clock.now();
    let mut line = LiveSession::begin(port.name.clone(), now(), link, session);
    let mut statistics = Timestamp::default() + STATISTICS;
    loop {
        let (link, session) = line.parts();
        tell(link);
        tell_statistics(session, &mut statistics);
        observe(link, Some(session));
        let wait = Duration::from_micros(line.deadline().us().saturating_sub(now().us()));
        let wake = tokio::select! {
            traffic = port.traffic(line.outgoing()) => Wake::Traffic(traffic),
            () = tokio::time::sleep(wait) => Wake::Deadline,
            () = shutdown.requested() => Wake::End,
        };
        let (mut gone, mut hung_up) = (None, false);
        let chunk = match wake {
            Wake::Traffic(Ok(Traffic::Read(read, bytes))) => {
                let chunk = line.read(now(), bytes);
                line.parts().1.delay(read.elapsed());
                Some(chunk)
            }
            Wake::Traffic(Ok(Traffic::Wrote(count))) => Some(line.wrote(now(), count)),
            Wake::Traffic(Err(error)) => {
                (gone, hung_up) = (Some(format!("{} is gone: {error}", line.port())), true);
                None
            }
            Wake::Deadline => {
                line.tick(now());
                None
            }
            Wake::End => return,
        };
        record(recorder, chunk);
        if let Some(saver) = saver {
            let (_, session) = line.parts();
            saver.tick(session.now(), || session.saved_state());
        }
        if recorder.as_mut().is_some_and(Recorder::take_new_part) {
            line.introduce();
        }
        gone = gone.or_else(|| port.heal(line.take_remedy()?));
        if let Some(cause) = gone {
            line.closed(now(), cause);
            tell(line.parts().0);
            if hung_up && options.exit_on_hangup {
                return;
            }
            // Closed at once: else the device is renamed when it returns.
            drop(port);
            let (link, session) = line.parts();
            let mut look = |link: &Link| observe(link, Some(session));
            let Ok(Some(found)) = search(options, link, now, shutdown, &mut look).await else {
                return;
            };
            port = found;
            record(recorder, Some(line.reopened(port.name.clone(), now())));
        }
    }
}

fn record(recorder: &mut Option<Recorder>, chunk: Option<Chunk>) {
    if let (Some(recorder), Some(chunk)) = (recorder, chunk) {
        recorder.record(chunk);
    }
}

/// One log line per change.
fn tell(link: &mut Link) {
    while let Some(change) = link.poll_change() {
        match change.state {
            LinkState::Searching | LinkState::Stale | LinkState::Lost => tracing::warn!("{change}"),
            _ => tracing::info!("{change}"),
        }
    }
}

/// One log line every so often.
fn tell_statistics(session: &Session, due: &mut Timestamp) {
    if session.now() >= *due {
        *due = session.now() + STATISTICS;
        tracing::info!("{}", session.statistics());
    }
}

/// Within a quarter of `wait`: programs that lost the same hub do not return in step.
fn jittered(wait: Duration) -> Duration {
    let random = RandomState::new().build_hasher().finish() % 1_000;
    wait.mul_f64(0.75 + 0.5e-3 * random as f64)
}
