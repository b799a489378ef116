//! What a live run writes while it goes on, so that a power cut costs no more than the time since.

use super::map_file::map_files;
use super::{FinalState, Outputs, Sketch, Surroundings, WriteError};
use slamd_core::{Raster, Ring, SensorState};
use slamd_files::complete_file;
use std::fs::File;
use std::path::PathBuf;

/// A copy of the run's map and path, to be written by another thread than the pipeline's.
pub struct Checkpoint {
    folder: PathBuf,
    raster: Raster,
    ring: Ring,
    states: Vec<SensorState>,
    sketch: Sketch,
    doubts: Vec<String>,
    robot_name: String,
    config_toml: String,
    began_unix_us: Option<u64>,
    /// The files that have grown.
    grown: Vec<File>,
    moved: Option<PathBuf>,
}

impl Outputs {
    /// Copies the map and gives the trajectories and logs their names, once something is mapped; before that, nothing is changed.
    /// `summary.json` comes only with [`Outputs::finish`].
    ///
    /// # Errors
    /// When the earlier results cannot be moved away, or a file cannot be renamed.
    pub fn checkpoint(&mut self, state: &FinalState<'_>) -> Result<Option<Checkpoint>, WriteError> {
        let summary = self.summary(state);
        if summary.nothing_mapped.is_some() {
            return Ok(None);
        }
        let is_first = !self.folder.is_taken();
        let moved = self.folder.take()?;
        if is_first {
            let kept: Vec<&str> =
                super::RESULTS.into_iter().filter(|name| !["summary.json", "truth.tum"].contains(name)).collect();
            self.folder.remove_others(&kept)?;
        }
        let mut grown = vec![self.trajectory.publish()?, self.odometry.publish()?];
        grown.extend([self.fault_log.publish()?, self.lock_log.publish()?]);
        if let Some(truth) = &mut self.truth {
            grown.push(truth.publish()?);
        }
        Ok(Some(Checkpoint {
            folder: self.folder.path().into(),
            raster: state.raster.clone(),
            ring: state.ring.clone(),
            states: state.states.to_vec(),
            sketch: self.sketch_of(state),
            doubts: summary.doubtful,
            robot_name: state.config.robot.name.clone(),
            config_toml: state.config.to_toml(),
            began_unix_us: self.folder.source().began_unix_us,
            grown,
            moved,
        }))
    }
}

impl Checkpoint {
    /// Where the results of an earlier drive are now, if they had to make room.
    #[must_use]
    pub const fn moved(&self) -> Option<&PathBuf> {
        self.moved.as_ref()
    }

    /// Writes the map and its pictures, and waits until everything is on the disk.
    ///
    /// # Errors
    /// When a file cannot be written. The older file is then unchanged.
    pub fn write(self) -> Result<(), WriteError> {
        for file in self.grown {
            file.sync_data().map_err(|source| WriteError { path: self.folder.clone(), source })?;
        }
        let around = Surroundings {
            raster: &self.raster,
            ring: &self.ring,
            states: &self.states,
            robot_name: &self.robot_name,
            doubts: &self.doubts,
            began_unix_us: self.began_unix_us,
        };
        let name = "map.png";
        let drawing = self.sketch.drawing(around);
        let picture = drawing.png().map_err(|source| WriteError { path: self.folder.join(name), source })?;
        let [pgm, yaml] = map_files(&self.folder, "map", &self.raster)?;
        let files = [
            pgm,
            yaml,
            complete_file(&self.folder, name, &picture)?,
            complete_file(&self.folder, "map.svg", drawing.svg().as_bytes())?,
            complete_file(&self.folder, "config.toml", self.config_toml.as_bytes())?,
        ];
        files.into_iter().try_for_each(|file| file.name().map(drop))
    }
}
