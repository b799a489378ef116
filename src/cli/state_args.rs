//! Options for the saved state that a run starts from and the state that it saves, for a robot and for a replay.

use super::{Failure, Kind, failure};
use crate::session_file::{self, FileError, Saver};
use crate::source::session::Session;
use clap::Args;
use slamd_core::{Config, Method, SavedState, Start};
use slamd_files::{Output, OutputGuard, Refusal};
use slamd_publish::Outputs;
use std::path::{Path, PathBuf};

#[derive(Debug, Default, Args)]
pub(super) struct StateArgs {
    /// Continue with the map, walls, wheels and sensors of this session; the robot must stand where that session ended.
    #[arg(long, value_name = "FILE", conflicts_with = "localize")]
    resume: Option<PathBuf>,
    /// Localize the robot in the map of this session without changing that map; the robot may start anywhere in it.
    #[arg(long, value_name = "FILE", conflicts_with = "save_session")]
    localize: Option<PathBuf>,
    /// Save map, walls, pose, wheels and sensors to this session file at the end; with a robot also every ten seconds.
    #[arg(long, value_name = "FILE")]
    save_session: Option<PathBuf>,
    /// --resume and --save-session in one, for a robot that is switched off and on: continue this session, or begin it if the file does not exist.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["resume", "localize", "save_session"])]
    session: Option<PathBuf>,
    /// Save the calibrated wheels to this robot configuration, for --config.
    #[arg(long, value_name = "FILE")]
    save_calibration: Option<PathBuf>,
}

impl StateArgs {
    /// True if any of these options is given.
    pub(super) fn is_any(&self) -> bool {
        let paths = [&self.resume, &self.localize, &self.save_session, &self.session, &self.save_calibration];
        paths.iter().any(|path| path.is_some())
    }

    /// Checks the files to be saved before the run begins. `guard` knows the other inputs.
    pub(super) fn outputs(&self, guard: OutputGuard) -> Result<Saves, Failure> {
        let mut guard = guard.reads_all([&self.resume, &self.localize].into_iter().filter_map(Option::as_deref));
        let session = self.save_session.as_deref().map(|path| guard.output(path)).transpose();
        let session = session.map_err(|refusal| match refusal {
            Refusal::Input(path) if self.resume.is_some() => {
                let name = path.display();
                Failure::new(
                    Kind::Usage,
                    format!("{name} would be written over; --session {name} continues a session in its own file"),
                )
            }
            other => other.into(),
        })?;
        // A session that is continued takes the place of its own file.
        let continued = self.session.as_deref().map(|path| guard.output_replacing(path, |_| true)).transpose()?;
        let calibration = self.save_calibration.as_deref().map(|path| guard.output(path)).transpose()?;
        Ok(Saves { session: session.or(continued), calibration, guard })
    }

    /// True if the run continues a saved session.
    pub(super) fn is_resumed(&self) -> bool {
        self.resume.is_some() || self.session.as_ref().is_some_and(|path| path.exists())
    }

    /// Checks before the wait for a port what a run would refuse at its beginning. The state is read again then: another run may save it
    /// meanwhile.
    pub(super) fn check(&self, method: Method) -> Result<(), Failure> {
        self.fits(method)?;
        let session = self.session.as_ref().filter(|path| path.exists());
        let mut known = [&self.resume, &self.localize].into_iter().filter_map(Option::as_ref).chain(session);
        known.try_for_each(|path| Ok(session_file::read(path).map(drop)?))
    }

    /// Checks that the method can do what is asked.
    fn fits(&self, method: Method) -> Result<(), Failure> {
        let keeps = self.saved().is_some() || self.save_calibration.is_some();
        if method == Method::Paper && keeps {
            return Err(Failure::new(
                Kind::Usage,
                "the paper's method has no state that could be saved; use --method walls",
            ));
        }
        if method == Method::Paper && (self.resume.is_some() || self.localize.is_some()) {
            return Err(Failure::new(
                Kind::Usage,
                "the paper's method cannot begin with a known map; use --method walls",
            ));
        }
        Ok(())
    }

    /// Begins the session from the saved state.
    pub(super) fn begin(&self, config: Config, outputs: Outputs) -> Result<Session, Failure> {
        self.fits(config.method)?;
        let load = |path: &Path| -> Result<Box<SavedState>, Failure> { Ok(Box::new(session_file::read(path)?)) };
        let (start, path) = match (self.resumed()?, &self.localize) {
            (Some(path), _) => (Start::Resume(load(path)?), Some(path)),
            (None, Some(path)) => (Start::Localize(load(path)?), Some(path)),
            (None, None) => (Start::Fresh, None),
        };
        let pipeline = slamd_paper::pipeline(&config, start).map_err(|error| {
            let file = path.map_or_else(String::new, |path| format!("{}: ", path.display()));
            Failure::new(Kind::Data, format!("{file}{error}"))
        })?;
        Ok(Session::begin(pipeline, outputs))
    }

    /// The session file to write.
    fn saved(&self) -> Option<&PathBuf> {
        self.save_session.as_ref().or(self.session.as_ref())
    }

    /// The session file to resume. A file that cannot be accessed is an error, because a new session would overwrite it.
    fn resumed(&self) -> Result<Option<&PathBuf>, Failure> {
        let Some(path) = &self.session else { return Ok(self.resume.as_ref()) };
        match path.try_exists() {
            Ok(true) => Ok(Some(path)),
            Ok(false) => {
                tracing::info!("{}: no session file yet; starting a new session", path.display());
                Ok(None)
            }
            Err(error) => Err(Failure::new(Kind::Io, format!("{}: {error}", path.display()))),
        }
    }
}

/// The files that a run saves for the next.
pub(super) struct Saves {
    session: Option<Output>,
    calibration: Option<Output>,
    /// Knows all inputs of the run.
    pub(super) guard: OutputGuard,
}

impl Saves {
    /// Saves the session while the run goes on; none if no session file is named.
    pub(super) fn saver(&self) -> Option<Saver> {
        self.session.as_ref().map(|output| Saver::new(output.path().to_owned()))
    }

    /// Saves session and calibration at the end, as requested. A failure of one does not prevent the other.
    pub(super) fn save(self, saver: Option<Saver>, session: &Session) -> Result<(), Failure> {
        let state = session.saved_state();
        // Without a map nothing has been learnt of the wheels.
        let calibrated = state.is_some().then(|| session.calibrated()).flatten();
        let saved = saver.map_or(Ok(()), |saver| saver.finish(state));
        let calibrated = match (self.calibration, calibrated) {
            (Some(output), Some(config)) => write_robot(output, &config, "slamd --save-calibration"),
            (Some(output), None) => {
                tracing::warn!("{}: not written, because there is no calibration to save yet", output.path().display());
                Ok(())
            }
            (None, _) => Ok(()),
        };
        failure::together([saved.map_err(Failure::from), calibrated])
    }
}

/// Writes a robot's configuration, with the keys that differ from the defaults, completely or not at all.
pub(super) fn write_robot(output: Output, config: &Config, writer: &str) -> Result<(), Failure> {
    let head = format!("# Written by `{writer}`; configs/README.md describes each key.\n\n");
    let text = head + &config.to_toml_differences();
    output.write(text.as_bytes()).map_err(|error| Failure::new(Kind::CantCreate, error.to_string()))
}

impl From<FileError> for Failure {
    fn from(error: FileError) -> Self {
        let kind = match &error {
            FileError::Io { source, .. } if source.kind() == std::io::ErrorKind::NotFound => Kind::NoInput,
            FileError::Io { .. } => Kind::Io,
            FileError::Content { .. } => Kind::Data,
        };
        Self::new(kind, error.to_string())
    }
}
