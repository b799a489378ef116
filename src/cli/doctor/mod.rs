//! `slamd doctor`: examines port and board; each finding comes with a remedy.

mod host;
mod live;

use super::{Failure, Kind, config, terminal};
use crate::doctor::{Examination, Report};
use crate::port::PortName;
use clap::{ArgGroup, Args};
use slamd_capture::CaptureReader;
use std::path::{Path, PathBuf};

const HELP: &str = "Examples:
  slamd doctor --port /dev/ttyUSB0      push the robot 30 cm, turn it left
  slamd doctor --port auto --seconds 30 --json | jq '.findings[].text'
  slamd doctor --capture drive.mcap     examines a recording

Exit code: 0 no problem (perhaps warnings), 65 problems found, 69 the port cannot be used.";

/// Examine port and board; each finding comes with a remedy.
#[derive(Debug, Args)]
#[command(after_help = HELP, group(ArgGroup::new("what").required(true).args(["port", "capture"])))]
pub(super) struct DoctorArgs {
    /// The board's serial port, as `slamd --port` takes it.
    #[arg(long, value_name = "PORT")]
    port: Option<PortName>,
    /// Examine this capture instead.
    #[arg(long, value_name = "FILE")]
    capture: Option<PathBuf>,
    /// Bits per second.
    #[arg(long, default_value_t = 115_200)]
    baud: u32,
    /// Examine the board for this time; longer if other baud rates must be tried.
    #[arg(long, value_name = "N", default_value = "10", value_parser = super::seconds)]
    seconds: f64,
    /// The robot's configuration (TOML), as for `slamd run`.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// The output folder to check.
    #[arg(long, value_name = "DIR", default_value = "slamd-out")]
    out: PathBuf,
    /// Print JSON for programs: findings, sensors, summary.
    #[arg(long)]
    json: bool,
}

impl DoctorArgs {
    pub(super) fn run(self) -> Result<(), Failure> {
        let (report, usable) = match (&self.capture, &self.port) {
            (Some(capture), _) => (self.examine_capture(capture)?, true),
            (None, Some(port)) => live::examine(&self, port)?,
            (None, None) => return Err(Failure::new(Kind::Usage, "name a port or a capture")),
        };
        if self.json {
            let json = serde_json::to_string_pretty(&report);
            terminal::say(json.map_err(|error| Failure::new(Kind::Data, error.to_string()))?);
        } else {
            terminal::say(&report);
        }
        match report.summary.problem {
            _ if !usable => Err(Failure::new(Kind::Unavailable, "the port cannot be used: see its finding")),
            0 => Ok(()),
            1 => Err(Failure::new(Kind::Data, "1 problem found")),
            problems => Err(Failure::new(Kind::Data, format!("{problems} problems found"))),
        }
    }

    fn examine_capture(&self, path: &Path) -> Result<Report, Failure> {
        let mut capture = CaptureReader::open(path)?;
        let config = config::of_replay(self.config.as_deref(), capture.info(), path)?;
        let mut examination = Examination::new(&config, self.baud, &path.display().to_string());
        let bar = terminal::progress(None);
        for record in &mut capture {
            let record = record?;
            terminal::show(&bar, record.at().seconds());
            examination.feed(&record);
        }
        bar.finish_and_clear();
        if let Some(damage) = capture.damage() {
            tracing::warn!("{}: {damage}; what was readable has been examined", path.display());
        }
        Ok(examination.report())
    }
}
