//! `slamd replay FILE|DIR`

use super::replay_folder::replay_folder;
use super::state_args::StateArgs;
use super::{Failure, HowArgs, Kind, OutputArgs, failure, terminal};
use crate::source::replay::replay;
use crate::source::session::Session;
use clap::Args;
use slamd_capture::CaptureReader;
use slamd_files::OutputGuard;
use slamd_metrics::TrueFault;
use slamd_publish::{Outputs, Source, Summary};
use std::path::{Path, PathBuf};

#[derive(Debug, Args)]
pub(super) struct ReplayArgs {
    /// A capture (MCAP): recorded with --record, simulated or imported; or a folder of captures, each replayed into its own folder in --out.
    file: PathBuf,
    /// Number of captures of a folder to replay at once [default: one per core].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
    #[command(flatten)]
    state: StateArgs,
    #[cfg(feature = "viewer")]
    #[command(flatten)]
    viewer: super::viewer::ReplayViewerArgs,
    #[cfg(not(feature = "viewer"))]
    #[command(flatten)]
    _viewer: super::no_viewer::NoViewerArgs,
    #[command(flatten)]
    output: OutputArgs,
}

impl ReplayArgs {
    pub(super) fn run(self) -> Result<(), Failure> {
        if self.file.is_dir() {
            return self.run_folder();
        }
        let saves = self.state.outputs(self.output.guard_of_recording(&self.file, Some(self.output.out())))?;
        let outputs = outputs(&self.file, self.output.out(), &saves.guard)?;
        let (mut capture, mut session) = open(&self.file, &self.state, &self.output.how, outputs)?;
        #[cfg(feature = "viewer")]
        let watched = {
            let name = self.file.file_stem().unwrap_or_default().to_string_lossy();
            let watched = self.viewer.begin(&name, capture.info().unix_zero_us, &saves.guard)?;
            watched.watch(&mut session);
            watched
        };
        let bar = terminal::progress(None);
        replay(&mut capture, &mut session, |seconds| terminal::show(&bar, seconds))?;
        bar.finish_and_clear();
        if let Some(damage) = capture.damage() {
            tracing::warn!("{}: {damage}; what was readable has been used", self.file.display());
            session.doubt(format!("the capture is damaged: {damage}"));
        }
        let saver = saves.saver();
        let saved = saves.save(saver, &session);
        let folder = self.output.out();
        let results = session.finish().map_err(|error| super::outputs::lost(folder, &error));
        let ending = results.and_then(|(summary, faulty)| {
            terminal::report(&summary, &faulty, Some(folder), self.output.json)
                .map_err(|failure| of_capture(&self.file, &summary, failure))
        });
        #[cfg(feature = "viewer")]
        watched.finish()?;
        failure::together([saved, ending])
    }

    fn run_folder(&self) -> Result<(), Failure> {
        #[cfg(feature = "viewer")]
        let is_watched = self.viewer.is_any();
        #[cfg(not(feature = "viewer"))]
        let is_watched = super::no_viewer::NoViewerArgs::is_any();
        if self.state.is_any() || is_watched {
            let text = format!(
                "{} is a folder: --resume, --localize, --save-session, --session, --save-calibration and --viewer need a single capture",
                self.file.display()
            );
            return Err(Failure::new(Kind::Usage, text));
        }
        replay_folder(&self.file, self.jobs.map(usize::from), &self.output)
    }
}

/// Why a capture gave no map. One without a frame has the wrong content.
pub(super) fn of_capture(file: &Path, summary: &Summary, failure: Failure) -> Failure {
    let kind = if summary.frames == 0 { Kind::Data } else { failure.kind };
    Failure::new(kind, format!("{}: {failure}", file.display()))
}

/// The outputs of a replay, in `folder`.
pub(super) fn outputs(file: &Path, folder: &Path, guard: &OutputGuard) -> Result<Outputs, Failure> {
    let began_unix_us = CaptureReader::open(file)?.info().unix_zero_us;
    let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let source = Source { capture: Some(name), began_unix_us, is_resumed: false };
    Ok(Outputs::begin(folder, source, guard)?)
}

/// Opens a capture, and a session for it.
pub(super) fn open(
    file: &Path,
    state: &StateArgs,
    how: &HowArgs,
    outputs: Outputs,
) -> Result<(CaptureReader, Session), Failure> {
    let capture = CaptureReader::open(file)?;
    let info = capture.info().clone();
    let mut session = state.begin(how.of_recording(&info, file)?, outputs)?;
    if let Some(texts) = &info.faults {
        let faults: Result<Vec<TrueFault>, _> = texts.iter().map(|text| text.parse()).collect();
        let faults = faults.map_err(|error| Failure::new(Kind::Data, format!("{}: {error}", file.display())))?;
        session.true_faults(faults);
    }
    Ok((capture, session))
}
