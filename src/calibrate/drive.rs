//! A mapped drive: every sweep with its pose, and the walls.

use slamd_core::{
    Calibration, Config, Driver, Estimate, Event, ModelAspect, ModelEvent, Pose2, Record, SensorState, Sweep, Update,
    saved_state::LandmarkState,
};
use slamd_metrics::{Accuracy, AccuracyMeter};
use std::collections::VecDeque;

/// A drive mapped by the walls method.
#[derive(Clone, Debug, Default)]
pub struct Drive {
    /// Each sweep with `map_from_robot`.
    pub steps: Vec<(Sweep, Pose2)>,
    /// Each wall with its offset, metres.
    pub walls: Vec<(LandmarkState, f64)>,
    /// Nominal bearing of each sensor, radians.
    pub bearings_rad: Vec<f64>,
    /// The wheels.
    pub wheels: Calibration,
    /// The sensors' states at the end.
    pub states: Vec<SensorState>,
    /// Errors against the true poses, if the drive holds them.
    pub accuracy: Option<Accuracy>,
    /// In what the walls showed the robot to differ from its configuration.
    pub findings: Vec<ModelEvent>,
    /// The poses were uncertain at the end.
    pub is_uncertain: bool,
}

impl Drive {
    /// How far the drive turned left and right by the encoders, radians.
    #[must_use]
    pub fn turned_rad(&self) -> [f64; 2] {
        let turns = self.steps.iter().map(|(sweep, _)| (sweep.right_m - sweep.left_m) / self.wheels.wheel_base_m);
        turns.fold([0.0, 0.0], |[left, right], turn| [left + turn.max(0.0), right - turn.min(0.0)])
    }
}

/// Maps a drive from its records.
#[derive(Debug)]
pub struct Mapper {
    driver: Driver,
    meter: AccuracyMeter,
    /// Sweeps without a pose so far.
    waiting: VecDeque<Sweep>,
    steps: Vec<(Sweep, Pose2)>,
    findings: Vec<ModelEvent>,
    is_uncertain: bool,
}

impl Mapper {
    /// A mapper for a new drive.
    #[must_use]
    pub fn new(config: &Config) -> Self {
        let pipeline = slamd_paper::pipeline(config, slamd_core::Start::Fresh)
            .expect("a fresh start has no saved state that could be refused");
        let mut driver = Driver::new(pipeline);
        driver.keep_sweeps();
        Self {
            driver,
            meter: AccuracyMeter::default(),
            waiting: VecDeque::new(),
            steps: Vec::new(),
            findings: Vec::new(),
            is_uncertain: false,
        }
    }

    /// Takes the next record.
    pub fn take(&mut self, record: &Record) {
        if let Record::Truth { at, pose } = record {
            self.meter.truth(*at, *pose);
        }
        let mut estimates = Vec::new();
        let Self { driver, findings, is_uncertain, .. } = self;
        driver.feed(record, |_, update| match update {
            // The noise of the readings is no property of the robot that could be mended here.
            Update::Event(Event::Model(event)) if event.finding.aspect != ModelAspect::RangeNoise => {
                findings.push(event.clone());
            }
            Update::Event(Event::Localization(event)) => *is_uncertain = event.is_lost(),
            _ => estimates.extend(estimate(update)),
        });
        self.pair(estimates);
    }

    /// Pairs each pose with its sweep.
    fn pair(&mut self, estimates: Vec<Estimate>) {
        self.waiting.extend(self.driver.take_sweeps());
        for estimate in estimates {
            self.meter.estimate(estimate.at, estimate.pose);
            while let Some(sweep) = self.waiting.pop_front_if(|sweep| sweep.index <= estimate.sweep) {
                if sweep.index == estimate.sweep {
                    self.steps.push((sweep, estimate.pose));
                }
            }
        }
    }

    /// Ends the drive and returns it.
    #[must_use]
    pub fn finish(mut self) -> Drive {
        let mut estimates = Vec::new();
        self.driver.end(|_, update| estimates.extend(estimate(update)));
        self.pair(estimates);
        let pipeline = self.driver.pipeline();
        let state = pipeline.saved_state();
        let walls = state.map_or_else(Vec::new, |state| {
            let near = state.walls.into_iter().zip(state.filter.offsets_m);
            near.chain(state.inactive.into_iter().map(|inactive| (inactive.wall, inactive.offset_m))).collect()
        });
        Drive {
            steps: self.steps,
            walls,
            bearings_rad: pipeline.ring().map_or_else(Vec::new, |ring| {
                ring.mountings.iter().map(|mounting| mounting.robot_from_sensor.theta_rad).collect()
            }),
            wheels: pipeline.calibration().unwrap_or_default(),
            states: pipeline.states().to_vec(),
            accuracy: self.meter.accuracy(),
            findings: self.findings,
            is_uncertain: self.is_uncertain,
        }
    }
}

const fn estimate(update: Update<'_>) -> Option<Estimate> {
    match update {
        Update::Event(Event::Estimate(estimate)) => Some(*estimate),
        _ => None,
    }
}
