//! The command line.

mod api;
mod bench;
mod calibrate;
mod doctor;
mod export;
mod failure;
mod import;
mod inspect;
mod kept;
mod monitor;
#[cfg(feature = "mqtt")]
mod mqtt;
mod ports;
mod record;
mod replay;
mod replay_folder;
mod run;
mod simulate;
mod terminal;
#[cfg(feature = "viewer")]
mod viewer;

use clap::{Args, Parser, Subcommand};
pub use failure::{Failure, Kind};
use std::ffi::OsString;
use std::io::IsTerminal as _;
use std::path::PathBuf;
use std::process::ExitCode;
use tracing::Level;
use tracing_subscriber::filter::Targets;
use tracing_subscriber::layer::SubscriberExt as _;
use tracing_subscriber::util::SubscriberInitExt as _;

const EXAMPLES: &str = "Examples:
  slamd --port /dev/ttyUSB0                       map with a robot
  slamd replay replay/flat-paper-faults.mcap      no robot needed: leaves a map in slamd-out/
  slamd replay recordings/ --out maps             every capture of a folder, on all cores, and a table
  slamd export drive.mcap --mcap bag.mcap         for ROS 2 and Foxglove
  slamd simulate --world flat --seed 1 --duration 120 --faults paper --capture drive.mcap
  slamd simulate --world office --pty robot & slamd --port robot --record drive.mcap";

/// Maps a home with a ring of ultrasonic sensors and two wheel encoders.
#[derive(Debug, Parser)]
#[command(version, about, after_help = EXAMPLES, override_usage = "slamd --port <DEV> [OPTIONS]\n       slamd <COMMAND>")]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Map with a robot on a serial port (the same as without a command).
    Run(run::RunArgs),
    Monitor(monitor::MonitorArgs),
    /// Run a recorded or simulated session again, as fast as it goes, or all those of a folder at once.
    Replay(replay::ReplayArgs),
    /// Drive a simulated robot, into a capture or on a pseudo-terminal.
    Simulate(Box<simulate::SimulateArgs>),
    /// Turn a recording of another robot into a capture.
    Import(import::ImportArgs),
    Calibrate(calibrate::CalibrateArgs),
    Export(export::ExportArgs),
    /// Tell what is in a capture: messages, rates, gaps, faults.
    Inspect(inspect::InspectArgs),
    /// List the serial ports and who holds them.
    Ports(ports::PortsArgs),
    Doctor(doctor::DoctorArgs),
    /// Evaluate: tables and pictures over simulated drives.
    Bench(bench::BenchArgs),
}

/// Where results go and how they are made; the same for a robot and for a replay.
#[derive(Debug, Args)]
pub(crate) struct OutputArgs {
    /// Folder for map, picture, trajectory, faults and summary.
    #[arg(long, value_name = "DIR", default_value = "slamd-out")]
    out: PathBuf,
    #[command(flatten)]
    how: HowArgs,
    /// Print the summary as JSON instead of words.
    #[arg(long)]
    json: bool,
}

/// How results are made.
#[derive(Debug, Args)]
pub(crate) struct HowArgs {
    /// How heading, position and map are found.
    #[arg(long, value_enum)]
    method: Option<MethodArg>,
    /// Robot configuration (TOML); see configs/README.md.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum MethodArg {
    Walls,
    Paper,
}

impl HowArgs {
    /// The configuration file's, or else `base`, with the method of the command line.
    fn configuration(&self, base: crate::config::Config) -> Result<crate::config::Config, Failure> {
        let mut config = match &self.config {
            Some(path) => load_config(path)?,
            None => base,
        };
        match self.method {
            Some(MethodArg::Walls) => config.method = crate::config::Method::Walls,
            Some(MethodArg::Paper) => config.method = crate::config::Method::Paper,
            None => {}
        }
        Ok(config)
    }
}

/// Reads a configuration file.
pub(crate) fn load_config(path: &std::path::Path) -> Result<crate::config::Config, Failure> {
    let text = std::fs::read_to_string(path)
        .map_err(|error| Failure::new(Kind::NoInput, format!("{}: {error}; name an existing file", path.display())))?;
    crate::config::Config::from_toml(&text)
        .map_err(|error| Failure::new(Kind::Config, format!("{}: {error}", path.display())))
}

/// Runs the program with the process's arguments.
#[must_use]
pub fn main() -> ExitCode {
    let cli = match Cli::try_parse_from(arguments()) {
        Ok(cli) => cli,
        Err(error) => {
            let code = if error.use_stderr() { Kind::Usage as u8 } else { 0 };
            let _ = error.print();
            return ExitCode::from(code);
        }
    };
    // The monitor has the screen for itself, and its log in a part of it.
    if !matches!(cli.command, Command::Monitor(_)) {
        let lines = tracing_subscriber::fmt::layer()
            .with_writer(std::io::stderr)
            .with_ansi(std::io::stderr().is_terminal())
            .with_target(false);
        tracing_subscriber::registry().with(log_filter()).with(lines).with(for_viewers()).init();
    }
    let result = match cli.command {
        Command::Run(args) => args.run(),
        Command::Monitor(args) => args.run(),
        Command::Replay(args) => args.run(),
        Command::Simulate(args) => args.run(),
        Command::Import(args) => args.run().map_err(Failure::from),
        Command::Calibrate(args) => args.run(),
        Command::Export(args) => args.run(),
        Command::Inspect(args) => args.run().map_err(Failure::from),
        Command::Ports(args) => args.run(),
        Command::Doctor(args) => args.run(),
        Command::Bench(args) => args.run(),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("slamd: {}", terminal::plain(&failure));
            ExitCode::from(failure.kind as u8)
        }
    }
}

/// What is logged: as `RUST_LOG` says, by level and module, such as `warn` or `info,slamd::recorder=debug`.
fn log_filter() -> Targets {
    let asked = std::env::var("RUST_LOG").ok().filter(|asked| !asked.trim().is_empty());
    let asked = asked.and_then(|asked| {
        let filter = asked.parse();
        filter.inspect_err(|error| eprintln!("slamd: RUST_LOG={asked}: {error}; info is logged")).ok()
    });
    // Rerun's modules are named re_something.
    asked.unwrap_or_else(|| Targets::new().with_default(Level::INFO).with_target("re_", Level::ERROR))
}

/// What takes the log to the viewers, if this build has any.
#[cfg(feature = "viewer")]
const fn for_viewers() -> crate::viewer::LogLayer {
    crate::viewer::LogLayer
}

#[cfg(not(feature = "viewer"))]
fn for_viewers() -> tracing_subscriber::layer::Identity {
    tracing_subscriber::layer::Identity::new()
}

/// A length of time.
fn seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse::<f64>().ok().filter(|seconds| (0.0..=1e7).contains(seconds));
    seconds.ok_or_else(|| "it must be seconds from 0 to 10,000,000".into())
}

/// A standard deviation.
fn spread(text: &str) -> Result<f64, String> {
    let spread = text.parse::<f64>().ok().filter(|spread| (0.0..=30.0).contains(spread));
    spread.ok_or_else(|| "it must be from 0 to 30".into())
}

/// A probability.
fn probability(text: &str) -> Result<f64, String> {
    let probability = text.parse::<f64>().ok().filter(|probability| (0.0..=1.0).contains(probability));
    probability.ok_or_else(|| "it must be from 0 to 1".into())
}

/// The process's arguments; options without a command are those of `run`.
fn arguments() -> Vec<OsString> {
    let mut arguments: Vec<OsString> = std::env::args_os().collect();
    let first = arguments.get(1).and_then(|first| first.to_str()).unwrap_or_default();
    if first.starts_with('-') && !["-h", "--help", "-V", "--version"].contains(&first) {
        arguments.insert(1, "run".into());
    }
    arguments
}
