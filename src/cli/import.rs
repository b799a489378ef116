//! `slamd import`: turns a recording into a capture.

use super::outputs::{ForceArg, imported_from};
use super::{Failure, Kind, config};
use clap::{Args, Subcommand};
use slamd_capture::CaptureError;
use slamd_eval::import::{
    Columns, Counting, Drive, ImportError, Options, RangeUnit, Scan, Summary, TimeUnit, bag, carmen, ring,
};
use slamd_files::{OutputGuard, Refusal, regular};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

const EXAMPLES: &str = "Examples:
  slamd import ring drive.csv --config robot.toml --capture drive.mcap
  slamd import ring drive.csv --config robot.toml --capture drive.mcap \\
      --time-unit ms --range-unit cm --no-echo 0
  slamd import ring log.csv --config robot.toml --capture drive.mcap \\
      --columns t_s=millis,left_ticks=encL,right_ticks=encR --time-unit ms
  slamd import bag rosbag2_drive/ --config robot.toml --capture drive.mcap
  slamd import carmen fr079.log.gz --config robot.toml --capture fr079.mcap

Files may be gzipped or in UTF-16, with commas, semicolons, tabs or spaces,
decimal points or commas, stamps in seconds or as dates and times, and with
usual names of columns such as millis, encL, sonar_1. docs/cli.md has all that
is read.";

/// Turn a recording into a capture that `replay` runs.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct ImportArgs {
    #[command(subcommand)]
    format: Format,
}

#[derive(Debug, Subcommand)]
enum Format {
    /// A CSV with one row per sweep: t_s,left_ticks,right_ticks,r0,r1,... (metres; `inf`: no echo; empty: no measurement)
    Ring(RingArgs),
    /// A CARMEN text log: ODOM, SONAR, ROBOTLASER1 and FLASER lines
    Carmen(CarmenArgs),
    /// A ROS 2 bag (MCAP or SQLite, a file or its folder): Range or LaserScan, with JointState or Odometry
    Bag(Recording),
}

#[derive(Debug, Args)]
struct Recording {
    /// The recording; `-` reads standard input
    recording: PathBuf,
    /// The robot's configuration, with its ring and `robot.ticks_per_turn`
    #[arg(long, value_name = "ROBOT.toml")]
    config: PathBuf,
    /// The capture to write
    #[arg(long, value_name = "FILE")]
    capture: PathBuf,
    #[command(flatten)]
    force: ForceArg,
    /// A reading that means "no echo", as it stands in the recording: a number, or a text in a ring CSV, `empty` for cells without anything; may be repeated
    #[arg(long, value_name = "VALUE", allow_negative_numbers = true)]
    no_echo: Vec<String>,
    /// The run to import where a file has several, from 1
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    run: Option<u16>,
}

#[derive(Debug, Args)]
struct RingArgs {
    #[command(flatten)]
    recording: Recording,
    /// What the columns hold: `t_s,-,left_ticks,right_ticks,r0-r15` in order, or `t_s=time,r0=front` by the header's names
    #[arg(long, value_name = "LIST")]
    columns: Option<Columns>,
    /// The unit of the ranges: m, cm, mm, dm, in, ft, or us for microseconds of flight, there and back
    #[arg(long, value_name = "UNIT")]
    range_unit: Option<RangeUnit>,
    /// The unit of the stamps: s, ms, us or ns
    #[arg(long, value_name = "UNIT")]
    time_unit: Option<TimeUnit>,
    /// What the encoders' cells hold: counts since the start, deltas since the row before [default: which of both is found out], or metres,
    /// millimetres, turns, radians or degrees of the wheels since the start
    #[arg(long, value_name = "WHAT")]
    ticks: Option<Counting>,
}

#[derive(Debug, Args)]
struct CarmenArgs {
    #[command(flatten)]
    recording: Recording,
    /// The lines to use where a log has several kinds of ranges: sonar, robotlaser1 or flaser [default: the first]
    #[arg(long, value_name = "KIND")]
    scan: Option<Scan>,
}

impl ImportArgs {
    /// Imports the recording and prints a summary on standard error.
    ///
    /// # Errors
    /// When the recording or the configuration cannot be used or the capture cannot be written.
    pub(super) fn run(self) -> Result<(), Failure> {
        let (files, mut options) = match &self.format {
            Format::Ring(args) => {
                let options = Options {
                    columns: args.columns.clone(),
                    range_unit: args.range_unit,
                    time_unit: args.time_unit,
                    counting: args.ticks,
                    ..Options::default()
                };
                (&args.recording, options)
            }
            Format::Carmen(args) => (&args.recording, Options { scan: args.scan, ..Options::default() }),
            Format::Bag(recording) => (recording, Options::default()),
        };
        for value in &files.no_echo {
            match value.parse() {
                Ok(number) if f64::is_finite(number) => options.no_echo.push(number),
                _ => options.no_echo_words.push(value.clone()),
            }
        }
        if let (Some(word), false) = (options.no_echo_words.first(), matches!(self.format, Format::Ring(_))) {
            let text = format!("--no-echo {word}: only the cells of a ring CSV may be texts; name a number");
            return Err(Failure::new(Kind::Usage, text));
        }
        options.run = files.run.map(usize::from);
        let is_standard_input = files.recording == Path::new("-");
        let input_path = if is_standard_input { Path::new("/dev/stdin") } else { &files.recording };
        let mut guard = files.force.guard().reads(&files.config).reads(input_path);
        guard.check(&files.capture)?;
        let config = config::read(&files.config)?;
        let name = files.recording.display().to_string();
        let input = || -> Result<Box<dyn Read>, ImportError> {
            if is_standard_input {
                return Ok(Box::new(io::stdin().lock()));
            }
            let file = regular::open(input_path).map_err(|source| ImportError::Io { file: name.clone(), source })?;
            Ok(Box::new(file))
        };
        let drive = match &self.format {
            Format::Ring(_) => ring::read(input()?, &name, &config, &options),
            Format::Carmen(_) => carmen::read(input()?, &name, &config, &options),
            Format::Bag(_) => bag::read(input_path, &config, &options),
        }?;
        drive.doubts().iter().for_each(|doubt| tracing::warn!("{name}: {doubt}"));
        let say = |remark: &String| super::terminal::tell(format_args!("{name}: {remark}"));
        drive.remarks().iter().for_each(say);
        let said = drive.remarks().len();
        let summary = write(drive, &mut guard, &files.capture, is_standard_input)?;
        summary.remarks.iter().skip(said).for_each(say);
        super::terminal::tell(format_args!("{}: {summary}", files.capture.display()));
        Ok(())
    }
}

/// Writes the capture. A whole recording takes the place of its own earlier capture; that of another recording is kept under another name.
fn write(drive: Drive, guard: &mut OutputGuard, path: &Path, is_pipe: bool) -> Result<Summary, Failure> {
    let mut there = Earlier::None;
    let output = guard.output_replacing(path, |path| {
        there = if drive.is_whole() { Earlier::at(path, drive.notes(), is_pipe) } else { Earlier::None };
        there != Earlier::None
    })?;
    let kept = if there == Earlier::Other { Some(keep(path)?) } else { None };
    let written = drive.write(output);
    if let (Err(_), Some(kept)) = (&written, &kept) {
        // The capture is still there.
        let _ = std::fs::remove_file(kept);
    }
    let summary = written?;
    let capture = path.display();
    match (there, kept) {
        (Earlier::Same, _) => {
            super::terminal::tell(format_args!("{capture}: replaces an earlier capture of this recording"))
        }
        (_, Some(kept)) => super::terminal::tell(format_args!(
            "{capture}: the capture of another recording that was here is now {}",
            kept.display()
        )),
        _ => {}
    }
    Ok(summary)
}

/// What is in the way of a capture and may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Earlier {
    None,
    /// The same recording's capture.
    Same,
    /// The capture of another recording.
    Other,
}

impl Earlier {
    fn at(path: &Path, notes: &str, is_pipe: bool) -> Self {
        match imported_from(path) {
            None => Self::None,
            // What came through a pipe has no name.
            Some(there) if there == notes && !is_pipe => Self::Same,
            Some(_) => Self::Other,
        }
    }
}

/// Gives the file a second name, under which it stays.
fn keep(path: &Path) -> Result<PathBuf, Failure> {
    let (stem, extension) = (path.file_stem().unwrap_or_default(), path.extension().unwrap_or_default());
    for number in 1..10_000 {
        let name = format!("{}.earlier-{number:04}.{}", stem.to_string_lossy(), extension.to_string_lossy());
        let kept = path.with_file_name(name.trim_end_matches('.'));
        match std::fs::hard_link(path, &kept) {
            Ok(()) => return Ok(kept),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            Err(_) => break,
        }
    }
    Err(Refusal::Exists(path.into()).into())
}

impl From<ImportError> for Failure {
    fn from(error: ImportError) -> Self {
        let kind = match &error {
            ImportError::Io { source, .. } if source.kind() == io::ErrorKind::NotFound => Kind::NoInput,
            ImportError::Io { .. } => Kind::Io,
            ImportError::Line { .. }
            | ImportError::Empty { .. }
            | ImportError::Problem { .. }
            | ImportError::Foreign { .. } => Kind::Data,
            ImportError::Config(_) => Kind::Config,
            ImportError::Capture(CaptureError::Io { .. }) => Kind::CantCreate,
            ImportError::Capture(_) => Kind::Data,
        };
        let is_pipe = matches!(&error, ImportError::Io { source, .. } if source.to_string().contains("it is a pipe"));
        let hint = if is_pipe { "; name `-`, and slamd reads standard input: `slamd import ... - < PIPE`" } else { "" };
        Self::new(kind, format!("{error}{hint}"))
    }
}
