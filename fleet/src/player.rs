//! A capture, played through slamd's pipeline: poses, sweeps and the map.
//!
//! The robot, the hub and the offline union all do it here, on the same bytes; so they get the same poses and the same map, bit for bit.

use crate::session::SessionId;
use crate::wire::{Grid, Pose, Range, Sweep, VERSION};
use slamd_capture::{CaptureError, CaptureReader, Record};
use slamd_core::config::{Config, ConfigError};
use slamd_core::event::{Event, Input, Output};
use slamd_core::geometry::Pose2;
use slamd_core::pipeline::Pipeline;
use slamd_core::session_clock::SessionClock;
use slamd_core::time::Timestamp;
use std::io::Read;
use std::path::Path;

/// A capture that cannot be played.
#[derive(Debug, thiserror::Error)]
pub enum PlayError {
    /// It cannot be read.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// Its configuration is none.
    #[error("the capture's configuration: {0}")]
    Config(#[from] ConfigError),
    /// It ends before its first record.
    #[error("the capture holds no record yet")]
    Empty,
}

/// Something that a record has brought.
#[derive(Clone, Debug, PartialEq)]
pub enum Report {
    /// A pose.
    Pose(Pose),
    /// A sweep.
    Sweep(Sweep),
}

/// A capture being played.
pub struct Player<R: Read> {
    capture: CaptureReader<R>,
    first: Option<Record>,
    session: SessionId,
    pipeline: Pipeline,
    clock: SessionClock,
    /// Records played, and one for the end.
    seq: u64,
    start: Option<Pose2>,
    is_over: bool,
}

impl<R: Read> Player<R> {
    /// Begins to play; `path` is the capture's name in errors. Waits for the first record where the reader does.
    ///
    /// # Errors
    /// Where it is no capture, or one without a record.
    pub fn begin(file: R, path: &Path) -> Result<Self, PlayError> {
        let mut capture = CaptureReader::begin(file, path)?;
        let first = capture.next().ok_or(PlayError::Empty)??;
        let mut pipeline = slamd_paper::pipeline(&Config::from_toml(&capture.info().config_toml)?, slamd_core::pipeline::Start::Fresh).expect("a fresh start holds nothing that could be refused");
        pipeline.keep_sweeps();
        Ok(Self {
            session: SessionId::of(capture.info(), &first),
            capture,
            first: Some(first),
            pipeline,
            clock: SessionClock::default(),
            seq: 0,
            start: None,
            is_over: false,
        })
    }

    /// Which drive it is.
    #[must_use]
    pub const fn session(&self) -> SessionId {
        self.session
    }

    /// Session time.
    #[must_use]
    pub const fn now(&self) -> Timestamp {
        self.clock.now()
    }

    /// How far the map is: see [`Grid::seq`].
    #[must_use]
    pub const fn seq(&self) -> u64 {
        self.seq
    }

    /// What is wrong with the capture, once it has ended; none where it is whole.
    #[must_use]
    pub fn damage(&self) -> Option<&str> {
        self.capture.damage()
    }

    /// Plays the next record, and the end; what it has brought is given to `each`. False where there is no more.
    ///
    /// # Errors
    /// Where the capture cannot be read further.
    pub fn step(&mut self, mut each: impl FnMut(Report)) -> Result<bool, PlayError> {
        if self.is_over {
            return Ok(false);
        }
        let record = self.first.take().map(Ok).or_else(|| self.capture.next()).transpose()?;
        match &record {
            Some(Record::Received { at, bytes }) => {
                let at = self.run_until(*at);
                self.pipeline.handle(if bytes.is_empty() {
                    Input::Opened { at }
                } else {
                    Input::Received { at, bytes }
                });
            }
            Some(Record::Sent { at, bytes }) => {
                let at = self.run_until(*at);
                self.pipeline.handle(Input::Sent { at, bytes });
            }
            Some(Record::Truth { .. }) => {}
            None => {
                self.is_over = true;
                self.pipeline.handle(Input::End);
            }
        }
        self.seq += 1;
        self.report(&mut each);
        Ok(!self.is_over)
    }

    /// Plays all of it.
    ///
    /// # Errors
    /// As [`Player::step`].
    pub fn finish(&mut self, mut each: impl FnMut(Report)) -> Result<(), PlayError> {
        while self.step(&mut each)? {}
        Ok(())
    }

    /// The map so far; none before the first pose.
    #[must_use]
    pub fn grid(&self) -> Option<Grid> {
        let map = self.pipeline.saved_state()?.map;
        Some(Grid::new(self.session, self.seq, self.start?, map))
    }

    /// Handles the deadlines up to `at`, each at its own time.
    fn run_until(&mut self, at: Timestamp) -> Timestamp {
        let at = self.clock.approach(at);
        while let Some(deadline) = self.clock.due(at, self.pipeline.next_deadline()) {
            self.pipeline.handle(Input::Tick { at: deadline });
        }
        at
    }

    fn report(&mut self, each: &mut impl FnMut(Report)) {
        let session = self.session;
        for sweep in self.pipeline.take_sweeps() {
            let ranges = sweep.beams.iter().map(|beam| Range::new(beam.range_m)).collect();
            each(Report::Sweep(Sweep { version: VERSION, session, seq: sweep.index, time_us: sweep.at.us(), ranges }));
        }
        while let Some(output) = self.pipeline.poll_output() {
            let Output::Event(Event::Estimate(estimate)) = output else { continue };
            self.start.get_or_insert(estimate.pose);
            let Pose2 { x_m, y_m, theta_rad } = estimate.pose;
            let (seq, time_us) = (estimate.sweep, estimate.at.us());
            each(Report::Pose(Pose { version: VERSION, session, seq, time_us, x_m, y_m, theta_rad }));
        }
    }
}
