//! `slamd import`: turns a recording into a capture.

use super::{Failure, Kind, config};
use clap::{Args, Subcommand};
use slamd_capture::CaptureError;
use slamd_eval::import::{ImportError, carmen, ring};
use std::fs::File;
use std::io::{self, BufRead, BufReader};
use std::path::{Path, PathBuf};

/// Turn a recording into a capture that `replay` runs.
#[derive(Debug, Args)]
pub(super) struct ImportArgs {
    #[command(subcommand)]
    format: Format,
}

#[derive(Debug, Subcommand)]
enum Format {
    /// A CSV with one row per sweep: t_s,left_ticks,right_ticks,r0,r1,... (metres; `inf`: no echo; empty: no measurement)
    Ring(Recording),
    /// A CARMEN text log: ODOM, FLASER and SONAR lines
    Carmen(Recording),
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
}

impl ImportArgs {
    /// Imports the recording and prints a summary on standard error.
    ///
    /// # Errors
    /// When the recording or the configuration cannot be used or the capture cannot be written.
    pub(super) fn run(self) -> Result<(), Failure> {
        let (Format::Ring(files) | Format::Carmen(files)) = &self.format;
        let config = config::read(&files.config)?;
        let name = files.recording.display().to_string();
        let input = open(&files.recording).map_err(|source| ImportError::Io { file: name.clone(), source })?;
        let summary = match &self.format {
            Format::Ring(_) => ring::import(input, &name, &config, &files.capture),
            Format::Carmen(_) => carmen::import(input, &name, &config, &files.capture),
        }?;
        summary.doubts.iter().for_each(|doubt| tracing::warn!("{name}: {doubt}"));
        for remark in &summary.remarks {
            eprintln!("{name}: {remark}");
        }
        eprintln!("{}: {summary}", files.capture.display());
        Ok(())
    }
}

impl From<ImportError> for Failure {
    fn from(error: ImportError) -> Self {
        let kind = match &error {
            ImportError::Io { source, .. } if source.kind() == io::ErrorKind::NotFound => Kind::NoInput,
            ImportError::Io { .. } => Kind::Io,
            ImportError::Line { .. } | ImportError::Empty { .. } | ImportError::Unit { .. } => Kind::Data,
            ImportError::Config(_) => Kind::Config,
            ImportError::Capture(CaptureError::Io { .. }) => Kind::CantCreate,
            ImportError::Capture(_) => Kind::Data,
        };
        Self::new(kind, error.to_string())
    }
}

fn open(path: &Path) -> io::Result<Box<dyn BufRead>> {
    if path == Path::new("-") {
        return Ok(Box::new(io::stdin().lock()));
    }
    Ok(Box::new(BufReader::new(File::open(path)?)))
}
