//! A capture, played through slamd's pipeline: poses, sweeps and the map.
//!
//! The robot, the hub and the offline union all do it here, on the same bytes; so they get the same poses and the same map, bit for bit.

use crate::session::SessionId;
use crate::wire::{Grid, Pose, Range, Sweep, VERSION};
use slamd_capture::{CaptureError, CaptureReader};
use slamd_core::{Config, ConfigError, Context, Driver, Estimate, Event, Pose2, Record, Start, Timestamp, Update};
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
    driver: Driver,
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
        let config = Config::from_toml(&capture.info().config_toml)?;
        let pipeline = slamd_paper::pipeline(&config, Start::Fresh)
            .expect("a fresh start has no saved state that could be refused");
        let mut driver = Driver::new(pipeline);
        driver.keep_sweeps();
        Ok(Self {
            session: SessionId::of(capture.info(), &first),
            capture,
            first: Some(first),
            driver,
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
        self.driver.now()
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
        let mut estimates = Vec::new();
        let observe = |_: &Context<'_>, update: Update<'_>| {
            if let Update::Event(Event::Estimate(estimate)) = update {
                estimates.push(*estimate);
            }
        };
        self.is_over = record.is_none();
        match &record {
            Some(record) => self.driver.feed(record, observe),
            None => self.driver.end(observe),
        }
        self.seq += 1;
        self.report(&estimates, &mut each);
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
        let map = self.driver.pipeline().saved_state()?.map;
        Some(Grid::new(self.session, self.seq, self.start?, map))
    }

    /// The sweeps that the last record has brought, then the poses.
    fn report(&mut self, estimates: &[Estimate], each: &mut impl FnMut(Report)) {
        let session = self.session;
        for sweep in self.driver.take_sweeps() {
            let ranges = sweep.beams.iter().map(|beam| Range::new(beam.range_m)).collect();
            each(Report::Sweep(Sweep { version: VERSION, session, seq: sweep.index, time_us: sweep.at.us(), ranges }));
        }
        for estimate in estimates {
            self.start.get_or_insert(estimate.pose);
            let Pose2 { x_m, y_m, theta_rad } = estimate.pose;
            let (seq, time_us) = (estimate.sweep, estimate.at.us());
            each(Report::Pose(Pose { version: VERSION, session, seq, time_us, x_m, y_m, theta_rad }));
        }
    }
}
