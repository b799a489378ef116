//! `slamd replay FILE`

use super::kept::KeptArgs;
use super::{Failure, Kind, OutputArgs, terminal};
use crate::capture::CaptureReader;
use crate::config::Config;
use crate::metrics::TrueFault;
use crate::session_file::Saver;
use crate::source::replay::replay;
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(super) struct ReplayArgs {
    /// A capture (MCAP): recorded with --record, simulated or imported.
    file: PathBuf,
    #[command(flatten)]
    kept: KeptArgs,
    #[command(flatten)]
    output: OutputArgs,
}

impl ReplayArgs {
    pub(super) fn run(self) -> Result<(), Failure> {
        let mut capture = CaptureReader::open(&self.file)?;
        let info = capture.info().clone();
        let embedded =
            if self.output.config.is_some() { Ok(Config::default()) } else { Config::from_toml(&info.config_toml) };
        let embedded = embedded.map_err(|error| {
            Failure::new(
                Kind::Data,
                format!("{}: its configuration: {error}; give one with --config", self.file.display()),
            )
        })?;
        let mut session = self.kept.begin(self.output.configuration(embedded)?, &self.output.out)?;
        if let Some(words) = &info.faults {
            let faults: Result<Vec<TrueFault>, _> = words.iter().map(|word| word.parse()).collect();
            let faults =
                faults.map_err(|error| Failure::new(Kind::Data, format!("{}: {error}", self.file.display())))?;
            session.true_faults(faults);
        }
        let bar = terminal::progress(None);
        replay(&mut capture, &mut session, |seconds| terminal::show(&bar, seconds))?;
        bar.finish_and_clear();
        if let Some(damage) = capture.damage() {
            tracing::warn!("{}: {damage}; what was readable has been used", self.file.display());
        }
        self.kept.save_calibration(&session)?;
        if let Some(path) = &self.kept.save_session {
            Saver::new(path.clone()).finish(session.memory())?;
        }
        let (summary, faulty) = session.finish()?;
        terminal::report(&summary, &faulty, &self.output.out, self.output.json);
        Ok(())
    }
}
