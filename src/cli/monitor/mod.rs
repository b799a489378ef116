//! `slamd monitor`: a live session or a capture, watched on a terminal.

mod log;
mod play;
mod sampler;
mod screen;

use super::run::{LiveArgs, runtime};
use super::{Failure, Kind, OutputArgs, api, replay, terminal};
use crate::daemon::{DaemonError, Shutdown};
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
use tokio::signal::unix::{SignalKind, signal};

const HELP: &str = "Examples:
  slamd monitor --port auto --record drive.mcap
  slamd monitor --capture replay/flat-paper-faults.mcap --speed 4      no robot needed

Keys: q, Esc and Ctrl-C quit, + and - zoom the map, c keeps it about the robot, p pauses the picture, ? tells these.
Needs 80 columns and 24 rows. Without a UTF-8 locale it draws in ASCII, with NO_COLOR=1 without colours.";

/// What only a port has.
#[cfg(feature = "viewer")]
const CONFLICTS: [&str; 5] = ["baud", "record", "exit_on_hangup", "viewer", "expose_viewer"];
#[cfg(not(feature = "viewer"))]
const CONFLICTS: [&str; 3] = ["baud", "record", "exit_on_hangup"];

#[cfg(feature = "mqtt")]
const MQTT: [&str; 3] = super::mqtt::NAMES;
#[cfg(not(feature = "mqtt"))]
const MQTT: [&str; 0] = [];

/// Map with a robot, or play a capture, and watch: ring, rates, faults, pose and map on this terminal.
#[derive(Debug, Args)]
#[command(after_help = HELP, group(ArgGroup::new("what").required(true).args(["port", "capture"])))]
pub(super) struct MonitorArgs {
    /// The board's serial port, as `slamd --port` takes it.
    #[arg(long, value_name = "PORT")]
    port: Option<PortName>,
    /// Play this capture instead.
    #[arg(long, value_name = "FILE", conflicts_with_all = CONFLICTS, conflicts_with_all = api::NAMES, conflicts_with_all = MQTT)]
    capture: Option<PathBuf>,
    /// Play the capture so many times as fast as it was recorded.
    #[arg(long, value_name = "X", default_value_t = 1.0, value_parser = speed, conflicts_with = "port")]
    speed: f64,
    #[command(flatten)]
    live: LiveArgs,
    /// Stop after this long.
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
        heed_hangup(&shutdown)?;
        match (&self.capture, &self.port) {
            (Some(capture), _) => self.play(capture, log, &runtime, shutdown),
            (None, Some(port)) => self.watch(port, log, &runtime, shutdown),
            (None, None) => Err(Failure::new(Kind::Usage, "name a port or a capture")),
        }
    }

    fn watch(&self, port: &PortName, log: Log, runtime: &Runtime, mut shutdown: Shutdown) -> Result<(), Failure> {
        let config = self.output.how.of_robot()?;
        let mut screen = self.screen(log, &shutdown)?;
        let mut sampler = Sampler::new(&config, screen.slot());
        let end = self.live.drive(port, config, &self.output, (runtime, &mut shutdown), &mut |link, session| {
            sampler.sample(session, || Line::new(link.state(), link.cause().to_string()));
        });
        // What is said from here on is for the terminal as it was; to one that takes nothing, nothing is said.
        match end {
            _ if !screen.close() => Ok(()),
            Ok(Some(end)) => end.report(&self.output),
            Ok(None) => Ok(()),
            Err(failure) => Err(failure),
        }
    }

    fn play(&self, file: &Path, log: Log, runtime: &Runtime, mut shutdown: Shutdown) -> Result<(), Failure> {
        let (mut capture, mut session) = replay::open(file, &self.live.kept, &self.output.how, &self.output.out)?;
        let mut screen = self.screen(log, &shutdown)?;
        let mut sampler = Sampler::new(session.config(), screen.slot());
        let play = play::play(&mut capture, &mut session, self.speed, &mut shutdown, &mut sampler, file);
        let result = runtime.block_on(play);
        let saved = self.live.kept.save(self.live.kept.saver(), &session);
        let finished = session.finish();
        if !screen.close() {
            return Ok(());
        }
        result?;
        let (summary, faulty) = finished?;
        terminal::report(&summary, &faulty, &self.output.out, self.output.json);
        saved
    }

    fn screen(&self, log: Log, shutdown: &Shutdown) -> Result<Screen, Failure> {
        let look = Look::new(|name| std::env::var(name).ok());
        Screen::open(log, look, shutdown.asked()).map_err(|error| {
            Failure::new(Kind::Unavailable, format!("this terminal cannot be drawn on: {error}; {}", instead()))
        })
    }
}

/// A screen is a terminal that moves its cursor.
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
    "`slamd --port PORT` maps without a screen, `slamd inspect FILE` tells what is in a capture"
}

/// A terminal that goes away, as at the end of an SSH connection, ends the session as Ctrl-C does: its map is kept.
fn heed_hangup(shutdown: &Shutdown) -> Result<(), DaemonError> {
    let mut hangup = signal(SignalKind::hangup()).map_err(DaemonError)?;
    let asked = shutdown.asked();
    tokio::spawn(async move {
        hangup.recv().await;
        asked.notify_one();
    });
    Ok(())
}

fn speed(text: &str) -> Result<f64, String> {
    let speed = text.parse::<f64>().ok().filter(|speed| (0.01..=1_000.0).contains(speed));
    speed.ok_or_else(|| "it must be from 0.01 to 1000".into())
}
