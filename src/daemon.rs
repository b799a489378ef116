//! The only select loop: the serial port, the deadlines, the end.

use crate::handshake;
use crate::link::{Link, LinkState, Remedy};
use crate::port::{self, PortName, Trouble};
use crate::recorder::Recorder;
use crate::session_file::Saver;
use crate::source::session::Session;
use crate::time::Timestamp;
use bytes::{Buf, Bytes};
use std::collections::VecDeque;
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
    /// Frames to be written; of the first, what is left.
    outgoing: VecDeque<Bytes>,
}

/// Frames that wait for a port that takes none; what is older has become useless.
const MOST_OUTGOING: usize = 16;
const CHUNK: usize = 4096;

/// What went over the line.
enum Traffic {
    /// With the instant when the read returned.
    Read(Instant, Bytes),
    Wrote(Bytes),
}

impl OpenPort {
    fn queue(&mut self, frames: impl IntoIterator<Item = Bytes>) {
        let room = MOST_OUTGOING.saturating_sub(self.outgoing.len());
        self.outgoing.extend(frames.into_iter().take(room));
    }

    /// Does what may bring a silent line back; why the port must be closed, where it must.
    fn heal(&mut self, remedy: Remedy) -> Option<String> {
        match remedy {
            Remedy::Baud(baud) => self.stream.set_baud_rate(baud).err().map(|error| error.to_string()),
            Remedy::Reopen => Some("silent for 10 s: the port is closed and opened anew".into()),
        }
    }

    async fn traffic(&mut self) -> std::io::Result<Traffic> {
        std::future::poll_fn(|context| self.poll_traffic(context)).await
    }

    #[expect(
        clippy::disallowed_methods,
        reason = "how late a pose is begins here; it is reported, and changes nothing"
    )]
    fn poll_traffic(&mut self, context: &mut Context<'_>) -> Poll<std::io::Result<Traffic>> {
        if let Some(first) = self.outgoing.front_mut()
            && let Poll::Ready(written) = Pin::new(&mut self.stream).poll_write(context, first)
        {
            let written = first.split_to(written?.min(first.len()));
            if !first.has_remaining() {
                self.outgoing.pop_front();
            }
            return Poll::Ready(Ok(Traffic::Wrote(written)));
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

/// Opens the port, and tries for as long as it takes. None where the end was requested first.
///
/// # Errors
/// Why the port cannot be opened, where nobody shall wait for it.
pub async fn search(
    options: Options<'_>,
    link: &mut Link,
    shutdown: &mut Shutdown,
    observe: &mut dyn FnMut(&Link),
) -> Result<Option<OpenPort>, Trouble> {
    let mut retry = FIRST_RETRY;
    loop {
        let opened = options.port.resolve().and_then(|path| {
            let stream = port::open(&path, link.baud())?;
            Ok(OpenPort { name: path.display().to_string(), stream, outgoing: VecDeque::new() })
        });
        let trouble = match opened {
            Ok(opened) => return Ok(Some(opened)),
            Err(trouble) if options.exit_on_hangup => return Err(trouble),
            Err(trouble) => trouble,
        };
        link.closed(Timestamp::default(), trouble.to_string());
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
    /// The session's time zero.
    pub begin: Instant,
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
    let Live { begin, session, recorder, saver } = live;
    let now = || Timestamp::default() + begin.elapsed();
    link.opened(now(), &port.name, &session.reception());
    let mut statistics = Timestamp::default() + STATISTICS;
    loop {
        tell(link);
        tell_statistics(session, &mut statistics);
        observe(link, Some(session));
        let deadline = link.deadline().into_iter().fold(session.next_deadline(), Ord::min);
        let deadline = begin + Duration::from_micros(deadline.us());
        let wake = tokio::select! {
            traffic = port.traffic() => Wake::Traffic(traffic),
            () = tokio::time::sleep_until(deadline.into()) => Wake::Deadline,
            () = shutdown.requested() => Wake::End,
        };
        let at = session.run_until(now());
        let (mut gone, mut hung_up) = (None, false);
        match wake {
            Wake::Traffic(Ok(Traffic::Read(read, bytes))) => {
                session.received(at, &bytes);
                session.delay(read.elapsed());
                link.heard(at, &bytes, &session.reception());
                if let Some(recorder) = recorder {
                    recorder.received(at, bytes);
                }
            }
            Wake::Traffic(Ok(Traffic::Wrote(bytes))) => {
                session.sent(at, &bytes);
                if let Some(recorder) = recorder {
                    recorder.sent(at, bytes);
                }
            }
            Wake::Traffic(Err(error)) => (gone, hung_up) = (Some(format!("{} is gone: {error}", port.name)), true),
            Wake::Deadline => link.tick(at, &session.reception()),
            Wake::End => return,
        }
        if let Some(saver) = saver {
            saver.tick(at, || session.memory());
        }
        gone = gone.or_else(|| port.heal(link.take_remedy()?));
        port.queue(session.take_transmit());
        if recorder.as_mut().is_some_and(Recorder::take_new_part) {
            // Each capture of a recording can be replayed by itself: who the board is, and its ring, are heard in each.
            port.queue(handshake::introduction());
        }
        if let Some(cause) = gone {
            link.closed(at, cause);
            tell(link);
            if hung_up && options.exit_on_hangup {
                return;
            }
            // Closed at once: else the device is renamed when it returns.
            drop(port);
            let Ok(Some(found)) = search(options, link, shutdown, &mut |link| observe(link, Some(session))).await
            else {
                return;
            };
            port = found;
            let at = session.run_until(now());
            session.take_transmit();
            session.received(at, &[]);
            if let Some(recorder) = recorder {
                recorder.received(at, Bytes::new());
            }
            link.opened(at, &port.name, &session.reception());
        }
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
