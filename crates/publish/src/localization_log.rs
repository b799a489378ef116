//! `lock.csv`: when the robot lost its pose and found it again, and since when its poses were uncertain.

use super::WriteError;
use slamd_core::{LocalizationChange, LocalizationEvent};
use slamd_files::PartFile;
use std::path::Path;

/// The file being written, and what it comes to.
pub(super) struct LockLog {
    file: PartFile,
    losses: u64,
    uncertain_s: f64,
}

impl LockLog {
    pub(super) fn create(folder: &Path) -> Result<Self, WriteError> {
        let mut file = PartFile::create(&folder.join("lock.csv"))?;
        file.append(b"t_s,change,uncertain_since_s\n");
        Ok(Self { file, losses: 0, uncertain_s: 0.0 })
    }

    pub(super) fn append(&mut self, event: &LocalizationEvent) {
        let change = match event.change {
            LocalizationChange::Lost => "lost",
            LocalizationChange::Regained { .. } => "regained",
            LocalizationChange::Abandoned => "abandoned",
            LocalizationChange::Doubted { .. } => "doubted",
            LocalizationChange::Trusted => "trusted",
            // The search in a known map goes to `summary.json`.
            LocalizationChange::KnownMap(_) => return,
        };
        if event.is_lost() {
            self.losses += 1;
        } else {
            self.uncertain_s += event.at.seconds_since(event.since);
        }
        let line = format!("{:.6},{change},{:.6}\n", event.at.seconds(), event.since.seconds());
        self.file.append(line.as_bytes());
    }

    /// How often the pose was lost.
    pub(super) const fn losses(&self) -> u64 {
        self.losses
    }

    /// Seconds of uncertain poses that have come to an end.
    pub(super) const fn uncertain_s(&self) -> f64 {
        self.uncertain_s
    }

    pub(super) fn finish(self) -> Result<(), WriteError> {
        self.file.finish().map(drop)
    }
}
