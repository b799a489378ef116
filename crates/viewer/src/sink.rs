//! The sinks. Each has its own thread and stream, so a stalled sink blocks neither the others nor the
//! robot.
//!
//! Logging to a connection blocks when its buffers are full (Rerun 0.36), and so does closing it. So
//! every wait for these threads has a timeout. The process's end frees what they still hold.

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

/// The identity that all streams of a session share.
#[derive(Clone, Debug)]
pub struct Identity {
    /// Recording id: viewers join streams with the same one.
    pub recording: String,
    /// Name shown to the user.
    pub name: String,
    /// Microseconds from 1970 to the session's time zero, where known.
    pub unix_zero_us: Option<u64>,
}

/// History that a server keeps for late joiners, bytes.
const SERVER_MEMORY: u64 = 64 << 20;
/// Maximum data that waits for a connection, bytes.
const MAX_IN_FLIGHT: u64 = 2 << 20;
/// Period of checking a connection, or of looking for one.
const CHECK_PERIOD: Duration = Duration::from_secs(1);
/// Maximum time until a viewer accepts a connection, and until it answers on it.
const CONNECT_TIMEOUT: Duration = Duration::from_millis(300);
const HANDSHAKE_TIMEOUT: Duration = Duration::from_secs(1);
/// Maximum time to send the end of a session to a viewer.
const FLUSH_TIMEOUT: Duration = Duration::from_millis(500);

impl Identity {
    fn builder(&self) -> RecordingStreamBuilder {
        let builder = RecordingStreamBuilder::new(APPLICATION).recording_id(self.recording.as_str()).enabled(true);
        builder.recording_name(self.name.as_str())
    }

    /// A stream that writes a file.
    ///
    /// # Errors
    /// When the file cannot be created.
    pub(super) fn file(&self, path: &std::path::Path) -> RecordingStreamResult<RecordingStream> {
        self.builder().save(path)
    }

    /// A stream with a server that viewers connect to.
    ///
    /// # Errors
    /// As Rerun reports them.
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

/// Writes to a file or a server until the session ends, and returns the stream. Dropping it writes the
/// file's footer or ends the server.
pub(super) fn draw(rec: RecordingStream, identity: &Identity, inbox: &Inbox) -> Option<RecordingStream> {
    let mut writer = RerunWriter::new(identity.unix_zero_us);
    log_error(writer.begin(rec));
    while let Ok(update) = inbox.next(Duration::MAX) {
        log_error(writer.take(&update, inbox));
    }
    log_error(writer.show_whole_map());
    let rec = writer.end();
    if let Some(rec) = &rec {
        log_error(rec.flush_with_timeout(FLUSH_TIMEOUT));
    }
    rec
}

/// Writes to a viewer while it listens, and again after it reconnects.
#[expect(clippy::disallowed_methods, reason = "connections are in real time")]
pub(super) fn visit(url: &str, host: &str, identity: &Identity, inbox: &Inbox) {
    let mut writer = RerunWriter::new(identity.unix_zero_us);
    let is_gone = Arc::new(AtomicBool::new(false));
    let mut checked: Option<Instant> = None;
    let (mut has_logged, mut probe) = (false, Probe::default());
    loop {
        if checked.is_none_or(|checked| checked.elapsed() >= CHECK_PERIOD) {
            if is_gone.swap(false, Ordering::Relaxed)
                && let Some(rec) = writer.end()
            {
                tracing::warn!("viewer: {url} is gone; it receives the full map when it is back");
                dispose(rec);
            }
            match writer.stream() {
                Some(rec) => check_connection(rec, &is_gone),
                None if probe.listens(host, url) => {
                    tracing::info!("viewer: shown at {url}");
                    log_error(identity.connection(url).and_then(|rec| writer.begin(rec)));
                }
                None if !std::mem::replace(&mut has_logged, true) => {
                    tracing::info!("viewer: no viewer listens at {url} yet; start one with `rerun`");
                }
                None => {}
            }
            checked = Some(Instant::now());
        }
        match inbox.next(CHECK_PERIOD) {
            Ok(update) => log_error(writer.take(&update, inbox)),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => break,
        }
    }
    log_error(writer.show_whole_map());
    if let Some(rec) = writer.end() {
        log_error(rec.flush_with_timeout(FLUSH_TIMEOUT));
        dispose(rec);
    }
}

/// Tests whether a viewer listens.
#[derive(Default)]
struct Probe {
    /// The thread that closes the last connection. It may hang if a listener does not answer.
    last: Option<JoinHandle<()>>,
}

impl Probe {
    /// True if a viewer answers, and not just any listener.
    fn listens(&mut self, host: &str, url: &str) -> bool {
        if self.last.as_ref().is_some_and(|last| !last.is_finished()) {
            return false;
        }
        let addresses = host.to_socket_addrs().into_iter().flatten();
        if !addresses.into_iter().any(|address| TcpStream::connect_timeout(&address, CONNECT_TIMEOUT).is_ok()) {
            return false;
        }
        let Ok(url) = url.parse() else { return false };
        let sink = GrpcSink::new(url);
        let answers = sink.flush_blocking(HANDSHAKE_TIMEOUT).is_ok();
        self.last = Some(std::thread::spawn(move || drop(sink)));
        answers
    }
}

/// Asks for the connection's state, which arrives later and sets `is_gone`.
fn check_connection(rec: &RecordingStream, is_gone: &Arc<AtomicBool>) {
    let is_gone = Arc::clone(is_gone);
    rec.inspect_sink(move |sink| {
        let status = (sink as &dyn std::any::Any).downcast_ref::<GrpcSink>().map(GrpcSink::status);
        if matches!(status, Some(GrpcSinkConnectionState::Disconnected(_))) {
            is_gone.store(true, Ordering::Relaxed);
        }
    });
}

/// Drops a stream on a thread of its own, because dropping it may block.
fn dispose(rec: RecordingStream) {
    std::thread::spawn(move || drop(rec));
}

fn log_error<E: std::fmt::Display>(result: Result<(), E>) {
    if let Err(error) = result {
        tracing::debug!("viewer: {error}");
    }
}
