//! What becomes of the pose when a wheel encoder fails.
//!
//! By the time that it is convicted the wheels have lied for a second or two. The poses since then are void, so the last ones are kept. A
//! reversed encoder is turned over: the robot goes on from its last good pose along the wheels' true way, and looks for its place among the walls as if it
//! were lost, since it may be off by what it slipped meanwhile. With a dead one its motion is unknown: it stays where it was seen last, draws and learns
//! nothing, and is the less certain the farther the other wheel rolls.

use super::initializer::Initializer;
use super::relocalizer::Relocalizer;
use super::{AXIS_SIGMA_RAD, WallSlam};
use crate::event::{EncoderState, Estimate, Event, LocalizationChange, LocalizationEvent, Wheel};
use crate::fault::encoder::EncoderChange;
use crate::geometry::Pose2;
use crate::mapping::grid::OccupancyGrid;
use crate::orientation::dominant_directions::DominantDirections;
use crate::sweep::Sweep;
use crate::time::Timestamp;
use nalgebra::{Matrix3, Vector3};
use std::collections::VecDeque;
use std::f64::consts::PI;

/// The last poses.
#[derive(Debug)]
pub(super) struct Trail {
    steps: VecDeque<Step>,
}

/// One sweep's pose, and what the wheels told of the way to it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Step {
    sweep: u64,
    at: Timestamp,
    pose: Pose2,
    rolled_m: [f64; 2],
}

/// A robot of which one wheel does not count.
#[derive(Clone, Copy, Debug)]
pub(super) struct OdometryOutage {
    since: Timestamp,
    since_sweep: u64,
    /// Where it was seen last; none where it had not found the building's axis.
    pose: Option<Pose2>,
    /// How far the other wheel has rolled since then, metres.
    way_m: f64,
}

/// A wheel that is told to have changed its way by so much within two sweeps was reversed, metres.
const SUDDEN_M: f64 = 0.02;
/// Sweeps kept: twelve seconds.
const KEPT_SWEEPS: usize = 120;
/// A fault this soon after the first sweep was there from the start.
const START_SWEEPS: u64 = 10;

impl Trail {
    pub(super) fn new() -> Self {
        Self { steps: VecDeque::with_capacity(KEPT_SWEEPS) }
    }

    pub(super) fn push(&mut self, sweep: &Sweep, pose: Pose2) {
        if self.steps.len() == KEPT_SWEEPS {
            self.steps.pop_front();
        }
        let rolled_m = [sweep.left_m, sweep.right_m];
        self.steps.push_back(Step { sweep: sweep.index, at: sweep.at, pose, rolled_m });
    }

    pub(super) fn clear(&mut self) {
        self.steps.clear();
    }

    /// The last step up to a sweep, or the first that is kept, and what was told to be rolled after it.
    fn since(&self, sweep: u64) -> Option<(Step, Vec<[f64; 2]>)> {
        let place = self.steps.partition_point(|step| step.sweep <= sweep).saturating_sub(1);
        let rolled = self.steps.iter().skip(place + 1).map(|step| step.rolled_m).collect();
        Some((*self.steps.get(place)?, rolled))
    }

    /// The last step before a wheel was reversed, not before a sweep, and what was truly rolled after it. No wheel changes its speed as
    /// suddenly as a reversed one seems to; one that does so while it stands has only to be caught standing.
    fn before_reversal(&self, sweep: u64, wheel: usize) -> Option<(Step, Vec<[f64; 2]>)> {
        let first = self.steps.partition_point(|step| step.sweep <= sweep).max(1);
        let told = |place: usize| self.steps.get(place).map_or(f64::NAN, |step| step.rolled_m[wheel]);
        let jump_m = |place: &usize| (told(place + 1) - told(place - 1)).abs();
        let places = first..self.steps.len().saturating_sub(1);
        let sudden =
            places.clone().max_by(|a, b| jump_m(a).total_cmp(&jump_m(b))).filter(|place| jump_m(place) > SUDDEN_M);
        let standing = || places.clone().min_by(|a, b| told(*a).abs().total_cmp(&told(*b).abs()));
        let turned = sudden.or_else(standing).unwrap_or(first);
        let mut rolled: Vec<[f64; 2]> = self.steps.iter().skip(turned).map(|step| step.rolled_m).collect();
        rolled.iter_mut().for_each(|rolled_m| rolled_m[wheel] = -rolled_m[wheel]);
        if let Some(mixed) = rolled.first_mut() {
            mixed[wheel] = told(turned - 1);
        }
        Some((*self.steps.get(turned - 1)?, rolled))
    }
}

impl WallSlam {
    /// Weighs what a sweep says of the encoders, and acts on it.
    pub(super) fn watch_encoders(&mut self, sweep: &Sweep, events: &mut Vec<Event>) {
        let change = self.encoders.inspect(sweep, |sensor| self.detector.is_trusted(sensor), events);
        if let Some(change) = change {
            self.heed(change, sweep, events);
        }
    }

    /// Acts on an encoder that was found to be broken or whole.
    fn heed(&mut self, change: EncoderChange, sweep: &Sweep, events: &mut Vec<Event>) {
        if change.before == EncoderState::Dead {
            return self.see_again(sweep);
        }
        let is_begun = self.tracker.is_some() && self.waiting.is_empty();
        let since_sweep = change.since_sweep.unwrap_or(0);
        let is_void = self.begun_sweep.is_some_and(|first| since_sweep < first + START_SWEEPS);
        let is_dead = change.state == EncoderState::Dead;
        if !is_begun || is_void {
            self.begin_anew();
            self.blind = is_dead.then_some(OdometryOutage { since: sweep.at, since_sweep, pose: None, way_m: 0.0 });
            return;
        }
        let wheel = usize::from(change.wheel == Wheel::Right);
        let found =
            if is_dead { self.trail.since(since_sweep) } else { self.trail.before_reversal(since_sweep, wheel) };
        let (Some((step, mut rolled)), Some(tracker)) = (found, &mut self.tracker) else { return };
        let mut last_m = [sweep.left_m, sweep.right_m];
        last_m[wheel] = -last_m[wheel];
        rolled.push(last_m);
        let base_m = tracker.filter.calibration().wheel_base_m;
        let (mut pose, mut way_m) = (step.pose, 0.0);
        for [left_m, right_m] in rolled {
            way_m += left_m.abs().max(right_m.abs());
            if !is_dead {
                pose = pose.rolled(left_m, right_m, base_m);
            }
        }
        // What the robot was lost for until now was the encoder.
        let (mut since, mut since_sweep) = (step.at, step.sweep);
        if let Some(lost) = self.lost.take() {
            (since, since_sweep) = (since.min(lost.since), since_sweep.min(lost.since_sweep));
        } else {
            events.push(Event::Localization(LocalizationEvent {
                at: sweep.at,
                since,
                change: LocalizationChange::Lost,
            }));
        }
        tracker.relocate(pose, since_sweep);
        tracker.reset_monitor();
        self.trail.clear();
        if is_dead {
            self.blind = Some(OdometryOutage { since, since_sweep, pose: Some(pose), way_m });
        } else {
            self.lost = Some(Relocalizer::new(since, since_sweep, pose, sweep.odometry).after_reversal());
        }
    }

    /// One sweep of a robot whose motion is unknown.
    pub(super) fn hold_pose(&mut self, sweep: &Sweep, events: &mut Vec<Event>) {
        let Some(blind) = &mut self.blind else { return };
        blind.way_m += sweep.left_m.abs().max(sweep.right_m.abs());
        if let Some(pose) = blind.pose {
            let covariance = unknown_within(blind.way_m);
            let (at, odometry) = (sweep.at, sweep.odometry);
            events.push(Event::Estimate(Estimate {
                at,
                sweep: sweep.index,
                pose,
                covariance,
                odometry,
                nis: f64::NAN,
            }));
        }
    }

    /// The dead encoder counts again: the robot is sought around where it was seen last, for as long as it takes.
    fn see_again(&mut self, sweep: &Sweep) {
        let Some(OdometryOutage { since, since_sweep, pose: Some(pose), way_m }) = self.blind.take() else { return };
        let lost = Relocalizer::new(since, since_sweep, pose, sweep.odometry);
        self.lost = Some(lost.after_blindness(way_m));
    }

    /// Nothing that was heard so far is worth anything.
    fn begin_anew(&mut self) {
        (self.tracker, self.lost, self.begun_sweep) = (None, None, None);
        (self.initializer, self.axis) = (Initializer::new(), DominantDirections::default());
        self.grid = OccupancyGrid::new(self.grid.cell_m());
        self.waiting.clear();
        self.trail.clear();
    }
}

/// Covariance of a pose that may be anywhere within `way_m`, in any direction.
pub(super) fn unknown_within(way_m: f64) -> Matrix3<f64> {
    let sigma_rad = PI / 3.0_f64.sqrt();
    let place_m2 = (way_m * way_m).max(AXIS_SIGMA_RAD * AXIS_SIGMA_RAD);
    Matrix3::from_diagonal(&Vector3::new(place_m2, place_m2, sigma_rad * sigma_rad))
}
