//! The daemon's select loop over serial port, deadlines, orders to drive and shutdown.

mod shutdown;

pub use shutdown::{DaemonError, Shutdown};

use crate::drive::{Conditions, Steering};
use crate::port::{self, PortError, PortName};
use crate::recorder::{Chunk, Recorder};
use crate::session_file::Saver;
use crate::source::checkpoints::Checkpoints;
use crate::source::live::LiveSession;
use crate::source::session::Session;
use bytes::Bytes;
use slamd_core::{
    Timestamp,
    link::{Link, LinkState, Remedy},
};
use std::hash::{BuildHasher, Hasher, RandomState};
use std::pin::Pin;
use std::task::{Context, Poll, ready};
use std::time::{Duration, Instant};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio_serial::SerialStream;

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
            Remedy::Baud(baud) => port::set_baud(&mut self.stream, baud).err().map(|error| error.to_string()),
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
    /// A client orders the robot to drive or stop.
    Order,
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
    /// Drives the robot; none without `--drive`.
    pub steering: Option<Steering>,
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
    let Live { clock, session, recorder, saver, checkpoints, mut steering } = live;
    let now = || clock.now();
    let mut live = LiveSession::begin(port.name.clone(), now(), link, session);
    let mut statistics = Timestamp::default() + STATISTICS_PERIOD;
    loop {
        let (link, session) = live.parts();
        log_changes(link);
        log_statistics(session, &mut statistics);
        observe(link, Some(session));
        let wait = wait(now(), live.deadline(), steering.as_ref());
        let wake = tokio::select! {
            traffic = port.traffic(live.outgoing()) => Wake::Traffic(traffic),
            () = tokio::time::sleep(wait) => Wake::Deadline,
            () = ordered(steering.as_ref()) => Wake::Order,
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
            Wake::Order => None,
            Wake::End => {
                let stop = steering.as_mut().and_then(Steering::end);
                return flush(stop, &mut port, &mut live, recorder, now).await;
            }
        };
        record(recorder, chunk);
        steering.iter_mut().for_each(|steering| steer(steering, &mut live, now()));
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
            let mut look = |link: &Link| {
                observe(link, Some(session));
                steering.iter_mut().for_each(|steering| steering.refuse(now()));
            };
            let Ok(Some(found)) = search(options, link, now, shutdown, &mut look).await else {
                return;
            };
            port = found;
            record(recorder, Some(live.reopened(port.name.clone(), now())));
        }
    }
}

/// The frame that stops the robot may take so long at the end.
const LAST_WRITE: Duration = Duration::from_millis(200);

/// Waits for an order to drive.
async fn ordered(steering: Option<&Steering>) {
    match steering {
        Some(steering) => steering.ordered().await,
        None => std::future::pending().await,
    }
}

/// How long to sleep until the first of the deadlines.
fn wait(now: Timestamp, deadline: Timestamp, steering: Option<&Steering>) -> Duration {
    let first = steering.and_then(Steering::deadline).into_iter().fold(deadline, Ord::min);
    Duration::from_micros(first.us().saturating_sub(now.us()))
}

/// Answers the orders, and queues the command that is due.
fn steer(steering: &mut Steering, live: &mut LiveSession<'_>, at: Timestamp) {
    let (link, session) = live.parts();
    let conditions = Conditions::of(link, session);
    steering.turn(at, &conditions).into_iter().for_each(|frame| live.command(frame));
}

/// Writes the frame that stops the robot, if there is one, and what waits before it.
async fn flush(
    stop: Option<Bytes>,
    port: &mut OpenPort,
    live: &mut LiveSession<'_>,
    recorder: &mut Option<Recorder>,
    now: impl Fn() -> Timestamp,
) {
    let Some(stop) = stop else { return };
    live.command(stop);
    let written = async {
        while live.outgoing().is_some() {
            let chunk = match port.traffic(live.outgoing()).await {
                Ok(Traffic::Read(_, bytes)) => live.read(now(), bytes),
                Ok(Traffic::Wrote(count)) => live.wrote(now(), count),
                Err(_) => return,
            };
            record(recorder, Some(chunk));
        }
    };
    let _ = tokio::time::timeout(LAST_WRITE, written).await;
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
