//! Options for the saved state that a run starts from and the state that it saves, for a robot and for a replay.

use super::{Failure, Kind};
use crate::session_file::{self, FileError, Saver};
use crate::source::session::Session;
use clap::Args;
use slamd_core::{Config, Method, SavedState, Start};
use std::io::Write as _;
use std::path::{Path, PathBuf};

#[derive(Debug, Default, Args)]
pub(super) struct StateArgs {
    /// Continue with the map, walls, wheels and sensors of this session; the robot must stand where that session ended.
    #[arg(long, value_name = "FILE", conflicts_with = "localize")]
    resume: Option<PathBuf>,
    /// Localize the robot in the map of this session without changing that map; the robot may start anywhere in it.
    #[arg(long, value_name = "FILE", conflicts_with = "save_session")]
    localize: Option<PathBuf>,
    /// Save map, walls, pose, wheels and sensors to this session file at the end; with a robot also every minute.
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

    /// Begins the session from the saved state.
    pub(super) fn begin(&self, config: Config, folder: &Path) -> Result<Session, Failure> {
        let keeps = self.saved().is_some() || self.save_calibration.is_some();
        if config.method == Method::Paper && keeps {
            return Err(Failure::new(
                Kind::Usage,
                "the paper's method has no state that could be saved; use --method walls",
            ));
        }
        if config.method == Method::Paper && (self.resume.is_some() || self.localize.is_some()) {
            return Err(Failure::new(
                Kind::Usage,
                "the paper's method cannot begin with a known map; use --method walls",
            ));
        }
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
        Ok(Session::new(pipeline, folder)?)
    }

    /// Saves the session every minute; none if no session file is named.
    pub(super) fn saver(&self) -> Option<Saver> {
        self.saved().cloned().map(Saver::new)
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

    /// Saves session and calibration at the end, as requested. A failure of one does not prevent the other.
    pub(super) fn save(&self, saver: Option<Saver>, session: &Session) -> Result<(), Failure> {
        let saved = saver.map_or(Ok(()), |saver| saver.finish(session.saved_state()));
        if let (Some(path), Some(config)) = (&self.save_calibration, session.calibrated()) {
            write_robot(path, &config, "slamd --save-calibration")?;
        }
        Ok(saved?)
    }
}

/// Writes a robot's configuration, with the keys that differ from the defaults, completely or not at all.
pub(super) fn write_robot(path: &Path, config: &Config, writer: &str) -> Result<(), Failure> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or_else(|| Path::new("."));
    let write = || -> std::io::Result<()> {
        let mut file = tempfile::NamedTempFile::new_in(folder)?;
        writeln!(file, "# Written by `{writer}`; configs/README.md describes each key.\n")?;
        file.write_all(config.to_toml_differences().as_bytes())?;
        file.as_file().sync_all()?;
        file.persist(path).map(drop).map_err(|error| error.error)
    };
    write().map_err(|error| Failure::new(Kind::CantCreate, format!("{}: {error}", path.display())))
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
