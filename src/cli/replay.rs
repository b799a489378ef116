//! `slamd replay FILE`

use super::kept::KeptArgs;
use super::{Failure, Kind, OutputArgs, terminal};
use crate::capture::CaptureReader;
use crate::config::Config;
use crate::metrics::TrueFault;
use crate::source::replay::replay;
use crate::source::session::Session;
use clap::Args;
use std::path::{Path, PathBuf};

#[derive(Debug, Args)]
pub(super) struct ReplayArgs {
    /// A capture (MCAP): recorded with --record, simulated or imported.
    file: PathBuf,
    #[command(flatten)]
    kept: KeptArgs,
    #[cfg(feature = "viewer")]
    #[command(flatten)]
    viewer: super::viewer::ReplayViewerArgs,
    #[command(flatten)]
    output: OutputArgs,
}

impl ReplayArgs {
    pub(super) fn run(self) -> Result<(), Failure> {
        let (mut capture, mut session) = open(&self.file, &self.kept, &self.output)?;
        #[cfg(feature = "viewer")]
        let watched = {
            let name = self.file.file_stem().unwrap_or_default().to_string_lossy();
            let watched = self.viewer.begin(&name, capture.info().unix_zero_us)?;
            watched.watch(&mut session);
            watched
        };
        let bar = terminal::progress(None);
        replay(&mut capture, &mut session, |seconds| terminal::show(&bar, seconds))?;
        bar.finish_and_clear();
        if let Some(damage) = capture.damage() {
            tracing::warn!("{}: {damage}; what was readable has been used", self.file.display());
        }
        let saved = self.kept.save(self.kept.saver(), &session);
        let (summary, faulty) = session.finish()?;
        terminal::report(&summary, &faulty, &self.output.out, self.output.json);
        #[cfg(feature = "viewer")]
        watched.finish()?;
        saved
    }
}

/// A capture and the session that it is fed to.
pub(super) fn open(file: &Path, kept: &KeptArgs, output: &OutputArgs) -> Result<(CaptureReader, Session), Failure> {
    let capture = CaptureReader::open(file)?;
    let info = capture.info().clone();
    let embedded = if output.config.is_some() { Ok(Config::default()) } else { Config::from_toml(&info.config_toml) };
    let embedded = embedded.map_err(|error| {
        Failure::new(Kind::Data, format!("{}: its configuration: {error}; give one with --config", file.display()))
    })?;
    let mut session = kept.begin(output.configuration(embedded)?, &output.out)?;
    if let Some(words) = &info.faults {
        let faults: Result<Vec<TrueFault>, _> = words.iter().map(|word| word.parse()).collect();
        let faults = faults.map_err(|error| Failure::new(Kind::Data, format!("{}: {error}", file.display())))?;
        session.true_faults(faults);
    }
    Ok((capture, session))
}
