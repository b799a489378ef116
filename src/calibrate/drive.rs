//! A drive, mapped: every sweep with its pose, and the walls.

use slamd_capture::Record;
use slamd_core::config::Config;
use slamd_core::event::{Calibration, Event, Input, Output, SensorState};
use slamd_core::geometry::Pose2;
use slamd_core::pipeline::Pipeline;
use slamd_core::saved_state::LandmarkState;
use slamd_core::sweep::Sweep;
use slamd_metrics::{Accuracy, AccuracyMeter};
use std::collections::VecDeque;

/// A drive as the walls method has mapped it.
#[derive(Clone, Debug, Default)]
pub struct Drive {
    /// Each sweep with `map_from_robot`.
    pub steps: Vec<(Sweep, Pose2)>,
    /// Each wall with its offset, metres.
    pub walls: Vec<(LandmarkState, f64)>,
    /// Where each sensor looks by the drawing, radians.
    pub bearings_rad: Vec<f64>,
    /// The wheels.
    pub wheels: Calibration,
    /// The sensors' states at the end.
    pub states: Vec<SensorState>,
    /// Errors against the truth, where the drive holds it.
    pub accuracy: Option<Accuracy>,
}

/// Maps a drive while its records come in.
#[derive(Debug)]
pub struct Mapper {
    pipeline: Pipeline,
    meter: AccuracyMeter,
    /// Sweeps that have no pose yet.
    waiting: VecDeque<Sweep>,
    steps: Vec<(Sweep, Pose2)>,
}

impl Mapper {
    /// A mapper that has heard nothing yet.
    #[must_use]
    pub fn new(config: &Config) -> Self {
        let mut pipeline = slamd_paper::pipeline(config, slamd_core::pipeline::Start::Fresh)
            .expect("a fresh start holds nothing that could be refused");
        pipeline.keep_sweeps();
        Self { pipeline, meter: AccuracyMeter::default(), waiting: VecDeque::new(), steps: Vec::new() }
    }

    /// Takes the next record.
    pub fn take(&mut self, record: &Record) {
        match record {
            Record::Received { at, bytes } if bytes.is_empty() => self.pipeline.handle(Input::Opened { at: *at }),
            Record::Received { at, bytes } => self.pipeline.handle(Input::Received { at: *at, bytes }),
            Record::Sent { at, bytes } => self.pipeline.handle(Input::Sent { at: *at, bytes }),
            Record::Truth { at, pose } => self.meter.truth(*at, *pose),
        }
        self.waiting.extend(self.pipeline.take_sweeps());
        while let Some(output) = self.pipeline.poll_output() {
            let Output::Event(Event::Estimate(estimate)) = output else { continue };
            self.meter.estimate(estimate.at, estimate.pose);
            while let Some(sweep) = self.waiting.pop_front_if(|sweep| sweep.index <= estimate.sweep) {
                if sweep.index == estimate.sweep {
                    self.steps.push((sweep, estimate.pose));
                }
            }
        }
    }

    /// The drive.
    #[must_use]
    pub fn finish(self) -> Drive {
        let memory = self.pipeline.saved_state();
        let walls = memory.map_or_else(Vec::new, |memory| {
            let near = memory.walls.into_iter().zip(memory.filter.offsets_m);
            near.chain(memory.inactive.into_iter().map(|inactive| (inactive.wall, inactive.offset_m))).collect()
        });
        Drive {
            steps: self.steps,
            walls,
            bearings_rad: self.pipeline.ring().map_or_else(Vec::new, |ring| {
                ring.mountings.iter().map(|mounting| mounting.robot_from_sensor.theta_rad).collect()
            }),
            wheels: self.pipeline.calibration().unwrap_or_default(),
            states: self.pipeline.states().to_vec(),
            accuracy: self.meter.accuracy(),
        }
    }
}
