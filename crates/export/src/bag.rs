//! What of a session is told on which topic, and when.
//!
//! A message is stamped with the instant it speaks of and filed under the instant slamd knew it, as a recorder beside a live robot would have it:
//! so the file is in order of time, and the first poses, which wait for the building's axis, come after what was heard meanwhile.

use super::diagnostics::Diagnostics;
use super::file::{BagError, BagFile, Topic};
use super::message::{self, BASE, MAP, ODOM, Stamp, Transform, sonar};
use super::odometry::Wheels;
use slamd_core::config::Config;
use slamd_core::event::{Estimate, Event};
use slamd_core::geometry::{Mounting, Pose2, Ring};
use slamd_core::pipeline::Pipeline;
use slamd_core::sweep::{Beam, Sweep};
use slamd_core::time::Timestamp;
use std::path::Path;
use std::time::Duration;

/// A bag being written.
pub struct Bag {
    file: BagFile,
    unix_zero_us: u64,
    /// Within what a sensor measures.
    limits_m: [f64; 2],
    ring: Ring,
    wheels: Wheels,
    diagnostics: Diagnostics,
    map_revision: u64,
    map_due: Timestamp,
    now: Timestamp,
}

/// From one look at the map to the next.
const MAP_PERIOD: Duration = Duration::from_secs(5);

impl Bag {
    /// Creates the file, under a name of its own until it is whole. `unix_zero_us` are the microseconds from 1970 to the session's beginning; where
    /// nobody knows them, stamps are the session's time.
    ///
    /// # Errors
    /// When it cannot be created.
    pub fn create(path: &Path, config: &Config, unix_zero_us: Option<u64>) -> Result<Self, BagError> {
        Ok(Self {
            file: BagFile::create(path)?,
            unix_zero_us: unix_zero_us.unwrap_or_default(),
            limits_m: [config.ring.min_range_m, config.ring.max_range_m],
            ring: Ring::default(),
            wheels: Wheels::new(config.robot.wheels()),
            diagnostics: Diagnostics::new(&config.robot.name),
            map_revision: 0,
            map_due: Timestamp::default(),
            now: Timestamp::default(),
        })
    }

    /// Takes what a session's last input, at `now`, has brought.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn take(
        &mut self,
        now: Timestamp,
        pipeline: &Pipeline,
        events: &[Event],
        sweeps: &[Sweep],
    ) -> Result<(), BagError> {
        self.now = now;
        for event in events {
            self.diagnostics.note(event);
            match event {
                Event::Ring { .. } => self.place_sensors(pipeline)?,
                Event::Estimate(estimate) => self.locate(estimate)?,
                _ => {}
            }
        }
        for sweep in sweeps {
            self.sweep(sweep)?;
        }
        self.look_at_map(pipeline)?;
        match self.diagnostics.tell(self.now, self.stamp(self.now)) {
            Some(message) => self.write(Topic::Diagnostics, &message),
            None => Ok(()),
        }
    }

    /// Writes the last map and gives the file its name; how many messages on how many topics it holds.
    ///
    /// # Errors
    /// When the file cannot be written; then it is not there.
    pub fn finish(mut self, now: Timestamp, pipeline: &Pipeline) -> Result<(u64, usize), BagError> {
        self.now = now;
        self.map(pipeline)?;
        self.file.finish()
    }

    fn place_sensors(&mut self, pipeline: &Pipeline) -> Result<(), BagError> {
        self.ring = pipeline.ring().cloned().unwrap_or_default();
        let at = self.stamp(self.now);
        let place = |(sensor, mounting): (usize, &Mounting)| Transform {
            at,
            outer: BASE,
            inner: sonar(sensor),
            pose: mounting.robot_from_sensor,
        };
        let places: Vec<Transform> = self.ring.mountings.iter().enumerate().map(place).collect();
        self.write(Topic::StaticTransforms, &message::transforms(&places))
    }

    fn locate(&mut self, estimate: &Estimate) -> Result<(), BagError> {
        let at = self.stamp(estimate.at);
        self.write(Topic::Pose, &message::map_pose(at, estimate.pose, &estimate.covariance))?;
        self.transform(at, MAP, ODOM, estimate.pose * estimate.odometry.inverse())
    }

    fn sweep(&mut self, sweep: &Sweep) -> Result<(), BagError> {
        let at = self.stamp(sweep.at);
        let odometry = message::odometry(at, &self.wheels.roll(sweep));
        self.write(Topic::Odometry, &odometry)?;
        self.transform(at, ODOM, BASE, sweep.odometry)?;
        for (sensor, beam) in sweep.beams.iter().enumerate().take(self.ring.len()) {
            let range_m = if self.diagnostics.is_faulty(sensor) { f64::NAN } else { beam.range_m };
            let at = self.stamp(pinged(sweep, beam));
            let message = message::range(at, sensor, &self.ring.mountings[sensor], self.limits_m, range_m);
            self.write(Topic::Sonar(sensor), &message)?;
        }
        Ok(())
    }

    fn look_at_map(&mut self, pipeline: &Pipeline) -> Result<(), BagError> {
        if self.now < self.map_due {
            return Ok(());
        }
        self.map_due = self.now + MAP_PERIOD;
        let Some((_, next)) = pipeline.map_since(self.map_revision) else { return Ok(()) };
        self.map_revision = next;
        self.map(pipeline)
    }

    fn map(&mut self, pipeline: &Pipeline) -> Result<(), BagError> {
        let raster = pipeline.raster();
        if raster.occupancy.is_empty() {
            return Ok(());
        }
        self.write(Topic::Map, &message::occupancy_grid(self.stamp(self.now), &raster))
    }

    fn transform(&mut self, at: Stamp, outer: &'static str, inner: &str, pose: Pose2) -> Result<(), BagError> {
        self.write(Topic::Transforms, &message::transforms(&[Transform { at, outer, inner: inner.into(), pose }]))
    }

    fn write(&mut self, topic: Topic, message: &[u8]) -> Result<(), BagError> {
        self.file.write(topic, self.stamp(self.now), message)
    }

    fn stamp(&self, at: Timestamp) -> Stamp {
        Stamp(self.unix_zero_us.saturating_add(at.us()).saturating_mul(1_000))
    }
}

/// When a beam was sent; the sweep's instant where its message was lost.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a part of a second, and not a number becomes 0"
)]
fn pinged(sweep: &Sweep, beam: &Beam) -> Timestamp {
    Timestamp::from_us(sweep.at.us().saturating_sub((1e6 * beam.age_s) as u64))
}
