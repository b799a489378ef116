//! One thread per sink, each with a stream of its own: a sink that is stuck stops no other, and never the robot.
//!
//! Logging into a connection blocks once its buffers are full (Rerun 0.36), and so does taking it down. So nobody ever waits for these
//! threads longer than a given time; what they hold then goes with the process.

use super::layout::APPLICATION;
use super::mailbox::Inbox;
use super::rerun_writer::RerunWriter;
use rerun::log::ChunkBatcherConfig;
use rerun::sink::{GrpcSink, GrpcSinkConnectionState, LogSink as _};
use rerun::{MemoryLimit, RecordingStream, RecordingStreamBuilder, RecordingStreamResult, ServerOptions};
use std::net::{SocketAddr, TcpStream, ToSocketAddrs as _};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::RecvTimeoutError;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// What all streams of a session share.
#[derive(Clone, Debug)]
pub struct Identity {
    /// Viewers put together what has the same.
    pub recording: String,
    /// What a person calls it.
    pub name: String,
    /// Microseconds from 1970 to the session's time zero, where known.
    pub unix_zero_us: Option<u64>,
}

/// History that a server keeps for viewers that come later.
const SERVER_MEMORY: u64 = 64 << 20;
/// What may wait for a connection.
const MAX_IN_FLIGHT: u64 = 2 << 20;
/// Between two looks at a connection, or for one.
const LOOK: Duration = Duration::from_secs(1);
/// A viewer answers within this.
const ANSWER: Duration = Duration::from_millis(300);
const HANDSHAKE: Duration = Duration::from_secs(1);
/// The last of a session may take so long to reach a viewer.
const FAREWELL: Duration = Duration::from_millis(500);

impl Identity {
    fn builder(&self) -> RecordingStreamBuilder {
        let builder = RecordingStreamBuilder::new(APPLICATION).recording_id(self.recording.as_str()).enabled(true);
        builder.recording_name(self.name.as_str())
    }

    /// A stream into a file.
    ///
    /// # Errors
    /// When the file cannot be created.
    pub(super) fn file(&self, path: &std::path::Path) -> RecordingStreamResult<RecordingStream> {
        self.builder().save(path)
    }

    /// A stream that viewers come for.
    ///
    /// # Errors
    /// As Rerun.
    pub(super) fn server(&self, address: SocketAddr) -> RecordingStreamResult<RecordingStream> {
        let options =
            ServerOptions { memory_limit: MemoryLimit::from_bytes(SERVER_MEMORY), ..ServerOptions::default() };
        self.builder().serve_grpc_opts(address.ip().to_string(), address.port(), options)
    }

    fn connection(&self, url: &str) -> RecordingStreamResult<RecordingStream> {
        let batches = ChunkBatcherConfig { max_bytes_in_flight: MAX_IN_FLIGHT, ..ChunkBatcherConfig::LOW_LATENCY };
        self.builder().batcher_config(batches).connect_grpc_opts(url)
    }
}

/// Draws into a file or for a server until nothing more comes, and gives the stream back: a file's footer is written when its stream is
/// dropped, and a server goes with its stream.
pub(super) fn draw(rec: RecordingStream, identity: &Identity, inbox: &Inbox) -> Option<RecordingStream> {
    let mut writer = RerunWriter::new(identity.unix_zero_us);
    complain(writer.begin(rec));
    while let Ok(update) = inbox.next(Duration::MAX) {
        complain(writer.take(&update, inbox));
    }
    complain(writer.step_back());
    let rec = writer.end();
    if let Some(rec) = &rec {
        complain(rec.flush_with_timeout(FAREWELL));
    }
    rec
}

/// Draws for a viewer that listens, for as long as it does, and again when it is back.
#[expect(clippy::disallowed_methods, reason = "a connection lives in real time")]
pub(super) fn visit(url: &str, host: &str, identity: &Identity, inbox: &Inbox) {
    let mut writer = RerunWriter::new(identity.unix_zero_us);
    let is_gone = Arc::new(AtomicBool::new(false));
    let mut looked: Option<Instant> = None;
    let (mut has_said, mut probe) = (false, Probe::default());
    loop {
        if looked.is_none_or(|looked| looked.elapsed() >= LOOK) {
            if is_gone.swap(false, Ordering::Relaxed)
                && let Some(rec) = writer.end()
            {
                tracing::warn!("viewer: {url} is gone; it gets everything when it is back");
                dispose(rec);
            }
            match writer.canvas() {
                Some(rec) => look_after(rec, &is_gone),
                None if probe.listens(host, url) => {
                    tracing::info!("viewer: shown at {url}");
                    complain(identity.connection(url).and_then(|rec| writer.begin(rec)));
                }
                None if !std::mem::replace(&mut has_said, true) => {
                    tracing::info!("viewer: nobody answers at {url} yet; `rerun` opens a viewer there");
                }
                None => {}
            }
            looked = Some(Instant::now());
        }
        match inbox.next(LOOK) {
            Ok(update) => complain(writer.take(&update, inbox)),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => break,
        }
    }
    complain(writer.step_back());
    if let Some(rec) = writer.end() {
        complain(rec.flush_with_timeout(FAREWELL));
        dispose(rec);
    }
}

/// Looks for a viewer.
#[derive(Default)]
struct Probe {
    /// The last look, as long as it is being taken down: what listens but does not answer may take for ever.
    last: Option<JoinHandle<()>>,
}

impl Probe {
    /// True where a viewer answers, not just anything that listens.
    fn listens(&mut self, host: &str, url: &str) -> bool {
        if self.last.as_ref().is_some_and(|last| !last.is_finished()) {
            return false;
        }
        let addresses = host.to_socket_addrs().into_iter().flatten();
        if !addresses.into_iter().any(|address| TcpStream::connect_timeout(&address, ANSWER).is_ok()) {
            return false;
        }
        let Ok(url) = url.parse() else { return false };
        let sink = GrpcSink::new(url);
        let answers = sink.flush_blocking(HANDSHAKE).is_ok();
        self.last = Some(std::thread::spawn(move || drop(sink)));
        answers
    }
}

/// Asks the connection how it is; the answer comes when it comes.
fn look_after(rec: &RecordingStream, is_gone: &Arc<AtomicBool>) {
    let is_gone = Arc::clone(is_gone);
    rec.inspect_sink(move |sink| {
        let status = (sink as &dyn std::any::Any).downcast_ref::<GrpcSink>().map(GrpcSink::status);
        if matches!(status, Some(GrpcSinkConnectionState::Disconnected(_))) {
            is_gone.store(true, Ordering::Relaxed);
        }
    });
}

/// Takes a stream down somewhere where nobody waits for it.
fn dispose(rec: RecordingStream) {
    std::thread::spawn(move || drop(rec));
}

fn complain<E: std::fmt::Display>(result: Result<(), E>) {
    if let Err(error) = result {
        tracing::debug!("viewer: {error}");
    }
}
