//! `slamd --port DEV`, the same as `slamd run --port DEV`

use super::kept::KeptArgs;
use super::{Failure, Kind, OutputArgs, terminal};
use crate::capture::CaptureInfo;
use crate::config::Config;
use crate::daemon::{self, Files, Options, Shutdown};
use crate::link::Link;
use crate::port::PortName;
use crate::recorder::Recorder;
use crate::session_file::Saver;
use clap::Args;
use std::path::PathBuf;
use std::time::{Duration, Instant};

#[derive(Debug, Args)]
pub(super) struct RunArgs {
    /// The board's serial port: a device, usb:VID:PID[:SERIAL], or auto for the only board there is; `slamd ports` lists them.
    #[arg(long, value_name = "PORT")]
    port: PortName,
    /// Bits per second.
    #[arg(long, default_value_t = 115_200)]
    baud: u32,
    /// Record everything that is read and written to this capture.
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Stop after this long; without it, Ctrl-C stops.
    #[arg(long, value_name = "SECONDS", value_parser = super::seconds)]
    duration: Option<f64>,
    /// Stop when the port hangs up, instead of waiting for its return.
    #[arg(long)]
    exit_on_hangup: bool,
    #[command(flatten)]
    kept: KeptArgs,
    #[command(flatten)]
    output: OutputArgs,
}

impl RunArgs {
    pub(super) fn run(self) -> Result<(), Failure> {
        let config = self.output.configuration(Config::default())?;
        let options = Options { port: &self.port, baud: self.baud, exit_on_hangup: self.exit_on_hangup };
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
        let runtime = runtime.map_err(|error| Failure::new(Kind::Unavailable, format!("tokio: {error}")))?;
        let _guard = runtime.enter();
        let mut shutdown = Shutdown::new(self.duration.map(Duration::from_secs_f64))?;
        let mut link = Link::new(self.baud);
        // Nothing is created, and no older recording overwritten, before the board's port is open.
        let port = runtime.block_on(daemon::search(options, &mut link, &mut shutdown));
        let Some(port) = port.map_err(|trouble| Failure::new(Kind::Unavailable, trouble.to_string()))? else {
            return Ok(());
        };
        let mut session = self.kept.begin(config.clone(), &self.output.out)?;
        let mut saver = self.kept.save_session.clone().map(Saver::new);
        let (begin, info) = begin(&config);
        let mut recorder = match &self.record {
            Some(path) => Some(Recorder::begin(path, &info).map_err(Failure::creating)?),
            None => None,
        };
        let files = Files { recorder: &mut recorder, saver: &mut saver };
        let run = daemon::run(options, port, &mut link, &mut shutdown, &mut session, files, begin);
        let result = runtime.block_on(run);
        // Whatever went wrong, the map is kept.
        let saved = saver.map_or(Ok(()), |saver| saver.finish(session.memory()));
        let calibration = self.kept.save_calibration(&session);
        let (summary, faulty) = session.finish()?;
        terminal::report(&summary, &faulty, &self.output.out, self.output.json);
        if let Some(recorder) = recorder {
            let dropped = recorder.finish()?;
            if dropped > 0 {
                tracing::error!("{dropped} chunks are missing from the recording");
            }
        }
        saved?;
        calibration?;
        Ok(result?)
    }
}

/// The session's time zero, and what its recording says of itself.
#[expect(clippy::disallowed_methods, reason = "anchors the session's time in the calendar")]
fn begin(config: &Config) -> (Instant, CaptureInfo) {
    let begin = Instant::now();
    let since_1970 = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    let info = CaptureInfo {
        slamd_version: env!("CARGO_PKG_VERSION").into(),
        protocol_version: format!("{}.{}", slamd_protocol::VERSION_MAJOR, slamd_protocol::VERSION_MINOR),
        config_toml: config.to_toml(),
        unix_zero_us: since_1970.ok().and_then(|span| u64::try_from(span.as_micros()).ok()),
        notes: String::new(),
        faults: None,
    };
    (begin, info)
}
