//! `slamd inspect`: says what is in a capture.

use super::terminal;
use clap::Args;
use std::path::PathBuf;

/// Say what is in a capture: frames, losses, gaps, sensors, wheels, damage.
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
    pub(super) fn run(self) -> anyhow::Result<()> {
        let report = crate::inspect::inspect(&self.capture)?;
        let text = if self.json { serde_json::to_string_pretty(&report)? } else { report.to_string() };
        terminal::say(text);
        Ok(())
    }
}
