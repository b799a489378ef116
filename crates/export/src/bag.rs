//! Which message goes to which topic, and when.
//!
//! A message's stamp is the instant that it describes; its log time is when slamd knew it, as if a
//! recorder had run beside the robot. So the file is in the order of log time. The first poses, which
//! wait for the walls' directions, come after the messages received meanwhile.

use super::description::urdf;
use super::diagnostics::Diagnostics;
use super::file::{BagError, BagFile, Topic};
use super::message::{self, BASE, MAP, ODOM, Stamp, Transform, sonar};
use super::odometry::Wheels;
use super::path::Path;
use super::scan::{laser_scan, point_cloud};
use slamd_core::{Beam, Config, Estimate, Event, Mounting, Pipeline, Pose2, Ring, Sweep, Timestamp};
use slamd_files::{CompleteFile, Output};
use std::time::Duration;

/// A bag being written.
pub struct Bag {
    file: BagFile,
    unix_zero_us: u64,
    /// The sensors' range limits, metres.
    limits_m: [f64; 2],
    ring: Ring,
    wheels: Wheels,
    diagnostics: Diagnostics,
    path: Path,
    last_sweep: Option<Timestamp>,
    robot_name: String,
    wheel_base_m: f64,
    map_revision: u64,
    map_due: Timestamp,
    now: Timestamp,
}

/// Period of writing a changed map.
const MAP_PERIOD: Duration = Duration::from_secs(5);

impl Bag {
    /// Creates the file, under a temporary name until it is complete. `unix_zero_us` is the session's
    /// start in microseconds since 1970; if unknown, stamps are session times.
    ///
    /// # Errors
    /// When the file cannot be created.
    pub fn create(output: Output, config: &Config, unix_zero_us: Option<u64>) -> Result<Self, BagError> {
        Ok(Self {
            file: BagFile::create(output)?,
            unix_zero_us: unix_zero_us.unwrap_or_default(),
            limits_m: [config.ring.min_range_m, config.ring.max_range_m],
            ring: Ring::default(),
            wheels: Wheels::new(config.robot.wheels()),
            diagnostics: Diagnostics::new(&config.robot.name),
            path: Path::default(),
            last_sweep: None,
            robot_name: config.robot.name.clone(),
            wheel_base_m: config.robot.wheel_base_m,
            map_revision: 0,
            map_due: Timestamp::default(),
            now: Timestamp::default(),
        })
    }

    /// Adds the results of the session's last input, at `now`.
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
                Event::Ring { .. } => self.write_mountings(pipeline)?,
                Event::Estimate(estimate) => self.write_pose(estimate)?,
                _ => {}
            }
        }
        for sweep in sweeps {
            self.write_sweep(sweep)?;
        }
        self.write_map_if_due(pipeline)?;
        match self.diagnostics.message_if_due(self.now, self.stamp(self.now)) {
            Some(message) => self.write(Topic::Diagnostics, &message),
            None => Ok(()),
        }
    }

    /// Writes the last map and completes the file, which has no name yet. Returns it with the numbers of messages and topics.
    ///
    /// # Errors
    /// When the file cannot be written. It is then absent.
    pub fn complete(mut self, now: Timestamp, pipeline: &Pipeline) -> Result<(CompleteFile, u64, usize), BagError> {
        self.now = now;
        self.write_map(pipeline)?;
        if self.path.has_news() {
            let path = self.path.message(self.stamp(now));
            self.write(Topic::Path, &path)?;
        }
        self.file.complete()
    }

    fn write_mountings(&mut self, pipeline: &Pipeline) -> Result<(), BagError> {
        self.ring = pipeline.ring().cloned().unwrap_or_default();
        let at = self.stamp(self.now);
        let transform = |(sensor, mounting): (usize, &Mounting)| Transform {
            at,
            outer: BASE,
            inner: sonar(sensor),
            pose: mounting.robot_from_sensor,
        };
        let transforms: Vec<Transform> = self.ring.mountings.iter().enumerate().map(transform).collect();
        self.write(Topic::StaticTransforms, &message::transforms(&transforms))?;
        let urdf = urdf(&self.robot_name, &self.ring, self.wheel_base_m);
        self.write(Topic::Description, &message::text(&urdf))
    }

    fn write_pose(&mut self, estimate: &Estimate) -> Result<(), BagError> {
        let at = self.stamp(estimate.at);
        self.write(Topic::Pose, &message::map_pose(at, estimate.pose, &estimate.covariance))?;
        self.path.push(at, estimate.pose);
        if self.path.is_due() {
            let path = self.path.message(self.stamp(self.now));
            self.write(Topic::Path, &path)?;
        }
        self.transform(at, MAP, ODOM, estimate.pose * estimate.odometry.inverse())
    }

    fn write_sweep(&mut self, sweep: &Sweep) -> Result<(), BagError> {
        let at = self.stamp(sweep.at);
        let odometry = message::odometry(at, &self.wheels.roll(sweep));
        self.write(Topic::Odometry, &odometry)?;
        self.transform(at, ODOM, BASE, sweep.odometry)?;
        for (sensor, beam) in sweep.beams.iter().enumerate().take(self.ring.len()) {
            let range_m = if self.diagnostics.is_faulty(sensor) { f64::NAN } else { beam.range_m };
            let at = self.stamp(ping_time(sweep, beam));
            let message = message::range(at, sensor, &self.ring.mountings[sensor], self.limits_m, range_m);
            self.write(Topic::Sonar(sensor), &message)?;
        }
        let period_s = self.last_sweep.replace(sweep.at).map_or(0.0, |last| sweep.at.seconds_since(last));
        let is_faulty = |sensor| self.diagnostics.is_faulty(sensor);
        let scan = laser_scan(at, &sweep.beams, is_faulty, self.limits_m[1], period_s);
        let points = point_cloud(at, &sweep.beams, is_faulty);
        self.write(Topic::Scan, &scan)?;
        self.write(Topic::Points, &points)
    }

    fn write_map_if_due(&mut self, pipeline: &Pipeline) -> Result<(), BagError> {
        if self.now < self.map_due {
            return Ok(());
        }
        self.map_due = self.now + MAP_PERIOD;
        let Some((_, next)) = pipeline.map_since(self.map_revision) else { return Ok(()) };
        self.map_revision = next;
        self.write_map(pipeline)
    }

    fn write_map(&mut self, pipeline: &Pipeline) -> Result<(), BagError> {
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

/// The time of a beam's ping; the sweep's instant if its message was lost.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "less than a second, and NaN becomes 0")]
fn ping_time(sweep: &Sweep, beam: &Beam) -> Timestamp {
    Timestamp::from_us(sweep.at.us().saturating_sub((1e6 * beam.age_s) as u64))
}
