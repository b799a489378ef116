//! `lock.csv`: when the robot lost its pose and found it again, and since when its poses were uncertain.

use super::WriteError;
use slamd_core::{LocalizationChange, LocalizationEvent, Timestamp};
use slamd_files::{CompleteFile, PartFile};
use std::fs::File;
use std::path::Path;

/// The file being written, and what it comes to.
pub(super) struct LockLog {
    file: PartFile,
    losses: u64,
    uncertain_s: f64,
    /// Since when the poses are uncertain, while they are.
    open_since: Option<Timestamp>,
}

impl LockLog {
    pub(super) fn create(folder: &Path) -> Result<Self, WriteError> {
        let mut file = PartFile::create(&folder.join("lock.csv"))?;
        file.append(b"t_s,change,uncertain_since_s\n");
        Ok(Self { file, losses: 0, uncertain_s: 0.0, open_since: None })
    }

    pub(super) fn append(&mut self, event: &LocalizationEvent) {
        let change = match event.change {
            LocalizationChange::Lost => "lost",
            LocalizationChange::Regained { .. } => "regained",
            LocalizationChange::Doubted { .. } => "doubted",
            LocalizationChange::Trusted => "trusted",
            // The search in a known map goes to `summary.json`.
            LocalizationChange::KnownMap(_) => return,
        };
        if event.is_lost() {
            self.losses += u64::from(event.change == LocalizationChange::Lost);
            self.open_since.get_or_insert(event.since);
        } else {
            let since = self.open_since.take().map_or(event.since, |open| open.min(event.since));
            self.uncertain_s += event.at.seconds_since(since);
        }
        let line = format!("{:.6},{change},{:.6}\n", event.at.seconds(), event.since.seconds());
        self.file.append(line.as_bytes());
    }

    /// How often the pose was lost.
    pub(super) const fn losses(&self) -> u64 {
        self.losses
    }

    /// Seconds of uncertain poses. What has not ended counts to the last pose, `last`.
    pub(super) fn uncertain_s(&self, last: Option<Timestamp>) -> f64 {
        let open_s = self.open_since.zip(last).map_or(0.0, |(since, last)| last.seconds_since(since).max(0.0));
        self.uncertain_s + open_s
    }

    /// Since when the poses are uncertain, if they are.
    pub(super) const fn open_since(&self) -> Option<Timestamp> {
        self.open_since
    }

    /// Gives the file its name while it grows.
    pub(super) fn publish(&mut self) -> Result<File, WriteError> {
        self.file.publish()
    }

    /// Completes the file. Poses that are uncertain to the end get a line without a time.
    pub(super) fn complete(mut self) -> Result<CompleteFile, WriteError> {
        if let Some(since) = self.open_since {
            self.file.append(format!(",open,{:.6}\n", since.seconds()).as_bytes());
        }
        self.file.complete()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_not_ended_counts_to_the_last_pose() {
        let folder = tempfile::tempdir().unwrap();
        let at = |s: u64| Timestamp::from_us(1_000_000 * s);
        let mut log = LockLog::create(folder.path()).unwrap();
        let mut event = |at_s, since_s, change| {
            log.append(&LocalizationEvent { at: at(at_s), since: at(since_s), change });
        };
        event(12, 10, LocalizationChange::Lost);
        event(20, 10, LocalizationChange::Regained { moved_m: 1.0, turned_rad: 0.0 });
        event(32, 30, LocalizationChange::Lost);
        assert!((log.uncertain_s(Some(at(100))) - 80.0).abs() < 1e-9);
        assert_eq!((log.losses(), log.open_since()), (2, Some(at(30))));
        log.complete().unwrap().name().unwrap();
        let text = std::fs::read_to_string(folder.path().join("lock.csv")).unwrap();
        assert_eq!(text.lines().last(), Some(",open,30.000000"));
        assert_eq!(text.lines().nth(2), Some("20.000000,regained,10.000000"));
    }
}
