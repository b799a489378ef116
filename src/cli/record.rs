//! `--record` and its options.

use super::{Failure, Kind};
use crate::recorder::{DiskHealth, Folder, Plan, Recorder};
use clap::Args;
use slamd_capture::CaptureInfo;
use slamd_files::OutputGuard;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

#[derive(Debug, Args)]
pub(super) struct RecordArgs {
    /// Record all traffic of the port to this capture; in a folder (DIR/) a new capture begins every hour.
    #[arg(long, value_name = "FILE|DIR/")]
    record: Option<PathBuf>,
    /// Begin a new capture after this many minutes. The default is 60 in a folder (DIR/) without --record-mib; a FILE goes on to the end.
    #[arg(long, value_name = "MINUTES", requires = "record", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    record_minutes: Option<u32>,
    /// Begin a new capture at this size.
    #[arg(long, value_name = "MIB", requires = "record", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    record_mib: Option<u32>,
    /// Keep only this many captures of the recording and delete older ones. The default keeps all.
    #[arg(long, value_name = "N", requires = "record", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    record_keep: Option<u32>,
    /// Pause the recording while less is free on the disk.
    #[arg(long, value_name = "MIB", requires = "record", default_value_t = 100)]
    record_free_mib: u32,
}

const MIB: u64 = 1 << 20;
const HOUR: u32 = 60;

impl RecordArgs {
    /// Keeps the names of the recording and of its further parts from the command's other outputs.
    pub(super) fn claim(&self, guard: &mut OutputGuard) -> Result<(), Failure> {
        let Some(path) = &self.record else { return Ok(()) };
        if is_folder(path) {
            guard.claim_series(path, ["slamd-".into(), ".mcap".into()]);
            return Ok(());
        }
        guard.claim(path)?;
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or_else(|| Path::new("."));
        guard.claim_series(folder, [format!("{stem}-"), ".mcap".into()]);
        Ok(())
    }

    /// Begins the recording; none without --record.
    pub(super) fn begin(&self, info: CaptureInfo, health: Arc<DiskHealth>) -> Result<Option<Recorder>, Failure> {
        let Some(path) = &self.record else { return Ok(None) };
        let is_folder = is_folder(path);
        let minutes = self.record_minutes.or_else(|| (is_folder && self.record_mib.is_none()).then_some(HOUR));
        let plan = Plan {
            most_bytes: self.record_mib.map(|mib| u64::from(mib) * MIB),
            most_time: minutes.map(|minutes| Duration::from_secs(60 * u64::from(minutes))),
            keep: self.record_keep,
            keep_free_bytes: u64::from(self.record_free_mib) * MIB,
        };
        let folder = if is_folder {
            // The names sort by start time.
            let name = format!("slamd-{:010}", info.unix_zero_us.unwrap_or_default() / 1_000_000);
            Folder::numbered(path, &name).map_err(|error| {
                Failure::new(
                    Kind::CantCreate,
                    format!("{}: {error}; name a folder that can be written", path.display()),
                )
            })?
        } else {
            Folder::file(path)
        };
        Recorder::begin(folder, info, plan, health).map(Some).map_err(Failure::creating)
    }
}

/// True if the recording's files get their names from its start.
fn is_folder(path: &Path) -> bool {
    path.is_dir() || path.as_os_str().as_encoded_bytes().ends_with(b"/")
}
