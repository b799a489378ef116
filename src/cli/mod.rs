//! The command line.

mod api;
mod bench;
mod calibrate;
mod config;
mod doctor;
mod drive;
mod export;
mod failure;
mod import;
mod inspect;
mod log;
mod looks;
#[cfg(feature = "manual")]
mod manual;
mod monitor;
#[cfg(feature = "mqtt")]
mod mqtt;
#[cfg(not(feature = "viewer"))]
mod no_viewer;
mod outputs;
mod ports;
mod record;
mod replay;
mod replay_folder;
mod run;
mod serial;
mod setup;
mod simulate;
mod state_args;
mod terminal;
#[cfg(feature = "viewer")]
mod viewer;

use crate::descriptors;
use clap::{Args, CommandFactory as _, FromArgMatches as _, Parser, Subcommand};
use config::{HowArgs, MethodArg};
pub use failure::{Failure, Kind};
use slamd_files::OutputGuard;
use slamd_publish::RESULTS;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

const EXAMPLES: &str = "Examples:
  slamd --port /dev/ttyUSB0                    map with a robot
  slamd replay replay/flat-paper-faults.mcap   no robot needed; to slamd-out/
  slamd replay recordings/ --out maps          all captures of a folder
  slamd export drive.mcap --mcap bag.mcap      for ROS 2 and Foxglove
  slamd simulate --seed 1 --duration 120 --faults paper --capture drive.mcap
  slamd simulate --pty robot & slamd --port robot --record drive.mcap";

/// Maps a building with a robot that has a ring of ultrasonic sensors and two wheel encoders.
#[derive(Debug, Parser)]
#[command(version, about, after_help = EXAMPLES, override_usage = "slamd --port <DEV> [OPTIONS]\n       slamd <COMMAND>")]
struct Cli {
    /// Format of the log on standard error: text, or one JSON object per line. RUST_LOG filters the log (docs/cli.md).
    #[arg(long, global = true, value_enum, value_name = "FORMAT", default_value = "text", env = "SLAMD_LOG_FORMAT")]
    log_format: log::Format,
    /// Log more: -v debugging, -vv everything. It overrides RUST_LOG.
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    verbose: u8,
    /// Log warnings and errors only. It overrides RUST_LOG.
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    quiet: bool,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Map with a robot on a serial port (the default command).
    Run(run::RunArgs),
    Monitor(monitor::MonitorArgs),
    /// Replay a recorded or simulated session as fast as possible, or all captures of a folder.
    Replay(replay::ReplayArgs),
    /// Simulate a robot: write a capture or serve a pseudo-terminal.
    Simulate(Box<simulate::SimulateArgs>),
    /// Convert a recording of another robot to a capture.
    Import(import::ImportArgs),
    Calibrate(calibrate::CalibrateArgs),
    Export(export::ExportArgs),
    /// Describe a capture: messages, rates, gaps, faults.
    Inspect(inspect::InspectArgs),
    /// List the serial ports and the programs that hold them.
    Ports(ports::PortsArgs),
    Drive(drive::DriveArgs),
    Setup(setup::SetupArgs),
    Doctor(doctor::DoctorArgs),
    Config(config::ConfigCommand),
    /// Evaluate with simulated drives: tables and pictures.
    Bench(bench::BenchArgs),
    #[cfg(feature = "manual")]
    Completions(manual::CompletionsArgs),
    #[cfg(feature = "manual")]
    Man(manual::ManArgs),
}

/// Options of the output and the estimator, for a robot and for a replay.
#[derive(Debug, Args)]
pub(crate) struct OutputArgs {
    /// Folder for map, picture, trajectory, faults and summary [default: slamd-out].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    force: outputs::ForceArg,
    #[command(flatten)]
    how: HowArgs,
    /// Print the summary as JSON instead of text.
    #[arg(long)]
    json: bool,
}

impl OutputArgs {
    /// The folder for the results.
    fn out(&self) -> &Path {
        self.out.as_deref().unwrap_or_else(|| Path::new("slamd-out"))
    }

    /// A guard that knows the configuration files of a robot and the results.
    fn guard_of_robot(&self) -> Result<OutputGuard, Failure> {
        let files = self.how.files_of_robot()?;
        Ok(self.force.guard().reads_all(files.iter().map(PathBuf::as_path)).fills(self.out(), &RESULTS))
    }

    /// A guard that knows a recording, its configuration file and the results, if `folder` holds them afterwards.
    fn guard_of_recording(&self, recording: &Path, folder: Option<&Path>) -> OutputGuard {
        let guard = self.force.guard().reads(recording).reads_all(self.how.named());
        folder.into_iter().fold(guard, |guard, folder| guard.fills(folder, &RESULTS))
    }
}

/// Runs the program with the process's arguments.
#[must_use]
pub fn main() -> ExitCode {
    descriptors::raise_limit();
    let cli = match command().try_get_matches_from(arguments()).and_then(|matches| Cli::from_arg_matches(&matches)) {
        Ok(cli) => cli,
        Err(error) => return usage_error(&error),
    };
    // The monitor uses the whole screen and shows the log in a part of it.
    let is_monitor = matches!(cli.command, Command::Monitor(_));
    let format = if is_monitor { log::Format::Text } else { cli.log_format };
    if !is_monitor {
        let is_live = matches!(cli.command, Command::Run(_));
        log::begin(format, log::level(cli.verbose, cli.quiet), is_live);
    }
    let failures = [cli.command.run(), terminal::taken()].into_iter().filter_map(Result::err);
    // Where the output is lost, the reader of the exit code has not read what it says of the command.
    let code = failures.fold(ExitCode::SUCCESS, |_, failure| {
        log::end(format, &failure);
        ExitCode::from(failure.kind as u8)
    });
    log::finish();
    code
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
            Self::Drive(args) => args.run(),
            Self::Setup(args) => args.run(),
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

/// The command line. Variables set options of `run` only: in other commands they could conflict with options that the user gave.
fn command() -> clap::Command {
    looks::dressed(Cli::command()).mut_subcommand("run", |run| {
        config::OPTIONS.iter().fold(run, |run, (option, variable)| run.mut_arg(option, |arg| arg.env(variable)))
    })
}

/// Prints why the arguments are invalid, or the requested help or version.
fn usage_error(error: &clap::Error) -> ExitCode {
    let printed = error.print();
    if !error.use_stderr() {
        terminal::note(printed);
        return match terminal::taken() {
            Ok(()) => ExitCode::SUCCESS,
            Err(failure) => {
                terminal::tell(format_args!("slamd: {failure}"));
                ExitCode::from(failure.kind as u8)
            }
        };
    }
    // A required option may be missing because its variable is misspelt.
    config::unknown().iter().for_each(|text| terminal::tell(format_args!("slamd: {text}")));
    ExitCode::from(Kind::Usage as u8)
}

/// Parses a duration in seconds.
fn seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse::<f64>().ok().filter(|seconds| (0.0..=1e7).contains(seconds));
    seconds.ok_or_else(|| "it must be seconds from 0 to 10,000,000".into())
}

/// Parses a standard deviation.
fn spread(text: &str) -> Result<f64, String> {
    let spread = text.parse::<f64>().ok().filter(|spread| (0.0..=30.0).contains(spread));
    spread.ok_or_else(|| "it must be from 0 to 30".into())
}

/// Parses a probability.
fn probability(text: &str) -> Result<f64, String> {
    let probability = text.parse::<f64>().ok().filter(|probability| (0.0..=1.0).contains(probability));
    probability.ok_or_else(|| "it must be from 0 to 1".into())
}

/// The process's arguments; options without a command belong to `run`.
fn arguments() -> Vec<OsString> {
    with_command(std::env::args_os().collect())
}

fn with_command(mut arguments: Vec<OsString>) -> Vec<OsString> {
    let word = |index: usize| arguments.get(index).and_then(|word| word.to_str()).unwrap_or_default();
    // Global options may precede the command.
    let mut index = 1;
    loop {
        index += match word(index) {
            "--log-format" => 2,
            "-v" | "-vv" | "--verbose" | "-q" | "--quiet" => 1,
            first if first.starts_with("--log-format=") => 1,
            _ => break,
        };
    }
    if word(index).starts_with('-') && !["-h", "--help", "-V", "--version"].contains(&word(index)) {
        arguments.insert(index, "run".into());
    }
    arguments
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        command().debug_assert();
    }

    #[test]
    fn options_without_a_command_are_those_of_run() {
        let with_command = |line: &str| {
            let arguments = with_command(line.split(' ').map(OsString::from).collect());
            arguments.iter().map(|word| word.to_string_lossy()).collect::<Vec<_>>().join(" ")
        };
        assert_eq!(with_command("slamd --port auto"), "slamd run --port auto");
        assert_eq!(with_command("slamd --log-format json --port auto"), "slamd --log-format json run --port auto");
        assert_eq!(with_command("slamd --log-format=json --port auto"), "slamd --log-format=json run --port auto");
        assert_eq!(with_command("slamd -q --port auto"), "slamd -q run --port auto");
        for line in
            ["slamd", "slamd --help", "slamd replay --json x", "slamd --log-format json -v replay x", "slamd -q"]
        {
            assert_eq!(with_command(line), line);
        }
    }
}
