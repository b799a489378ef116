//! `slamd --port DEV`, the same as `slamd run --port DEV`

use super::state_args::StateArgs;
use super::{Failure, Kind, OutputArgs, failure, outputs, terminal};
use crate::api::{Server, Tap};
use crate::daemon::{self, Live, Observer, Options, SessionClock, Shutdown};
use crate::drive::Steering;
use crate::port::{self, PortError, PortName};
use crate::priority;
use crate::recorder::{DiskHealth, Losses, Recorder};
use crate::service::Service;
use crate::source::checkpoints::Checkpoints;
use crate::source::session::Session;
use clap::Args;
use slamd_capture::CaptureInfo;
use slamd_core::{Config, FaultEvent, Timestamp, link::Link};
use slamd_files::OutputGuard;
use slamd_publish::{Outputs, Source, Summary};
use std::sync::Arc;
use std::time::Duration;
use tokio::runtime::Runtime;

const EXAMPLES: &str = "Examples:
  slamd --port auto --record drive.mcap            map, record all traffic
  slamd --port auto --listen & examples/watch.py   poses for other programs
  slamd --port auto --metrics                      for Prometheus, watchdogs
  slamd --port auto --listen 0.0.0.0:9878 --token-file token

The last serves other machines, which must send the token. docs/api.md has
what programs receive; --metrics has /metrics and /healthz on 127.0.0.1:9879.";

#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct RunArgs {
    /// The board's serial port: a device, usb:VID:PID[:SERIAL], or auto for the only one; `slamd ports` lists them.
    #[arg(long, value_name = "PORT")]
    port: PortName,
    #[command(flatten)]
    live: LiveArgs,
    /// Stop after this time; the default runs until Ctrl-C.
    #[arg(long, value_name = "SECONDS", value_parser = super::seconds)]
    duration: Option<f64>,
    #[command(flatten)]
    output: OutputArgs,
}

/// Options of a live session.
#[derive(Debug, Args)]
pub(super) struct LiveArgs {
    /// Bits per second.
    #[arg(long, default_value_t = 115_200)]
    baud: u32,
    #[command(flatten)]
    record: super::record::RecordArgs,
    /// Stop when the port hangs up instead of waiting for its return.
    #[arg(long)]
    exit_on_hangup: bool,
    /// Run the pipeline with real-time priority (SCHED_FIFO), if that is permitted.
    #[arg(long)]
    realtime: bool,
    #[command(flatten)]
    pub(super) state: StateArgs,
    #[command(flatten)]
    api: super::api::ApiArgs,
    #[cfg(feature = "mqtt")]
    #[command(flatten)]
    mqtt: super::mqtt::MqttArgs,
    #[cfg(feature = "viewer")]
    #[command(flatten)]
    viewer: super::viewer::LiveViewerArgs,
    #[cfg(not(feature = "viewer"))]
    #[command(flatten)]
    _viewer: super::no_viewer::NoViewerArgs,
}

impl RunArgs {
    pub(super) fn run(self) -> Result<(), Failure> {
        let runtime = runtime()?;
        let _guard = runtime.enter();
        let mut shutdown = Shutdown::new(self.duration.map(Duration::from_secs_f64))?;
        // Files are read, and nothing would be lost.
        shutdown.at_once(true);
        let config = self.output.how.of_robot()?;
        let end = self.live.drive(&self.port, config, &self.output, (&runtime, &mut shutdown), &mut |_, _| {})?;
        // Everything is saved.
        shutdown.at_once(true);
        match end {
            Some(end) => terminal::patiently(end.is_mapped(), move || end.report(&self.output)),
            None => Err(no_port(&self.port)),
        }
    }
}

/// The session was over before its port was found.
pub(super) fn no_port(port: &PortName) -> Failure {
    let text = format!(
        "nothing mapped: the session was over before the port {port} was found; plug the board in, or see `slamd ports`"
    );
    Failure::new(Kind::NothingMapped, text)
}

/// Refuses what exists and is no serial port. A port that does not exist yet, or is busy, is waited for.
fn never_a_port(port: &PortName) -> Result<(), Failure> {
    match port.resolve().and_then(|path| port::check(&path)) {
        Err(error @ PortError::NotSerial { .. }) => Err(Failure::new(Kind::Unavailable, error.to_string())),
        _ => Ok(()),
    }
}

/// How a live session ended.
pub(super) struct End {
    /// The summary and the faulty sensors, or why the results were not written.
    results: Result<(Summary, Vec<FaultEvent>), Failure>,
    /// What the recording lacks.
    lacking: Losses,
    /// Whether the state for the next session was saved.
    saved: Result<(), Failure>,
}

impl End {
    /// False if there is no map to report.
    fn is_mapped(&self) -> bool {
        self.results.as_ref().is_ok_and(|(summary, _)| summary.nothing_mapped.is_none())
    }

    /// Prints the summary on standard output and logs failures: of the recording, which cannot be made again, of the session, of the results.
    ///
    /// # Errors
    /// When one of them was not written, or nothing was mapped.
    pub(super) fn report(self, output: &OutputArgs) -> Result<(), Failure> {
        let ending = self
            .results
            .and_then(|(summary, faulty)| terminal::report(&summary, &faulty, Some(output.out()), output.json));
        failure::together([recorded(&self.lacking), self.saved, ending])
    }
}

/// Logs what the recording lacks.
///
/// # Errors
/// When it is lost or was not closed.
fn recorded(lacking: &Losses) -> Result<(), Failure> {
    if lacking.chunks > 0 {
        tracing::error!("{} chunks are missing from the recording", lacking.chunks);
    }
    let Some(cause) = &lacking.unfinished else { return Ok(()) };
    let what =
        if lacking.is_gone { "the recording is lost" } else { "the recording was not closed; slamd can still read it" };
    Err(Failure::new(Kind::Io, format!("{cause}: {what}")))
}

impl LiveArgs {
    /// Shows no viewer unless the user asked for one: the monitor already shows the session.
    pub(super) fn off_by_default(&mut self) {
        #[cfg(feature = "viewer")]
        self.viewer.off_by_default();
    }

    /// Serves other programs, and lets them drive with `--drive`.
    fn serve(
        &self,
        guard: &OutputGuard,
        health: &Arc<DiskHealth>,
        config: &Config,
    ) -> Result<(Option<Server>, Option<Steering>), Failure> {
        let desk = self.api.desk()?;
        let server = self.api.begin(guard, health, desk.as_ref())?;
        Ok((server, desk.map(|desk| Steering::new(config, desk))))
    }

    /// Raises the priority of this thread. Those of recorder and viewers exist already and keep theirs.
    fn prioritize(&self) {
        if self.realtime
            && let Err(error) = priority::real_time()
        {
            tracing::warn!("{error}");
        }
    }

    /// Runs a live session to its end; none if it ended before the port was found.
    pub(super) fn drive(
        &self,
        port: &PortName,
        config: Config,
        output: &OutputArgs,
        (runtime, shutdown): (&Runtime, &mut Shutdown),
        observe: &mut Observer<'_>,
    ) -> Result<Option<End>, Failure> {
        never_a_port(port)?;
        let mut guard = output.guard_of_robot()?;
        self.record.claim(&mut guard)?;
        let saves = self.state.outputs(guard)?;
        self.state.check(config.method)?;
        Outputs::check(output.out(), &saves.guard)?;
        let options = Options { port, baud: self.baud, exit_on_hangup: self.exit_on_hangup };
        let health = Arc::<DiskHealth>::default();
        let (server, mut steering) = self.serve(&saves.guard, &health, &config)?;
        let mut taps: Vec<Tap> = server.iter().map(|server| server.tap(&config.robot.name)).collect();
        // Lives until the map has been written.
        #[cfg(feature = "mqtt")]
        let mqtt = self.mqtt.begin(&config.robot.name)?;
        #[cfg(feature = "mqtt")]
        taps.extend(mqtt.iter().map(|mqtt| mqtt.tap(&config.robot.name)));
        let mut service = Service::begin();
        let mut link = Link::new(self.baud);
        // Creates no file and overwrites no recording before the port is open.
        let mut look = |link: &Link| {
            taps.iter_mut().for_each(|tap| tap.look(link, None));
            service.iter_mut().for_each(|service| service.look(link, None));
            steering.iter_mut().for_each(|steering| steering.refuse(Timestamp::default()));
            observe(link, None);
        };
        // From here on there is something to end in order.
        shutdown.at_once(false);
        let port = runtime.block_on(daemon::search(options, &mut link, Timestamp::default, shutdown, &mut look));
        let Some(port) = port.map_err(|error| Failure::new(Kind::Unavailable, error.to_string()))? else {
            service.iter().for_each(Service::stopping);
            return Ok(None);
        };
        let (clock, info) = begin(&config);
        let source = Source { capture: None, began_unix_us: info.unix_zero_us, is_resumed: self.state.is_resumed() };
        let outputs = Outputs::begin(output.out(), source, &saves.guard)?;
        let mut session = self.state.begin(config.clone(), outputs)?;
        let mut saver = saves.saver().map(|saver| saver.with_health(Arc::clone(&health)));
        let mut checkpoints = Checkpoints::new(Arc::clone(&health));
        taps.iter_mut().for_each(|tap| tap.begin(info.unix_zero_us));
        let mut recorder = self.record.begin(info.clone(), health)?;
        #[cfg(feature = "viewer")]
        let watched = self.viewer.begin(&config.robot.name, info.unix_zero_us, &saves.guard)?;
        #[cfg(feature = "viewer")]
        watched.watch(&mut session);
        self.prioritize();
        let live = Live {
            clock,
            session: &mut session,
            recorder: &mut recorder,
            saver: &mut saver,
            checkpoints: &mut checkpoints,
            steering,
        };
        let mut look = |link: &Link, session: Option<&Session>| {
            taps.iter_mut().for_each(|tap| tap.look(link, session));
            service.iter_mut().for_each(|service| service.look(link, session));
            observe(link, session);
        };
        let run = daemon::run(options, port, &mut link, shutdown, live, &mut look);
        runtime.block_on(run);
        service.iter().for_each(Service::stopping);
        session.end();
        drop(server);
        // A failed save does not keep the map from being written.
        let saved = saves.save(saver, &session);
        checkpoints.finish();
        let lacking = recorder.map(Recorder::finish).unwrap_or_default();
        if lacking.chunks > 0 {
            session.doubt(format!("{} chunks are missing from the recording", lacking.chunks));
        }
        let results = session.finish().map_err(|error| outputs::lost(output.out(), &error));
        #[cfg(feature = "viewer")]
        watched.finish()?;
        Ok(Some(End { results, lacking, saved }))
    }
}

/// A single-threaded runtime for port, timers and signals.
pub(super) fn runtime() -> Result<Runtime, Failure> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    runtime.map_err(|error| Failure::new(Kind::Unavailable, format!("tokio: {error}")))
}

/// Starts session time, and describes the session for its recording.
#[expect(clippy::disallowed_methods, reason = "relates session time to the calendar")]
fn begin(config: &Config) -> (SessionClock, CaptureInfo) {
    let clock = SessionClock::begin();
    let since_1970 = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    let info = CaptureInfo {
        slamd_version: env!("CARGO_PKG_VERSION").into(),
        protocol_version: format!("{}.{}", slamd_protocol::VERSION_MAJOR, slamd_protocol::VERSION_MINOR),
        config_toml: config.to_toml(),
        unix_zero_us: since_1970.ok().and_then(|span| u64::try_from(span.as_micros()).ok()),
        notes: String::new(),
        faults: None,
    };
    (clock, info)
}
