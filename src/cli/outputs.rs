//! `--force`, and what of a command's outputs may take the place of existing files.

use super::{Failure, Kind};
use clap::Args;
use slamd_capture::{CaptureInfo, CaptureReader};
use slamd_files::{OutputGuard, Refusal};
use slamd_publish::{FolderError, RESULTS, WriteError};
use std::path::Path;

/// Whether existing files may be replaced.
#[derive(Clone, Copy, Debug, Default, Args)]
pub(super) struct ForceArg {
    /// Replace existing files and results. The command's own inputs are never replaced.
    #[arg(long)]
    force: bool,
}

impl ForceArg {
    /// The guard of a command's outputs.
    pub(super) const fn guard(self) -> OutputGuard {
        OutputGuard::new(self.force)
    }
}

/// What a capture was imported from, by its notes; none if the file is another one.
pub(super) fn imported_from(path: &Path) -> Option<String> {
    let notes = CaptureReader::open(path).ok()?.info().notes.clone();
    notes.starts_with("imported from ").then_some(notes)
}

/// True if the file is the drive that the simulator describes so.
pub(super) fn is_same_drive(path: &Path, wanted: &CaptureInfo) -> bool {
    let there = CaptureReader::open(path).ok();
    there.is_some_and(|there| there.info().notes == wanted.notes && there.info().faults == wanted.faults)
}

/// The results of a run could not be written: which of them the folder does not have.
pub(super) fn lost(folder: &Path, error: &WriteError) -> Failure {
    // Only a simulated drive has true poses.
    let is_lost = |name: &&str| *name != "truth.tum" && folder.join(name).symlink_metadata().is_err();
    let lost: Vec<&str> = RESULTS.iter().copied().filter(is_lost).collect();
    let what = if lost.is_empty() {
        "the results are those of an earlier moment".into()
    } else {
        format!("lost: {}", lost.join(", "))
    };
    let text = format!("{}: {what}: {error}; choose a folder that can be written with --out", folder.display());
    Failure::new(Kind::CantCreate, text)
}

impl From<Refusal> for Failure {
    fn from(refusal: Refusal) -> Self {
        let kind = if refusal.is_usage() { Kind::Usage } else { Kind::CantCreate };
        let hint = if matches!(refusal, Refusal::Write(_)) { "; name a file that can be written" } else { "" };
        Self::new(kind, format!("{refusal}{hint}"))
    }
}

impl From<FolderError> for Failure {
    fn from(error: FolderError) -> Self {
        match error {
            FolderError::Refused(refusal) => refusal.into(),
            FolderError::Write(error) => error.into(),
            other => Self::new(Kind::CantCreate, other.to_string()),
        }
    }
}
