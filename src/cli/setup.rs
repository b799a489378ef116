//! `slamd setup`: finds out how a robot is built, and writes its robot.toml.

use super::outputs::ForceArg;
use super::serial::{self, Ended, TimedSetup};
use super::{Failure, Kind, run, terminal};
use crate::daemon::Shutdown;
use crate::port::{self, PortName};
use crate::setup::{Measured, Progress, Setup};
use clap::Args;
use slamd_files::Output;
use std::io::{IsTerminal as _, Write as _};
use std::path::PathBuf;
use tokio_serial::SerialStream;

const HELP: &str = "Examples:
  slamd setup                                  asks and guides; to robot.toml
  slamd setup --port /dev/ttyUSB0 --yes        asks nothing, for scripts
  slamd setup --wheel-radius 0.034 --wheel-base 0.182 --out kitchen.toml
  slamd --port auto --config robot.toml        maps with the result

It finds the number of sensors, the unit of the ranges, swapped or reversed wheels, ticks per turn, wheel base, and a turned or mirrored
ring. Push the robot 30 cm straight ahead, turn it left on the spot by one full turn, then drive it around a room for a few metres. A
robot that drives by itself needs no push, but walls cannot tell swapped wheels from a mirrored ring: then setup asks you to turn its left
wheel forward by hand. The board stores what setup finds out about its encoders; if no file is written, it gets its settings of before.

Exit code: 0 written, 65 the board or the robot is wrong in a way that no configuration mends, 69 the port cannot be used, 73 the file exists.";

/// Find out how a robot is built while it moves, and write its configuration.
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct SetupArgs {
    /// The board's serial port, as `slamd --port` takes it.
    #[arg(long, value_name = "PORT", default_value = "auto")]
    port: PortName,
    /// Bits per second.
    #[arg(long, default_value_t = 115_200)]
    baud: u32,
    /// The file to write.
    #[arg(short, long, value_name = "FILE", default_value = "robot.toml")]
    out: PathBuf,
    #[command(flatten)]
    force: ForceArg,
    /// Ask nothing; the default without a terminal.
    #[arg(short, long)]
    yes: bool,
    /// Measured radius of a driven wheel, metres.
    #[arg(long, value_name = "METRES", value_parser = metres)]
    wheel_radius: Option<f64>,
    /// Measured distance between the driven wheels, metres.
    #[arg(long, value_name = "METRES", value_parser = metres)]
    wheel_base: Option<f64>,
    /// Give up after this time.
    #[arg(long, value_name = "SECONDS", default_value = "300", value_parser = super::seconds)]
    timeout: f64,
}

/// Parses a measure of a robot.
fn metres(text: &str) -> Result<f64, String> {
    let metres = text.parse::<f64>().ok().filter(|metres| (0.005..=3.0).contains(metres));
    metres.ok_or_else(|| "it must be metres from 0.005 to 3".into())
}

impl SetupArgs {
    pub(super) fn run(self) -> Result<(), Failure> {
        let output = self.force.guard().output(&self.out)?;
        let asks = !self.yes && std::io::stdin().is_terminal() && std::io::stderr().is_terminal();
        let mut measured = Measured { wheel_radius_m: self.wheel_radius, wheel_base_m: self.wheel_base };
        if asks {
            ask_measures(&mut measured);
        }
        let runtime = run::runtime()?;
        let _guard = runtime.enter();
        let unusable = |error: &dyn std::fmt::Display| Failure::new(Kind::Unavailable, error.to_string());
        let path = self.port.resolve().map_err(|error| unusable(&error))?;
        let mut stream = port::open(&path, self.baud).map_err(|error| unusable(&error))?;
        let port = path.display().to_string();
        let setup = Setup::new(measured, self.baud, &port, self.timeout).with_person(asks);
        let mut timed = TimedSetup { setup, timeout_s: self.timeout, told: 0 };
        let mut shutdown = Shutdown::new(None)?;
        let ended = runtime.block_on(serial::listen(&mut timed, &mut stream, &mut shutdown, false));
        let written = match (timed.setup.progress(), &ended) {
            (Progress::Done(text), _) => {
                timed.setup.complaints().iter().for_each(terminal::tell);
                runtime.block_on(self.write(output, text, asks, &mut shutdown))
            }
            (Progress::Failed(text), _) => Err(Failure::new(Kind::Data, text.clone())),
            (Progress::Busy, Some(Ended::Gone(text))) => {
                return Err(unusable(&format_args!("{port} went away: {text}; nothing was written")));
            }
            (Progress::Busy, _) => Err(Failure::new(Kind::NothingMapped, "interrupted: nothing was written")),
        };
        if written.is_err() && timed.setup.take_back() {
            runtime.block_on(take_back(&mut timed, &mut stream, &mut shutdown));
        }
        written
    }

    async fn write(&self, output: Output, text: &str, asks: bool, shutdown: &mut Shutdown) -> Result<(), Failure> {
        let name = self.out.display();
        terminal::say(text.trim_end());
        let nothing = |why: &str| Err(Failure::new(Kind::NothingMapped, format!("{why}nothing was written")));
        if asks {
            let answer = answered(format!("Write this to {name}? [Y/n] "));
            let answer = tokio::select! {
                answer = answer => answer.ok().flatten(),
                () = shutdown.requested() => return nothing("interrupted: "),
            };
            if !answer.is_none_or(|answer| "yes".starts_with(&answer)) {
                return nothing("");
            }
        }
        output.write(text.as_bytes())?;
        terminal::say(format_args!("wrote {name}; now: slamd --port {} --config {name}", self.port));
        Ok(())
    }
}

/// Gives the board its settings of before, and says whether it has them.
async fn take_back(timed: &mut TimedSetup, stream: &mut SerialStream, shutdown: &mut Shutdown) {
    let ended = serial::listen(timed, stream, shutdown, true).await;
    let missing = timed.setup.not_taken_back();
    if ended.is_none() && missing.is_empty() {
        return terminal::tell("the board has its settings of before again");
    }
    let names = missing.iter().map(|name| format!("board.{name}")).collect::<Vec<_>>().join(", ");
    terminal::tell(format_args!(
        "the board may not have its settings of before: {names}; `slamd setup` again can mend that"
    ));
}

/// The answer to a question at the terminal, from a thread that may wait for ever.
fn answered(question: String) -> tokio::sync::oneshot::Receiver<Option<String>> {
    let (sender, receiver) = tokio::sync::oneshot::channel();
    std::thread::spawn(move || sender.send(ask(&question)));
    receiver
}

/// Asks for the wheels' measures; Enter leaves one to the walls.
fn ask_measures(measured: &mut Measured) {
    let number = |question: &str, scale: f64| {
        let answer = ask(question)?;
        metres(&(answer.replace(',', ".").parse::<f64>().ok()? * scale).to_string()).ok()
    };
    if measured.wheel_radius_m.is_none() {
        measured.wheel_radius_m = number("Diameter of a wheel, mm (Enter if unknown): ", 0.0005);
    }
    if measured.wheel_base_m.is_none() {
        measured.wheel_base_m = number("Distance between the wheels, mm (Enter if unknown): ", 0.001);
    }
}

/// The answer to a question at the terminal; none if it is empty.
fn ask(question: &str) -> Option<String> {
    let mut terminal = std::io::stderr();
    let _ = write!(terminal, "{question}").and_then(|()| terminal.flush());
    let mut answer = String::new();
    std::io::stdin().read_line(&mut answer).ok()?;
    Some(answer.trim().to_lowercase()).filter(|answer| !answer.is_empty())
}
