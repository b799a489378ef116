//! `slamd monitor`: shows a live session or a capture on a terminal.

mod log;
mod play;
mod sampler;
mod screen;

use super::run::{LiveArgs, runtime};
use super::{Failure, Kind, OutputArgs, api, replay, terminal};
use crate::daemon::Shutdown;
use crate::monitor::{Line, Look};
use crate::port::PortName;
use clap::{ArgGroup, Args};
use log::Log;
use sampler::Sampler;
use screen::Screen;
use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};
use std::time::Duration;
use tokio::runtime::Runtime;

const HELP: &str = "Examples:
  slamd monitor --port auto --record drive.mcap
  slamd monitor --capture replay/flat-paper-faults.mcap --speed 4

Keys: q, Esc and Ctrl-C quit, + and - zoom the map, c centres it on the robot, p pauses the display, ? lists the keys.
Needs 80 columns and 24 rows. Without a UTF-8 locale it draws in ASCII, with NO_COLOR=1 without colours.";

/// Options that only apply to a port.
#[cfg(feature = "viewer")]
const CONFLICTS: [&str; 5] = ["baud", "record", "exit_on_hangup", "viewer", "expose_viewer"];
#[cfg(not(feature = "viewer"))]
const CONFLICTS: [&str; 3] = ["baud", "record", "exit_on_hangup"];

#[cfg(feature = "mqtt")]
const MQTT: [&str; 3] = super::mqtt::NAMES;
#[cfg(not(feature = "mqtt"))]
const MQTT: [&str; 0] = [];

/// Map with a robot or play a capture, and show ring, rates, faults, pose and map on this terminal.
#[derive(Debug, Args)]
#[command(after_help = HELP, group(ArgGroup::new("what").required(true).args(["port", "capture"])))]
pub(super) struct MonitorArgs {
    /// The board's serial port, as `slamd --port` takes it.
    #[arg(long, value_name = "PORT")]
    port: Option<PortName>,
    /// Play this capture instead.
    #[arg(long, value_name = "FILE", conflicts_with_all = CONFLICTS, conflicts_with_all = api::NAMES, conflicts_with_all = MQTT)]
    capture: Option<PathBuf>,
    /// Playback speed as a multiple of real time.
    #[arg(long, value_name = "X", default_value_t = 1.0, value_parser = speed, conflicts_with = "port")]
    speed: f64,
    #[command(flatten)]
    live: LiveArgs,
    /// Stop after this time.
    #[arg(long, value_name = "SECONDS", value_parser = super::seconds)]
    duration: Option<f64>,
    #[command(flatten)]
    output: OutputArgs,
}

impl MonitorArgs {
    pub(super) fn run(mut self) -> Result<(), Failure> {
        usable()?;
        self.live.off_by_default();
        let log = Log::begin();
        let runtime = runtime()?;
        let _guard = runtime.enter();
        let shutdown = Shutdown::new(self.duration.map(Duration::from_secs_f64))?;
        match (&self.capture, &self.port) {
            (Some(capture), _) => self.play(capture, log, &runtime, shutdown),
            (None, Some(port)) => self.watch(port, log, &runtime, shutdown),
            (None, None) => Err(Failure::new(Kind::Usage, "name a port or a capture")),
        }
    }

    fn watch(&self, port: &PortName, log: Log, runtime: &Runtime, mut shutdown: Shutdown) -> Result<(), Failure> {
        let config = self.output.how.of_robot()?;
        let clock = log.clock();
        let mut screen = self.screen(log, &shutdown)?;
        let mut sampler = Sampler::new(&config, screen.slot(), clock);
        let end = self.live.drive(port, config, &self.output, (runtime, &mut shutdown), &mut |link, session| {
            sampler.sample(session, || Line::new(link.state(), link.cause().to_string()));
        });
        // The restored terminal shows the report; a dead terminal gets no output, because a write to it could block for ever.
        match end {
            _ if !screen.close() => Ok(()),
            Ok(Some(end)) => end.report(&self.output),
            Ok(None) => Ok(()),
            Err(failure) => Err(failure),
        }
    }

    fn play(&self, file: &Path, log: Log, runtime: &Runtime, mut shutdown: Shutdown) -> Result<(), Failure> {
        let saves = self.live.state.outputs(self.output.guard_of_recording(file, self.output.out.as_deref()))?;
        // A capture that is only looked at leaves nothing behind, unless the user names a folder.
        let temporary = tempfile::tempdir().map_err(|error| {
            Failure::new(
                Kind::CantCreate,
                format!("a temporary folder: {error}; name one that can be written in TMPDIR"),
            )
        })?;
        let folder = self.output.out.as_deref();
        let outputs = replay::outputs(file, folder.unwrap_or_else(|| temporary.path()), &saves.guard)?;
        let (mut capture, mut session) = replay::open(file, &self.live.state, &self.output.how, outputs)?;
        let clock = log.clock();
        let mut screen = self.screen(log, &shutdown)?;
        let mut sampler = Sampler::new(session.config(), screen.slot(), clock);
        let play = play::play(&mut capture, &mut session, self.speed, &mut shutdown, &mut sampler, file);
        let result = runtime.block_on(play);
        let saver = saves.saver();
        let saved = saves.save(saver, &session);
        let finished = session.finish();
        if !screen.close() {
            return Ok(());
        }
        result?;
        let (summary, faulty) = finished?;
        let ending = terminal::report(&summary, &faulty, folder, self.output.json);
        // A capture may be left before it has a map.
        if let Err(nothing) = ending {
            terminal::say(nothing);
        }
        saved
    }

    fn screen(&self, log: Log, shutdown: &Shutdown) -> Result<Screen, Failure> {
        let look = Look::new(|name| std::env::var(name).ok());
        Screen::open(log, look, shutdown.asked()).map_err(|error| {
            Failure::new(Kind::Unavailable, format!("this terminal cannot be drawn on: {error}; {}", instead()))
        })
    }
}

/// Checks that standard output is a terminal with a movable cursor.
fn usable() -> Result<(), Failure> {
    let why = if !std::io::stdout().is_terminal() {
        "standard output is no terminal"
    } else if std::env::var_os("TERM").is_some_and(|term| term == "dumb") {
        "TERM=dumb: this terminal cannot move its cursor"
    } else {
        return Ok(());
    };
    Err(Failure::new(Kind::Usage, format!("{why}; {}", instead())))
}

fn instead() -> &'static str {
    "`slamd --port PORT` maps without a screen, `slamd inspect FILE` describes a capture"
}

fn speed(text: &str) -> Result<f64, String> {
    let speed = text.parse::<f64>().ok().filter(|speed| (0.01..=1_000.0).contains(speed));
    speed.ok_or_else(|| "it must be from 0.01 to 1000".into())
}
