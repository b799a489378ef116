//! One session: a driver, its output folder and its log.
//!
//! [`slamd_core::Driver`] keeps the order of deadlines and inputs, so that a recording replays bit for bit.

use super::event_log::EventLog;
use bytes::Bytes;
use slamd_core::{
    Config, Context, Driver, Event, FaultEvent, Input, Pipeline, Pose2, Raster, Record, Ring, SavedState, SessionState,
    Snapshot, Sweep, Timestamp, Update, Watcher,
    link::{Link, Reception},
};
use slamd_metrics::TrueFault;
use slamd_publish::{Checkpoint, FinalState, FolderError, Outputs, Summary, WriteError};
use std::path::Path;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

/// A driver and what observes it.
pub struct Session {
    driver: Driver,
    observers: Observers,
}

/// The receivers of a session's updates.
struct Observers {
    outputs: Outputs,
    state: SessionState,
    log: EventLog,
    watcher: Option<Watcher>,
    transmit: Vec<Bytes>,
    /// Poses from the current input.
    poses: u32,
    /// Whether the last input brought a pose.
    has_posed: bool,
}

impl Session {
    /// A session that writes into a folder, over what it holds.
    ///
    /// # Errors
    /// When another run uses the folder, or the folder or a file in it cannot be created.
    pub fn new(pipeline: Pipeline, folder: &Path) -> Result<Self, FolderError> {
        Ok(Self::begin(pipeline, Outputs::create(folder)?))
    }

    /// A session with its outputs.
    #[must_use]
    pub fn begin(pipeline: Pipeline, outputs: Outputs) -> Self {
        let observers = Observers {
            outputs,
            state: SessionState::default(),
            log: EventLog::default(),
            watcher: None,
            transmit: Vec::new(),
            poses: 0,
            has_posed: false,
        };
        Self { driver: Driver::new(pipeline).with_stopwatch(stopwatch), observers }
    }

    /// Adds a watcher.
    pub fn watch(&mut self, watcher: Watcher) {
        self.observers.watcher = Some(watcher);
    }

    /// Keeps each sweep for [`Session::take_sweeps`].
    pub fn keep_sweeps(&mut self) {
        self.driver.keep_sweeps();
    }

    /// The sweeps since the last call, where they are kept.
    pub fn take_sweeps(&mut self) -> Vec<Sweep> {
        self.driver.take_sweeps()
    }

    /// The state to save; none before there is a map.
    #[must_use]
    pub fn saved_state(&self) -> Option<SavedState> {
        self.pipeline().saved_state()
    }

    /// The configuration with this session's wheel parameters; none if the method does not estimate them.
    #[must_use]
    pub fn calibrated(&self) -> Option<Config> {
        let mut config = self.pipeline().config().clone();
        config.robot.set_wheels(&self.pipeline().calibration()?);
        Some(config)
    }

    /// Sets the true faults, as a simulation knows them.
    pub fn true_faults(&mut self, faults: Vec<TrueFault>) {
        self.observers.outputs.true_faults(faults);
    }

    /// Notes something that is doubtful of this run, for its summary.
    pub fn doubt(&mut self, sentence: String) {
        self.observers.outputs.doubt(sentence);
    }

    /// Takes a record of a capture.
    ///
    /// # Errors
    /// When `truth.tum` cannot be created.
    pub fn feed(&mut self, record: &Record) -> Result<(), WriteError> {
        if let Record::Truth { at, pose } = record {
            return self.truth(*at, *pose);
        }
        let Self { driver, observers } = self;
        driver.feed(record, |context, update| observers.see(context, update));
        Ok(())
    }

    /// Takes bytes that were read.
    pub fn received(&mut self, at: Timestamp, bytes: &[u8]) {
        self.handle(Input::Received { at, bytes });
    }

    /// The port was opened again.
    pub fn opened(&mut self, at: Timestamp) {
        self.handle(Input::Opened { at });
    }

    /// Notes the latency of the last input's pose, if it brought one: its last byte was read `elapsed` ago.
    pub fn delay(&mut self, elapsed: Duration) {
        if self.observers.has_posed {
            self.observers.outputs.delay(elapsed);
        }
    }

    /// Counters and latency as one line.
    #[must_use]
    pub fn statistics(&self) -> String {
        let counters = self.pipeline().counters();
        let latency = self.observers.outputs.latency().map_or_else(String::new, |latency| format!("; {latency}"));
        let steps = match (counters.unwrapped_steps, counters.refused_steps) {
            (0, 0) => String::new(),
            (unwrapped, refused) => format!("; wheel steps: {unwrapped} unwrapped at 16 bits, {refused} not used"),
        };
        format!(
            "{} sweeps, {} dropped; {} frames, {} lost, {} CRC errors{steps}{latency}",
            counters.sweeps, counters.dropped_sweeps, counters.frames, counters.lost_frames, counters.crc_errors
        )
    }

    /// Takes bytes that were written.
    pub fn sent(&mut self, at: Timestamp, bytes: &[u8]) {
        self.handle(Input::Sent { at, bytes });
    }

    /// Takes the robot's true pose.
    ///
    /// # Errors
    /// When `truth.tum` cannot be created.
    pub fn truth(&mut self, at: Timestamp, pose: Pose2) -> Result<(), WriteError> {
        let Self { driver, observers } = self;
        driver.feed(&Record::Truth { at, pose }, |context, update| observers.see(context, update));
        observers.outputs.truth(at, pose)
    }

    /// Handles the deadlines up to `at`; gives `at`, or the last input's time where that is later.
    pub fn run_until(&mut self, at: Timestamp) -> Timestamp {
        let Self { driver, observers } = self;
        driver.advance(at, |context, update| observers.see(context, update))
    }

    /// Ends the session: the pipeline processes its waiting sweeps.
    pub fn end(&mut self) {
        let Self { driver, observers } = self;
        driver.end(|context, update| observers.see(context, update));
    }

    /// When the pipeline's next deadline is due.
    #[must_use]
    pub fn next_deadline(&self) -> Timestamp {
        self.driver.next_deadline()
    }

    /// What has been received so far.
    #[must_use]
    pub fn reception(&self) -> Reception<'_> {
        self.driver.reception()
    }

    /// Frames to be written to the board since the last call.
    pub fn take_transmit(&mut self) -> Vec<Bytes> {
        std::mem::take(&mut self.observers.transmit)
    }

    /// The state that follows from the events so far.
    #[must_use]
    pub const fn state(&self) -> &SessionState {
        &self.observers.state
    }

    /// Copies the session's state into a snapshot.
    pub fn copy_to(&self, snapshot: &mut Snapshot) {
        snapshot.copy_session(self.pipeline(), self.state(), self.now());
    }

    /// Session time: that of the last input.
    #[must_use]
    pub fn now(&self) -> Timestamp {
        self.driver.now()
    }

    /// The effective configuration.
    #[must_use]
    pub fn config(&self) -> &Config {
        self.pipeline().config()
    }

    /// The pipeline, read-only.
    #[must_use]
    pub fn pipeline(&self) -> &Pipeline {
        self.driver.pipeline()
    }

    /// A copy of map and path that another thread can write, once something is mapped.
    ///
    /// # Errors
    /// When earlier results cannot be moved away, or a file cannot be renamed.
    pub fn checkpoint(&mut self) -> Result<Option<Checkpoint>, WriteError> {
        let Self { driver, observers } = self;
        let no_ring = Ring::default();
        observers.outputs.checkpoint(&final_state(driver, &driver.pipeline().raster(), &no_ring))
    }

    /// Writes the map, the picture and the summary.
    ///
    /// # Errors
    /// When an output cannot be written.
    pub fn finish(self) -> Result<(Summary, Vec<FaultEvent>), WriteError> {
        let Self { driver, observers } = self;
        let no_ring = Ring::default();
        let summary = observers.outputs.finish(&final_state(&driver, &driver.pipeline().raster(), &no_ring))?;
        Ok((summary, observers.state.faulty().cloned().collect()))
    }

    fn handle(&mut self, input: Input<'_>) {
        let Self { driver, observers } = self;
        driver.handle(input, |context, update| observers.see(context, update));
    }
}

impl Observers {
    fn see(&mut self, context: &Context<'_>, update: Update<'_>) {
        if let Some(watcher) = &mut self.watcher {
            watcher(context, update);
        }
        match update {
            Update::Event(event) => {
                self.poses += u32::from(matches!(event, Event::Estimate(_)));
                self.outputs.event(event);
                self.log.note(event, context.now.seconds());
                self.state.take(event);
            }
            Update::Transmit(frame) => self.transmit.push(frame.clone()),
            Update::Truth(..) => {}
            Update::Input => {
                let poses = std::mem::take(&mut self.poses);
                self.has_posed = poses > 0;
                // Once the dominant directions are found, one input may process several waiting sweeps.
                for _ in 0..poses {
                    self.outputs.timing(context.took / poses);
                }
            }
        }
    }
}

/// What the outputs need of the pipeline.
fn final_state<'a>(driver: &'a Driver, raster: &'a Raster, no_ring: &'a Ring) -> FinalState<'a> {
    let pipeline = driver.pipeline();
    FinalState {
        config: pipeline.config(),
        raster,
        ring: pipeline.ring().unwrap_or(no_ring),
        states: pipeline.states(),
        counters: pipeline.counters(),
        calibration: pipeline.calibration(),
        walls: pipeline.segments().len(),
        waiting: pipeline.waiting(),
        ended: driver.now(),
    }
}

/// Copies the state of a link and of its session, if there is one.
pub fn copy_state(snapshot: &mut Snapshot, link: &Link, session: Option<&Session>) {
    snapshot.copy_link(link);
    if let Some(session) = session {
        session.copy_to(snapshot);
    }
}

/// Real time since the first call.
#[expect(clippy::disallowed_methods, reason = "how long a sweep took is reported, and changes nothing")]
fn stopwatch() -> Duration {
    static BEGIN: OnceLock<Instant> = OnceLock::new();
    BEGIN.get_or_init(Instant::now).elapsed()
}
