//! The output folder: maps, trajectories, faults and a summary, each file whole or absent.

mod checkpoint;
mod ending;
mod fault_log;
mod folder;
mod localization_log;
mod map_file;
mod model_log;
mod picture;
mod plan;
mod pose_table;
mod sketch;
mod summary;
mod track;
mod trajectory;

pub use checkpoint::Checkpoint;
pub use folder::{FolderError, RESULTS, Source};
pub use map_file::{FREE_PERCENT, OCCUPIED_PERCENT, grey, grey_png, write_map};
pub use model_log::{ModelReport, Remedy};
pub use pose_table::PoseTable;
pub use sketch::{Drawing, Sketch, Surroundings};
pub use slamd_files::WriteError;
use slamd_files::{CompleteFile, OutputGuard, complete_file};
pub use summary::{EncoderFault, KnownMapPosition, Latency, Summary};
pub use trajectory::Trajectory;

use fault_log::FaultLog;
use folder::ResultFolder;
use localization_log::LockLog;
use map_file::map_files;
use slamd_core::{
    Calibration, Config, Counters, EncoderState, Estimate, Event, LocalizationChange, Method, Pose2, Raster, Ring,
    SensorState, Timestamp, Waiting, Wheel,
};
use slamd_metrics::{AccuracyMeter, FaultMeter, TrueFault};
use std::io;
use std::path::Path;
use std::time::Duration;
use summary::Timings;
use track::Track;

/// What is known only at the end of a run.
pub struct FinalState<'a> {
    /// The effective configuration, written as `config.toml`.
    pub config: &'a Config,
    /// The map.
    pub raster: &'a Raster,
    /// Where the sensors sit.
    pub ring: &'a Ring,
    /// The sensors' states, by id.
    pub states: &'a [SensorState],
    /// What was counted.
    pub counters: Counters,
    /// The wheels, where the method estimates them.
    pub calibration: Option<Calibration>,
    /// How many walls are known.
    pub walls: usize,
    /// What the method waits for, while it has no pose.
    pub waiting: Option<Waiting>,
    /// Session time at the end.
    pub ended: Timestamp,
}

/// The files of one run. Trajectories and faults are written while it goes on, under temporary names; memory stays constant.
pub struct Outputs {
    folder: ResultFolder,
    trajectory: Trajectory,
    odometry: Trajectory,
    truth: Option<Trajectory>,
    fault_log: FaultLog,
    lock_log: LockLog,
    sketch: Sketch,
    truth_path: Track,
    accuracy: AccuracyMeter,
    faults: Option<FaultMeter>,
    encoders: [Option<EncoderFault>; 2],
    position: Option<KnownMapPosition>,
    timings: Timings,
    delays: Timings,
    doubts: Vec<String>,
    model: Vec<ModelReport>,
}

impl Outputs {
    /// Creates the folder, if it is not there, and begins the files. Earlier results are replaced at the end.
    ///
    /// # Errors
    /// When another run uses the folder, or something cannot be created.
    pub fn create(folder: &Path) -> Result<Self, FolderError> {
        Self::begin(folder, Source::default(), &OutputGuard::new(true))
    }

    /// Checks whether a run with a robot could begin in the folder now. Creates nothing.
    ///
    /// # Errors
    /// When another run uses the folder, a file in it is an input, or it cannot be written.
    pub fn check(folder: &Path, guard: &OutputGuard) -> Result<(), FolderError> {
        ResultFolder::check(folder, guard)
    }

    /// Creates the folder, if it is not there, and begins the files of a run from `source`. Until [`Outputs::checkpoint`] or
    /// [`Outputs::finish`] nothing that the folder holds is changed.
    ///
    /// # Errors
    /// When another run uses the folder, it holds what must be kept, a file in it is an input, or something cannot be created.
    pub fn begin(folder: &Path, source: Source, guard: &OutputGuard) -> Result<Self, FolderError> {
        let results = ResultFolder::open(folder, source, guard)?;
        Ok(Self {
            folder: results,
            trajectory: Trajectory::create(&folder.join("trajectory.tum"))?,
            odometry: Trajectory::create(&folder.join("odometry.tum"))?,
            fault_log: FaultLog::create(folder)?,
            lock_log: LockLog::create(folder)?,
            truth: None,
            sketch: Sketch::default(),
            truth_path: Track::default(),
            accuracy: AccuracyMeter::default(),
            faults: None,
            encoders: [None, None],
            position: None,
            timings: Timings::new(),
            delays: Timings::new(),
            doubts: Vec::new(),
            model: Vec::new(),
        })
    }

    /// Scores the fault detector against what truly fails; call it before the first event.
    pub fn true_faults(&mut self, faults: Vec<TrueFault>) {
        self.faults = Some(FaultMeter::new(0, faults));
    }

    /// Takes something doubtful that no event tells, a sentence for people.
    pub fn doubt(&mut self, sentence: String) {
        self.doubts.push(sentence);
    }

    /// Takes an event of the pipeline.
    pub fn event(&mut self, event: &Event) {
        match event {
            Event::Estimate(estimate) => {
                self.trajectory.append(estimate.at, estimate.pose);
                self.odometry.append(estimate.at, estimate.odometry);
                self.sketch.estimate(estimate);
                self.accuracy.estimate(estimate.at, estimate.pose);
                if let Some(faults) = &mut self.faults {
                    faults.estimate(estimate.at, estimate.at);
                }
            }
            Event::Revised { at, poses } => self.revise(*at, poses),
            Event::Localization(event) => {
                if let LocalizationChange::KnownMap(search) = &event.change {
                    self.position = Some(search.into());
                }
                self.lock_log.append(event);
                self.sketch.localization(event);
            }
            Event::Model(event) => model_log::take(&mut self.model, event),
            Event::Fault(fault) => {
                self.fault_log.append(fault);
                if let Some(faults) = &mut self.faults {
                    faults.state(fault.at, fault.sensor, fault.state);
                }
            }
            Event::Encoder(encoder) => {
                self.fault_log.append_encoder(encoder);
                let wheel = usize::from(encoder.wheel == Wheel::Right);
                self.encoders[wheel] = (encoder.state != EncoderState::Healthy).then(|| EncoderFault::new(encoder));
            }
            Event::Board { .. }
            | Event::Ring { .. }
            | Event::BoardLog { .. }
            | Event::Motion { .. }
            | Event::BoardReset { .. }
            | Event::BoardTrouble { .. } => {}
        }
    }

    /// Begins the path anew. The accuracy counts from here on: the frame of the new map is another one.
    fn revise(&mut self, at: Timestamp, poses: &[Estimate]) {
        for (file, name) in [(&mut self.trajectory, "trajectory.tum"), (&mut self.odometry, "odometry.tum")] {
            match Trajectory::create(&self.folder.path().join(name)) {
                Ok(anew) => *file = anew,
                Err(error) => self.doubts.push(format!("{name} keeps the poses in the discarded map: {error}")),
            }
        }
        self.sketch.begin_anew(at);
        self.accuracy = AccuracyMeter::default();
        for estimate in poses {
            self.trajectory.append(estimate.at, estimate.pose);
            self.odometry.append(estimate.at, estimate.odometry);
            self.sketch.estimate(estimate);
        }
    }

    /// Takes where the robot truly was, `world_from_robot`. The first call begins `truth.tum`.
    ///
    /// # Errors
    /// When the file cannot be created.
    pub fn truth(&mut self, at: Timestamp, pose: Pose2) -> Result<(), WriteError> {
        if self.truth.is_none() {
            self.truth = Some(Trajectory::create(&self.folder.path().join("truth.tum"))?);
        }
        if let Some(truth) = &mut self.truth {
            truth.append(at, pose);
        }
        self.truth_path.push(at, pose.position());
        self.accuracy.truth(at, pose);
        Ok(())
    }

    /// Takes how long the computing for one sweep took.
    pub fn timing(&mut self, elapsed: Duration) {
        self.timings.add(elapsed);
    }

    /// Takes how long after its last byte had been read a pose was out.
    pub fn delay(&mut self, elapsed: Duration) {
        self.delays.add(elapsed);
    }

    /// How late poses have been; none before the first.
    #[must_use]
    pub fn latency(&self) -> Option<Latency> {
        self.delays.latency()
    }

    /// Writes the map, the picture and the summary and gives every file its name; `summary.json` comes last. Earlier results are
    /// replaced together, after all files are complete. Where nothing was mapped, an earlier map is kept with all that belongs to it.
    ///
    /// # Errors
    /// When a file cannot be written. Then the folder is as it was at the last checkpoint.
    pub fn finish(mut self, state: &FinalState<'_>) -> Result<Summary, WriteError> {
        self.sketch = self.sketch_of(state);
        let mut summary = self.summary(state);
        let path = self.folder.path().to_owned();
        // Free space alone is no map: the files must not look like one.
        let (empty, is_empty) =
            (Raster::default(), summary.nothing_mapped.is_some() && !ending::has_marks(state.raster));
        let raster = if is_empty { &empty } else { state.raster };
        let known = raster.occupancy.iter().filter(|percent| **percent != Raster::UNKNOWN).count();
        summary.map_m2 = known as f64 * raster.cell_m * raster.cell_m;
        let [pgm, yaml] = map_files(&path, "map", raster)?;
        let (png, svg) =
            self.pictures(state, &mut summary).map_err(|source| WriteError { path: path.join("map.png"), source })?;
        let trajectory = self.trajectory.complete()?;
        summary.map_sha256 = pgm.sha256().into();
        summary.trajectory_sha256 = trajectory.sha256().into();
        let truth = self.truth.map(Trajectory::complete).transpose()?;
        let has_truth = truth.is_some();
        let files: Vec<CompleteFile> = [
            pgm,
            yaml,
            complete_file(&path, "map.png", &png)?,
            complete_file(&path, "map.svg", svg.as_bytes())?,
            complete_file(&path, "config.toml", state.config.to_toml().as_bytes())?,
            trajectory,
            self.odometry.complete()?,
            self.fault_log.complete()?,
            self.lock_log.complete()?,
        ]
        .into_iter()
        .chain(truth)
        .collect();
        let summary_file = complete_file(&path, "summary.json", summary.to_json().as_bytes())?;
        if summary.nothing_mapped.is_some() && self.folder.has_earlier_map() {
            summary.remark = Some(format!("{}: the map of an earlier run is kept", path.display()));
            return Ok(summary);
        }
        if let Some(moved) = self.folder.take()? {
            summary.remark = Some(format!("the results of the drive before are now in {}", moved.display()));
        }
        let written =
            RESULTS.iter().copied().filter(|name| *name != "summary.json" && (has_truth || *name != "truth.tum"));
        self.folder.remove_others(&written.collect::<Vec<_>>())?;
        for file in files.into_iter().chain([summary_file]) {
            file.name()?;
        }
        Ok(summary)
    }

    /// The path so far, with a bound of its error where the method tells one.
    fn sketch_of(&self, state: &FinalState<'_>) -> Sketch {
        let sketch = self.sketch.clone();
        if state.config.method == Method::Paper { sketch.without_bound() } else { sketch }
    }

    /// All of the summary but the hashes and the area of the map.
    fn summary(&self, state: &FinalState<'_>) -> Summary {
        let mut summary = Summary::new(state.counters);
        summary.source = self.folder.source().clone();
        summary.calibration = state.calibration;
        summary.position.clone_from(&self.position);
        summary.encoder_faults = self.encoders.iter().flatten().cloned().collect();
        summary.accuracy = self.accuracy.accuracy();
        (summary.duration_s, summary.path_m) = (state.ended.seconds(), self.sketch.path_m());
        summary.ignored_sensors = ending::ignored(state.states);
        summary.lock_losses = self.lock_log.losses();
        summary.uncertain_s = self.lock_log.uncertain_s(self.sketch.last_at());
        summary.position_within_m = self.sketch.within_m();
        summary.model.clone_from(&self.model);
        summary.nothing_mapped = ending::nothing_mapped(state, &summary);
        let lost_since_s = self.lock_log.open_since().map(Timestamp::seconds);
        summary.doubtful = ending::doubts(state, &summary, lost_since_s);
        summary.doubtful.extend_from_slice(&self.doubts);
        summary.faults = self.faults.as_ref().map(|meter| meter.detection().score());
        (summary.mean_us_per_sweep, summary.p99_us_per_sweep) = self.timings.mean_and_p99_us().unzip();
        summary.latency = self.latency();
        summary
    }

    /// `map.png` and `map.svg`; the areas of the rooms are for the summary.
    fn pictures(&self, state: &FinalState<'_>, summary: &mut Summary) -> io::Result<(Vec<u8>, String)> {
        let map_from_world = self.accuracy.world_from_map().map(Pose2::inverse);
        let truth: Vec<_> = map_from_world
            .map(|transform| self.truth_path.points().into_iter().map(|point| transform.transform(point)).collect())
            .unwrap_or_default();
        let around = Surroundings {
            raster: state.raster,
            ring: state.ring,
            states: state.states,
            robot_name: &state.config.robot.name,
            doubts: &summary.doubtful,
            began_unix_us: self.folder.source().began_unix_us,
        };
        let drawing = self.sketch.drawing(around).with_truth(&truth, summary.accuracy.map(|accuracy| accuracy.ate_m));
        if let Some(reason) = &summary.nothing_mapped {
            return drawing.reason(reason);
        }
        let (png, svg, rooms_m2) = (drawing.png()?, drawing.svg(), drawing.rooms_m2().collect());
        summary.rooms_m2 = rooms_m2;
        Ok((png, svg))
    }
}

#[cfg(test)]
mod tests;
