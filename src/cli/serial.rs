//! Talks to a board at a port: the loop of `slamd doctor` and `slamd setup`.

use super::terminal;
use crate::daemon::Shutdown;
use crate::doctor::Examination;
use crate::port;
use crate::setup::{Progress, Setup};
use bytes::{Buf as _, Bytes};
use slamd_core::Timestamp;
use std::collections::VecDeque;
use std::time::{Duration, Instant};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio_serial::SerialStream;

const CHUNK: usize = 4096;
/// Update period of the progress line.
const BAR_PERIOD: Duration = Duration::from_millis(100);

/// What listens to a board.
pub(super) trait Listener {
    fn received(&mut self, at: Timestamp, bytes: &[u8]);
    fn sent(&mut self, at: Timestamp, bytes: &[u8]);
    fn run_until(&mut self, at: Timestamp);
    fn next_deadline(&self) -> Timestamp;
    fn take_transmit(&mut self) -> Vec<Bytes>;
    fn take_baud(&mut self) -> Option<u32>;
    /// How long it listens, seconds; `None` once it is done.
    fn length_s(&self) -> Option<f64>;
    /// What the person is to do now.
    fn instruction(&self) -> String;
    /// What was found since the last call, for people.
    fn take_news(&mut self) -> Vec<String> {
        Vec::new()
    }
}

/// Why the loop ended before the listener was done.
pub(super) enum Ended {
    /// The port was lost, for this reason.
    Gone(String),
    /// A signal.
    Interrupted,
}

/// An examination that lasts for a while, longer if other baud rates must be tried.
pub(super) struct Timed {
    pub(super) examination: Examination,
    pub(super) seconds: f64,
}

/// Time to try all usual baud rates, which is needed if no valid frame arrives, seconds.
const BAUD_SCAN_S: f64 = 20.0;

impl Listener for Timed {
    fn received(&mut self, at: Timestamp, bytes: &[u8]) {
        self.examination.received(at, bytes);
    }

    fn sent(&mut self, at: Timestamp, bytes: &[u8]) {
        self.examination.sent(at, bytes);
    }

    fn run_until(&mut self, at: Timestamp) {
        self.examination.run_until(at);
    }

    fn next_deadline(&self) -> Timestamp {
        self.examination.next_deadline()
    }

    fn take_transmit(&mut self) -> Vec<Bytes> {
        self.examination.take_transmit()
    }

    fn take_baud(&mut self) -> Option<u32> {
        self.examination.take_baud()
    }

    fn length_s(&self) -> Option<f64> {
        Some(if self.examination.has_frames() { self.seconds } else { self.seconds.max(BAUD_SCAN_S) })
    }

    fn instruction(&self) -> String {
        if self.examination.has_frames() {
            self.examination.drill().instruction()
        } else {
            "listening to the board".into()
        }
    }
}

/// A setup, and how long it may take.
pub(super) struct TimedSetup {
    pub(super) setup: Setup,
    pub(super) timeout_s: f64,
    /// What was told of what it found, lines.
    pub(super) told: usize,
}

impl Listener for TimedSetup {
    fn received(&mut self, at: Timestamp, bytes: &[u8]) {
        self.setup.received(at, bytes);
    }

    fn sent(&mut self, at: Timestamp, bytes: &[u8]) {
        self.setup.sent(at, bytes);
    }

    fn run_until(&mut self, at: Timestamp) {
        self.setup.run_until(at);
    }

    fn next_deadline(&self) -> Timestamp {
        self.setup.next_deadline()
    }

    fn take_transmit(&mut self) -> Vec<Bytes> {
        self.setup.take_transmit()
    }

    fn take_baud(&mut self) -> Option<u32> {
        self.setup.take_baud()
    }

    fn length_s(&self) -> Option<f64> {
        // The setup itself ends in time; one second more lets it say so.
        matches!(self.setup.progress(), Progress::Busy).then_some(self.timeout_s + 1.0)
    }

    fn instruction(&self) -> String {
        self.setup.instruction()
    }

    fn take_news(&mut self) -> Vec<String> {
        // At the end it writes its findings anew, into the file.
        if !matches!(self.setup.progress(), Progress::Busy) {
            return Vec::new();
        }
        let found = self.setup.found();
        let news = found.get(self.told..).unwrap_or_default().iter().map(|line| format!("found: {line}")).collect();
        self.told = found.len();
        news
    }
}

/// What woke the loop.
enum Wake {
    Read(std::io::Result<usize>),
    Wrote(std::io::Result<usize>),
    Deadline,
    Signal,
}

/// Listens until the listener is done. Returns why it ended earlier, if it did. The instructions go to standard error unless it `is_quiet`.
#[expect(clippy::disallowed_methods, reason = "the clock's time becomes an input here")]
pub(super) async fn listen(
    listener: &mut impl Listener,
    stream: &mut SerialStream,
    shutdown: &mut Shutdown,
    is_quiet: bool,
) -> Option<Ended> {
    let begin = Instant::now();
    let now = || Timestamp::default() + begin.elapsed();
    let mut guide = terminal::Guide::new(is_quiet);
    let (mut reader, mut writer) = tokio::io::split(stream);
    let mut outgoing: VecDeque<Bytes> = VecDeque::new();
    let mut chunk = vec![0; CHUNK];
    loop {
        let elapsed_s = now().seconds();
        let length_s = listener.length_s().filter(|length_s| elapsed_s < *length_s)?;
        listener.take_news().iter().for_each(|line| guide.tell(line));
        guide.show(elapsed_s, length_s, &listener.instruction());
        let deadline = listener.next_deadline().min(now() + BAR_PERIOD);
        let deadline = begin + Duration::from_micros(deadline.us());
        let wake = tokio::select! {
            read = reader.read(&mut chunk) => Wake::Read(read),
            wrote = write(&mut writer, outgoing.front()) => Wake::Wrote(wrote),
            () = tokio::time::sleep_until(deadline.into()) => Wake::Deadline,
            () = shutdown.requested() => Wake::Signal,
        };
        let at = now();
        match wake {
            Wake::Read(Ok(0)) => return Some(Ended::Gone("it hung up".into())),
            Wake::Read(Ok(count)) => listener.received(at, chunk.get(..count).unwrap_or_default()),
            Wake::Wrote(Ok(count)) => {
                if let Some(first) = outgoing.front_mut() {
                    let written = first.split_to(count.min(first.len()));
                    listener.sent(at, &written);
                }
                outgoing.pop_front_if(|first| !first.has_remaining());
            }
            Wake::Read(Err(error)) | Wake::Wrote(Err(error)) => return Some(Ended::Gone(error.to_string())),
            Wake::Deadline => listener.run_until(at),
            Wake::Signal => return Some(Ended::Interrupted),
        }
        outgoing.extend(listener.take_transmit());
        if let Some(baud) = listener.take_baud() {
            let stream = reader.unsplit(writer);
            if let Err(error) = port::set_baud(stream, baud) {
                return Some(Ended::Gone(error.to_string()));
            }
            (reader, writer) = tokio::io::split(stream);
        }
    }
}

/// Writes the frame; never completes if there is none.
async fn write(writer: &mut tokio::io::WriteHalf<&mut SerialStream>, frame: Option<&Bytes>) -> std::io::Result<usize> {
    match frame {
        Some(frame) => writer.write(frame).await,
        None => std::future::pending().await,
    }
}
