//! `slamd inspect`: describes a capture.

use super::{Failure, Kind, terminal};
use clap::Args;
use std::path::PathBuf;

/// Describe a capture: frames, losses, gaps, sensors, wheels, damage.
#[derive(Debug, Args)]
pub(super) struct InspectArgs {
    /// The capture
    capture: PathBuf,
    /// Print JSON for programs
    #[arg(long)]
    json: bool,
}

impl InspectArgs {
    /// Prints the report.
    ///
    /// # Errors
    /// When the capture cannot be read at all.
    pub(super) fn run(self) -> Result<(), Failure> {
        let report = crate::inspect::inspect(&self.capture)?;
        if self.json {
            let json = serde_json::to_string_pretty(&report);
            terminal::say(json.map_err(|error| Failure::new(Kind::Data, error.to_string()))?);
        } else {
            terminal::say(report);
        }
        Ok(())
    }
}
