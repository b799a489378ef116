//! The command line.

mod api;
mod bench;
mod calibrate;
mod config;
mod doctor;
mod export;
mod failure;
mod import;
mod inspect;
mod log;
#[cfg(feature = "manual")]
mod manual;
mod monitor;
#[cfg(feature = "mqtt")]
mod mqtt;
mod ports;
mod record;
mod replay;
mod replay_folder;
mod run;
mod simulate;
mod state_args;
mod terminal;
#[cfg(feature = "viewer")]
mod viewer;

use clap::{Args, CommandFactory as _, FromArgMatches as _, Parser, Subcommand};
use config::{HowArgs, MethodArg};
pub use failure::{Failure, Kind};
use std::ffi::OsString;
use std::path::PathBuf;
use std::process::ExitCode;

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
    /// How the log on standard error looks: text for people, or a JSON object on each line. RUST_LOG says what is logged (docs/cli.md).
    #[arg(long, global = true, value_enum, value_name = "FORMAT", default_value = "text", env = "SLAMD_LOG_FORMAT")]
    log_format: log::Format,
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
    Config(config::ConfigCommand),
    /// Evaluate: tables and pictures over simulated drives.
    Bench(bench::BenchArgs),
    #[cfg(feature = "manual")]
    Completions(manual::CompletionsArgs),
    #[cfg(feature = "manual")]
    Man(manual::ManArgs),
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

/// Runs the program with the process's arguments.
#[must_use]
pub fn main() -> ExitCode {
    let cli = match command().try_get_matches_from(arguments()).and_then(|matches| Cli::from_arg_matches(&matches)) {
        Ok(cli) => cli,
        Err(error) => return misunderstood(&error),
    };
    // The monitor has the screen for itself, and its log in a part of it.
    let is_monitor = matches!(cli.command, Command::Monitor(_));
    let format = if is_monitor { log::Format::Text } else { cli.log_format };
    if !is_monitor {
        log::begin(format);
    }
    match cli.command.run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            log::end(format, &failure);
            ExitCode::from(failure.kind as u8)
        }
    }
}

impl Command {
    fn run(self) -> Result<(), Failure> {
        match self {
            Self::Run(args) => args.run(),
            Self::Monitor(args) => args.run(),
            Self::Replay(args) => args.run(),
            Self::Simulate(args) => args.run(),
            Self::Import(args) => args.run(),
            Self::Calibrate(args) => args.run(),
            Self::Export(args) => args.run(),
            Self::Inspect(args) => args.run(),
            Self::Ports(args) => args.run(),
            Self::Doctor(args) => args.run(),
            Self::Config(args) => args.run(),
            Self::Bench(args) => args.run(),
            #[cfg(feature = "manual")]
            Self::Completions(args) => {
                args.run(command());
                Ok(())
            }
            #[cfg(feature = "manual")]
            Self::Man(args) => args.run(command()),
        }
    }
}

/// The command line. Variables stand for options of `run` alone: with them the other commands would conflict with what nobody has typed.
fn command() -> clap::Command {
    Cli::command().mut_subcommand("run", |run| {
        config::OPTIONS.iter().fold(run, |run, (option, variable)| run.mut_arg(option, |arg| arg.env(variable)))
    })
}

/// Says why the arguments cannot be understood, or what was asked for: help, the version.
fn misunderstood(error: &clap::Error) -> ExitCode {
    let _ = error.print();
    if !error.use_stderr() {
        return ExitCode::SUCCESS;
    }
    // An option may be missing because its variable is misspelt.
    config::unknown().iter().for_each(|words| eprintln!("slamd: {}", terminal::plain(words)));
    ExitCode::from(Kind::Usage as u8)
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
    with_command(std::env::args_os().collect())
}

fn with_command(mut arguments: Vec<OsString>) -> Vec<OsString> {
    let word = |place: usize| arguments.get(place).and_then(|word| word.to_str()).unwrap_or_default();
    // An option of all commands may stand before any.
    let place = match word(1) {
        "--log-format" => 3,
        first if first.starts_with("--log-format=") => 2,
        _ => 1,
    };
    if word(place).starts_with('-') && !["-h", "--help", "-V", "--version"].contains(&word(place)) {
        arguments.insert(place, "run".into());
    }
    arguments
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_sound() {
        command().debug_assert();
    }

    #[test]
    fn options_without_a_command_are_those_of_run() {
        let with_command = |line: &str| {
            let words = with_command(line.split(' ').map(OsString::from).collect());
            words.iter().map(|word| word.to_string_lossy()).collect::<Vec<_>>().join(" ")
        };
        assert_eq!(with_command("slamd --port auto"), "slamd run --port auto");
        assert_eq!(with_command("slamd --log-format json --port auto"), "slamd --log-format json run --port auto");
        assert_eq!(with_command("slamd --log-format=json --port auto"), "slamd --log-format=json run --port auto");
        for line in ["slamd", "slamd --help", "slamd replay --json x", "slamd --log-format json replay x"] {
            assert_eq!(with_command(line), line);
        }
    }
}
