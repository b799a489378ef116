//! One session: a pipeline, its outputs, and the order in which inputs reach it.
//!
//! Before any input at time t, every deadline up to t is handled at the deadline's own time. So what the pipeline sees
//! depends on what was read and written and when, never on when a timer fired: a recording replays bit for bit.

use bytes::Bytes;
use slamd_core::config::Config;
use slamd_core::driver::{Context, Update, Watcher};
use slamd_core::event::{
    EncoderState, Estimate, Event, FaultEvent, Input, LocalizationChange, LocalizationEvent, Output, SensorState, Wheel,
};
use slamd_core::geometry::{Pose2, Ring};
use slamd_core::link::Reception;
use slamd_core::pipeline::Pipeline;
use slamd_core::saved_state::SavedState;
use slamd_core::session_clock::SessionClock;
use slamd_core::sweep::Sweep;
use slamd_core::time::Timestamp;
use slamd_metrics::TrueFault;
use slamd_publish::{FinalState, Outputs, Summary, WriteError};
use std::path::Path;
use std::time::Duration;

/// A pipeline and where its events go.
pub struct Session {
    pipeline: Pipeline,
    outputs: Outputs,
    transmit: Vec<Bytes>,
    /// The last change of each sensor's state.
    changes: Vec<Option<FaultEvent>>,
    is_lost: bool,
    encoders: [EncoderState; 2],
    estimate: Option<Estimate>,
    /// Whether the last input brought a pose.
    has_posed: bool,
    clock: SessionClock,
    watcher: Option<Watcher>,
}

impl Session {
    /// A session that writes into a folder.
    ///
    /// # Errors
    /// When the folder or a file in it cannot be created.
    pub fn new(pipeline: Pipeline, folder: &Path) -> Result<Self, WriteError> {
        let outputs = Outputs::create(folder)?;
        Ok(Self {
            pipeline,
            outputs,
            transmit: Vec::new(),
            changes: Vec::new(),
            is_lost: false,
            encoders: [EncoderState::Healthy; 2],
            estimate: None,
            has_posed: false,
            clock: SessionClock::default(),
            watcher: None,
        })
    }

    /// Lets somebody watch.
    pub fn watch(&mut self, watcher: Watcher) {
        self.watcher = Some(watcher);
    }

    /// Keeps each sweep for [`Session::take_sweeps`].
    pub fn keep_sweeps(&mut self) {
        self.pipeline.keep_sweeps();
    }

    /// The sweeps since the last call, where they are kept.
    pub fn take_sweeps(&mut self) -> Vec<Sweep> {
        self.pipeline.take_sweeps()
    }

    /// Everything worth remembering; none before there is something.
    #[must_use]
    pub fn saved_state(&self) -> Option<SavedState> {
        self.pipeline.saved_state()
    }

    /// The configuration with the wheels as this session has learnt them; none where the method learns none.
    #[must_use]
    pub fn calibrated(&self) -> Option<Config> {
        let mut config = self.pipeline.config().clone();
        config.robot.set_wheels(&self.pipeline.calibration()?);
        Some(config)
    }

    /// What truly fails, where somebody knows it.
    pub fn true_faults(&mut self, faults: Vec<TrueFault>) {
        self.outputs.true_faults(faults);
    }

    /// Bytes were read; none where the port has been opened again, as a capture says it.
    pub fn received(&mut self, at: Timestamp, bytes: &[u8]) {
        let at = self.run_until(at);
        self.handle(if bytes.is_empty() { Input::Opened { at } } else { Input::Received { at, bytes } });
    }

    /// The last input's last byte was read `elapsed` ago: how late its pose is, if it brought one.
    pub fn delay(&mut self, elapsed: Duration) {
        if self.has_posed {
            self.outputs.delay(elapsed);
        }
    }

    /// How it fares, in a line.
    #[must_use]
    pub fn statistics(&self) -> String {
        let counters = self.pipeline.counters();
        let latency = self.outputs.latency().map_or_else(String::new, |latency| format!("; {latency}"));
        format!(
            "{} sweeps, {} dropped; {} frames, {} lost, {} CRC errors{latency}",
            counters.sweeps, counters.dropped_sweeps, counters.frames, counters.lost_frames, counters.crc_errors
        )
    }

    /// Bytes were written.
    pub fn sent(&mut self, at: Timestamp, bytes: &[u8]) {
        let at = self.run_until(at);
        self.handle(Input::Sent { at, bytes });
    }

    /// Where the robot truly is.
    ///
    /// # Errors
    /// When `truth.tum` cannot be created.
    pub fn truth(&mut self, at: Timestamp, pose: Pose2) -> Result<(), WriteError> {
        self.show(Update::Truth(at, pose), Duration::ZERO);
        self.outputs.truth(at, pose)
    }

    /// Handles the deadlines up to `at`; gives `at`, or the last input's time where that is later.
    pub fn run_until(&mut self, at: Timestamp) -> Timestamp {
        let at = self.clock.approach(at);
        while let Some(deadline) = self.clock.due(at, self.pipeline.next_deadline()) {
            self.handle(Input::Tick { at: deadline });
        }
        at
    }

    /// Nothing more will come: what waits in the pipeline is used.
    pub fn end(&mut self) {
        self.handle(Input::End);
    }

    /// When the pipeline next wants to be called.
    #[must_use]
    pub fn next_deadline(&self) -> Timestamp {
        self.pipeline.next_deadline()
    }

    /// What has been received so far.
    #[must_use]
    pub fn reception(&self) -> Reception<'_> {
        let counters = self.pipeline.counters();
        Reception {
            frames: counters.frames,
            groups: counters.groups,
            restarts: counters.restarts,
            echoed: counters.echoed,
            board: self.pipeline.board(),
        }
    }

    /// Frames to be written to the board since the last call.
    pub fn take_transmit(&mut self) -> Vec<Bytes> {
        std::mem::take(&mut self.transmit)
    }

    /// The sensors that are faulty now, with the reason in words.
    pub fn faulty(&self) -> impl Iterator<Item = &FaultEvent> {
        self.changes.iter().flatten().filter(|change| change.state != SensorState::Healthy)
    }

    /// The last change of each sensor's state, by id; none where it has not changed yet. Shorter than the ring where the last ones have not.
    #[must_use]
    pub fn changes(&self) -> &[Option<FaultEvent>] {
        &self.changes
    }

    /// True while the poses are not to be relied on: what is heard contradicts the map, or the place in a known map is not known yet.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.is_lost
    }

    /// The left and the right wheel's encoder.
    #[must_use]
    pub fn encoders(&self) -> [EncoderState; 2] {
        self.encoders
    }

    /// The newest pose.
    #[must_use]
    pub fn estimate(&self) -> Option<&Estimate> {
        self.estimate.as_ref()
    }

    /// Session time: that of the last input.
    #[must_use]
    pub fn now(&self) -> Timestamp {
        self.clock.now()
    }

    /// The effective configuration.
    #[must_use]
    pub fn config(&self) -> &Config {
        self.pipeline.config()
    }

    /// The pipeline, to look at.
    #[must_use]
    pub fn pipeline(&self) -> &Pipeline {
        &self.pipeline
    }

    /// Writes the map, the picture and the summary.
    ///
    /// # Errors
    /// When an output cannot be written.
    pub fn finish(self) -> Result<(Summary, Vec<FaultEvent>), WriteError> {
        let nowhere = Ring::default();
        let summary = self.outputs.finish(&FinalState {
            config: self.pipeline.config(),
            raster: &self.pipeline.raster(),
            ring: self.pipeline.ring().unwrap_or(&nowhere),
            states: self.pipeline.states(),
            counters: self.pipeline.counters(),
            calibration: self.pipeline.calibration(),
        })?;
        let is_faulty = |change: &FaultEvent| change.state != SensorState::Healthy;
        Ok((summary, self.changes.into_iter().flatten().filter(is_faulty).collect()))
    }

    #[expect(clippy::disallowed_methods, reason = "how long a sweep took is reported, and changes nothing")]
    fn handle(&mut self, input: Input<'_>) {
        let begin = std::time::Instant::now();
        self.pipeline.handle(input);
        let elapsed = begin.elapsed();
        let mut sweeps = 0;
        while let Some(output) = self.pipeline.poll_output() {
            match output {
                Output::Transmit(frame) => self.transmit.push(frame),
                Output::Event(event) => {
                    sweeps += u32::from(matches!(event, Event::Estimate(_)));
                    self.show(Update::Event(&event), elapsed);
                    self.outputs.event(&event);
                    self.note(event);
                }
            }
        }
        self.show(Update::Input, elapsed);
        self.has_posed = sweeps > 0;
        // The first sweeps are used a few at a time, when the building's axis is found.
        for _ in 0..sweeps {
            self.outputs.timing(elapsed / sweeps);
        }
    }

    fn show(&mut self, sight: Update<'_>, took: Duration) {
        if let Some(watcher) = &mut self.watcher {
            watcher(&Context { pipeline: &self.pipeline, now: self.clock.now(), took }, sight);
        }
    }

    /// One log line for what a person should know.
    fn note(&mut self, event: Event) {
        match event {
            Event::Board { description, compatible: true, .. } => tracing::info!("board: {description}"),
            Event::Board { description, .. } => tracing::error!("board: {description}"),
            Event::Ring { sensors, .. } => tracing::info!("ring of {sensors} sensors"),
            Event::BoardReset { .. } => tracing::warn!("the board has restarted; map and pose go on"),
            Event::BoardTrouble { text, .. } => tracing::error!("board: {text}"),
            Event::BoardLog { text, .. } => tracing::info!("board says: {text}"),
            Event::Localization(event) => {
                self.is_lost = event.is_lost();
                log_localization(&event);
            }
            Event::Fault(fault) => {
                tracing::warn!("{:.1} s: {}", fault.at.seconds(), fault.reason);
                let sensor = fault.sensor;
                if self.changes.len() <= sensor {
                    self.changes.resize(sensor.saturating_add(1), None);
                }
                if let Some(change) = self.changes.get_mut(sensor) {
                    *change = Some(fault);
                }
            }
            Event::Encoder(encoder) => {
                tracing::warn!("{:.1} s: {}", encoder.at.seconds(), encoder.reason);
                let [left, right] = &mut self.encoders;
                *if encoder.wheel == Wheel::Right { right } else { left } = encoder.state;
            }
            Event::Estimate(estimate) => {
                if self.estimate.is_none() {
                    tracing::info!("poses and map begin after {:.0} s", self.clock.now().seconds());
                }
                self.estimate = Some(estimate);
            }
        }
    }
}

/// Logs a change of the localization.
fn log_localization(event: &LocalizationEvent) {
    let since_s = event.since.seconds();
    match &event.change {
        LocalizationChange::Lost => {
            tracing::warn!(
                "position lost: what is heard contradicts the map; poses are uncertain since {since_s:.1} s"
            );
        }
        LocalizationChange::Regained { moved_m, turned_rad } => tracing::info!(
            "position found again, {moved_m:.2} m and {:.0} degrees off; poses since {since_s:.1} s were uncertain",
            turned_rad.to_degrees()
        ),
        LocalizationChange::Abandoned => {
            tracing::warn!(
                "position not found: no other place explains what is heard; mapping goes on where the robot is believed"
            );
        }
        LocalizationChange::KnownMap(search) if event.is_lost() => tracing::warn!("{}", search.reason),
        LocalizationChange::KnownMap(search) => tracing::info!("{}", search.reason),
    }
}
