//! One session: a driver, its output folder and its log.
//!
//! [`slamd_core::driver`] keeps the order of deadlines and inputs, so that a recording replays bit for bit.

use super::event_log::EventLog;
use bytes::Bytes;
use slamd_core::{
    Config, Context, Driver, Event, FaultEvent, Input, Pipeline, Pose2, Record, Ring, SavedState, SessionState,
    Snapshot, Sweep, Timestamp, Update, Watcher,
    link::{Link, Reception},
};
use slamd_metrics::TrueFault;
use slamd_publish::{FinalState, Outputs, Summary, WriteError};
use std::path::Path;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

/// A driver and what observes it.
pub struct Session {
    driver: Driver,
    observers: Observers,
}

/// Everything that sees the updates of a session.
struct Observers {
    outputs: Outputs,
    state: SessionState,
    log: EventLog,
    watcher: Option<Watcher>,
    transmit: Vec<Bytes>,
    /// Poses that the current input has brought.
    poses: u32,
    /// Whether the last input brought a pose.
    has_posed: bool,
}

impl Session {
    /// A session that writes into a folder.
    ///
    /// # Errors
    /// When the folder or a file in it cannot be created.
    pub fn new(pipeline: Pipeline, folder: &Path) -> Result<Self, WriteError> {
        let observers = Observers {
            outputs: Outputs::create(folder)?,
            state: SessionState::default(),
            log: EventLog::default(),
            watcher: None,
            transmit: Vec::new(),
            poses: 0,
            has_posed: false,
        };
        Ok(Self { driver: Driver::new(pipeline).with_stopwatch(stopwatch), observers })
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

    /// Everything worth remembering; none before there is something.
    #[must_use]
    pub fn saved_state(&self) -> Option<SavedState> {
        self.pipeline().saved_state()
    }

    /// The configuration with the wheels as this session has learnt them; none where the method learns none.
    #[must_use]
    pub fn calibrated(&self) -> Option<Config> {
        let mut config = self.pipeline().config().clone();
        config.robot.set_wheels(&self.pipeline().calibration()?);
        Some(config)
    }

    /// What truly fails, where somebody knows it.
    pub fn true_faults(&mut self, faults: Vec<TrueFault>) {
        self.observers.outputs.true_faults(faults);
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

    /// Bytes were read.
    pub fn received(&mut self, at: Timestamp, bytes: &[u8]) {
        self.handle(Input::Received { at, bytes });
    }

    /// The port was opened again.
    pub fn opened(&mut self, at: Timestamp) {
        self.handle(Input::Opened { at });
    }

    /// The last input's last byte was read `elapsed` ago: how late its pose is, if it brought one.
    pub fn delay(&mut self, elapsed: Duration) {
        if self.observers.has_posed {
            self.observers.outputs.delay(elapsed);
        }
    }

    /// Counts and latency, in a line.
    #[must_use]
    pub fn statistics(&self) -> String {
        let counters = self.pipeline().counters();
        let latency = self.observers.outputs.latency().map_or_else(String::new, |latency| format!("; {latency}"));
        format!(
            "{} sweeps, {} dropped; {} frames, {} lost, {} CRC errors{latency}",
            counters.sweeps, counters.dropped_sweeps, counters.frames, counters.lost_frames, counters.crc_errors
        )
    }

    /// Bytes were written.
    pub fn sent(&mut self, at: Timestamp, bytes: &[u8]) {
        self.handle(Input::Sent { at, bytes });
    }

    /// Where the robot truly is.
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

    /// Ends the session: sweeps that wait in the pipeline are used.
    pub fn end(&mut self) {
        let Self { driver, observers } = self;
        driver.end(|context, update| observers.see(context, update));
    }

    /// When the pipeline next wants to be called.
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

    /// What the events so far add up to.
    #[must_use]
    pub const fn state(&self) -> &SessionState {
        &self.observers.state
    }

    /// Copies the session's state.
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

    /// The pipeline, to look at.
    #[must_use]
    pub fn pipeline(&self) -> &Pipeline {
        self.driver.pipeline()
    }

    /// Writes the map, the picture and the summary.
    ///
    /// # Errors
    /// When an output cannot be written.
    pub fn finish(self) -> Result<(Summary, Vec<FaultEvent>), WriteError> {
        let Self { driver, observers } = self;
        let (pipeline, nowhere) = (driver.pipeline(), Ring::default());
        let summary = observers.outputs.finish(&FinalState {
            config: pipeline.config(),
            raster: &pipeline.raster(),
            ring: pipeline.ring().unwrap_or(&nowhere),
            states: pipeline.states(),
            counters: pipeline.counters(),
            calibration: pipeline.calibration(),
        })?;
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
                // The first sweeps are used a few at a time, when the building's axis is found.
                for _ in 0..poses {
                    self.outputs.timing(context.took / poses);
                }
            }
        }
    }
}

/// The state of a link and of its session, once there is one.
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
