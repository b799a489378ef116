//! The only select loop: the serial port, the pipeline's deadline, the end.

use crate::publish::PublishError;
use crate::recorder::Recorder;
use crate::source::session::Session;
use crate::time::Timestamp;
use bytes::{Bytes, BytesMut};
use std::path::Path;
use std::time::{Duration, Instant};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio_serial::{SerialPortBuilderExt, SerialStream};

/// How a live session is run.
#[derive(Clone, Copy, Debug)]
pub struct Options<'a> {
    /// The serial port's device.
    pub port: &'a Path,
    /// Bits per second.
    pub baud: u32,
    /// Ends the session after this long.
    pub duration: Option<Duration>,
    /// Ends the session when the port hangs up, instead of waiting for its return.
    pub exit_on_hangup: bool,
}

/// A live session that cannot go on.
#[derive(Debug, thiserror::Error)]
pub enum DaemonError {
    /// An output cannot be written.
    #[error(transparent)]
    Publish(#[from] PublishError),
    /// Signals cannot be heard.
    #[error("signals cannot be heard: {0}")]
    Signal(std::io::Error),
}

const FIRST_RETRY: Duration = Duration::from_millis(500);
const LAST_RETRY: Duration = Duration::from_secs(5);
const CHUNK: usize = 4096;

/// What woke the loop.
enum Wake {
    Read(std::io::Result<usize>),
    Deadline,
    End,
}

/// Runs until a signal, the end of the duration, or a hang-up where that is the end.
///
/// # Errors
/// When an output cannot be written.
#[expect(clippy::disallowed_methods, reason = "here time becomes an input")]
pub async fn run(
    options: Options<'_>,
    port: SerialStream,
    session: &mut Session,
    recorder: &mut Option<Recorder>,
) -> Result<(), DaemonError> {
    let begin = Instant::now();
    let now = || Timestamp::default() + begin.elapsed();
    let mut interrupt =
        tokio::signal::unix::signal(tokio::signal::unix::SignalKind::interrupt()).map_err(DaemonError::Signal)?;
    let mut terminate =
        tokio::signal::unix::signal(tokio::signal::unix::SignalKind::terminate()).map_err(DaemonError::Signal)?;
    let end = options.duration.map(|duration| tokio::time::Instant::from_std(begin + duration));
    let mut port = Some(port);
    let mut retry = FIRST_RETRY;
    let mut reopen_at = begin;
    let mut buffer = BytesMut::with_capacity(CHUNK);
    loop {
        if port.is_none() && Instant::now() >= reopen_at {
            match open(options) {
                Ok(opened) => {
                    tracing::info!("{} is back", options.port.display());
                    (port, retry) = (Some(opened), FIRST_RETRY);
                }
                Err(_) => {
                    retry = (retry * 2).min(LAST_RETRY);
                    reopen_at = Instant::now() + retry;
                }
            }
        }
        let deadline = begin + Duration::from_micros(session.next_deadline().us());
        let deadline = if port.is_none() { deadline.min(reopen_at) } else { deadline };
        buffer.reserve(CHUNK);
        let wake = tokio::select! {
            read = read(&mut port, &mut buffer) => Wake::Read(read),
            () = tokio::time::sleep_until(deadline.into()) => Wake::Deadline,
            _ = interrupt.recv() => Wake::End,
            _ = terminate.recv() => Wake::End,
            () = sleep_until(end) => Wake::End,
        };
        match wake {
            Wake::Read(Ok(count)) if count > 0 => {
                let at = session.run_until(now())?;
                let bytes = buffer.split().freeze();
                session.received(at, &bytes)?;
                if let Some(recorder) = recorder {
                    recorder.received(at, bytes);
                }
            }
            Wake::Read(gone) => {
                let why = gone.err().map_or_else(|| "it hung up".to_owned(), |error| error.to_string());
                tracing::warn!("{} is gone: {why}", options.port.display());
                if options.exit_on_hangup {
                    return Ok(());
                }
                port = None;
                reopen_at = Instant::now() + retry;
            }
            Wake::Deadline => {
                session.run_until(now())?;
            }
            Wake::End => return Ok(()),
        }
        for frame in session.take_transmit() {
            send(&mut port, frame, session, recorder, now).await?;
        }
    }
}

/// Writes a frame; a failure shows at the next read.
async fn send(
    port: &mut Option<SerialStream>,
    frame: Bytes,
    session: &mut Session,
    recorder: &mut Option<Recorder>,
    now: impl Fn() -> Timestamp,
) -> Result<(), PublishError> {
    let Some(stream) = port else { return Ok(()) };
    if stream.write_all(&frame).await.is_ok() {
        let at = session.run_until(now())?;
        session.sent(at, &frame)?;
        if let Some(recorder) = recorder {
            recorder.sent(at, frame);
        }
    }
    Ok(())
}

async fn read(port: &mut Option<SerialStream>, buffer: &mut BytesMut) -> std::io::Result<usize> {
    match port {
        Some(stream) => stream.read_buf(buffer).await,
        None => std::future::pending().await,
    }
}

async fn sleep_until(end: Option<tokio::time::Instant>) {
    match end {
        Some(end) => tokio::time::sleep_until(end).await,
        None => std::future::pending().await,
    }
}

/// Opens the port. Call it within a runtime.
///
/// # Errors
/// Why not and what to do, in words.
pub fn open(options: Options<'_>) -> Result<SerialStream, String> {
    let name = options.port.to_string_lossy();
    let opened = tokio_serial::new(name.as_ref(), options.baud).open_native_async();
    opened.map_err(|error| {
        let advice = match std::fs::File::open(options.port) {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => "plug the board in, or name another port",
            Err(error) if error.kind() == std::io::ErrorKind::PermissionDenied => {
                "add yourself to the device's group (`ls -l` shows it, usually dialout) and log in again"
            }
            _ => "another program may hold it: close serial monitors",
        };
        format!("{name}: {error}; {advice}")
    })
}
