//! The robot is elsewhere: its pose follows the wheels, nothing is learnt or drawn in the map, and it is sought in the map for as long as it
//! takes. Meanwhile it draws a second map ([`LocalMap`]), which may tell the place later.

use super::Mode;
use super::encoder_fault::{self, Response};
use super::initializing::Following;
use super::local_map::LocalMap;
use super::odometry_outage::unknown_within;
use super::place::map_match::Join;
use super::place::search::{Find, PlaceSearch};
use super::relocalizing::Relocalizing;
use super::stages::Stages;
use super::step::{Corrected, Judged, Predicted, RobotState};
use super::tracking::Tracking;
use crate::event::{Event, LocalizationChange, LocalizationEvent};
use crate::geometry::{Pose2, wrap_angle};
use crate::position::ekf_slam::EkfSlam;
use crate::sweep::Sweep;
use crate::time::Timestamp;

/// A robot that is elsewhere.
#[derive(Debug)]
pub(super) struct Lost {
    pub(super) robot: Box<RobotState>,
    pub(super) seek: Box<Seek>,
}

/// How it is sought.
#[derive(Debug)]
pub(super) struct Seek {
    /// Where the latest readings fit.
    search: PlaceSearch,
    trial: Option<Trial>,
    /// The map since the loss.
    local: Option<Box<LocalMap>>,
}

/// A pose that was found is tried for some way: walls correct it, but nothing is learnt.
#[derive(Debug)]
struct Trial {
    /// The filter before.
    ekf: EkfSlam,
    is_near: bool,
}

impl Lost {
    /// Says that the pose is lost, and begins to search; `onset` is the last sweep without doubt.
    pub(super) fn begin(
        corrected: &Corrected<'_>,
        onset: (u64, Timestamp),
        stages: &mut Stages,
        events: &mut Vec<Event>,
    ) -> Box<Seek> {
        let (pose, at) = (corrected.robot.ekf.filter.pose(), corrected.sweep.at);
        let change = LocalizationChange::Lost;
        events.push(Event::Localization(LocalizationEvent { at, since: onset.1, change }));
        // What was drawn since is in the wrong place, and would explain a wrong pose.
        if corrected.sweep.index > onset.0 + stages.place_params.take_back_sweeps {
            stages.grid.take_back(onset.0);
        }
        let search = PlaceSearch::new(onset, pose, &stages.trail, &stages.scene());
        Box::new(Seek { search, trial: None, local: LocalMap::begin(stages) })
    }

    pub(super) fn update(self, sweep: &Sweep, stages: &mut Stages, events: &mut Vec<Event>) -> Mode {
        let Self { robot, seek } = self;
        let predicted = robot.predict(sweep);
        // The map says nothing of the sensors while the pose is unknown.
        let judged = Judged::new(sweep, None, stages, events);
        let doubt = Some((seek.search.since, seek.search.since_sweep));
        match encoder_fault::respond(predicted, &judged, doubt, stages, events) {
            Response::Continue(predicted) => Self::follow(predicted, seek, &judged, stages, events).into(),
            Response::Relocalize(predicted, relocalizer) => {
                Relocalizing::follow(predicted, relocalizer, &judged, stages, events).into()
            }
            Response::Switch(mode) => mode,
        }
    }

    /// Follows the wheels and searches a little farther, or tries the pose that was found.
    pub(super) fn follow(
        predicted: Predicted,
        mut seek: Box<Seek>,
        judged: &Judged<'_>,
        stages: &mut Stages,
        events: &mut Vec<Event>,
    ) -> Following {
        let Some(trial) = seek.trial.take() else {
            let (mut corrected, is_carried) = predicted.hold(judged, stages);
            if is_carried {
                seek.search.restart(&stages.trail);
                seek.local = LocalMap::begin(stages);
            }
            if let Some(join) = seek.draw(corrected.sweep, stages) {
                let pose = seek.pose_after(join, stages);
                relocate(&mut corrected.robot, pose, seek.search.since_sweep);
                return seek.regain(corrected, Some(join), stages, events);
            }
            if let Some(Find { pose, is_near }) = stages.search(&mut seek.search) {
                seek.trial = Some(Trial::begin(&mut corrected.robot, pose, is_near, seek.search.since_sweep));
                stages.place.reset();
            }
            return Self::publish(corrected, seek, stages, events);
        };
        let mut corrected = predicted.correct(judged, None, stages);
        if let Some(join) = seek.draw(corrected.sweep, stages) {
            let pose = seek.pose_after(join, stages);
            relocate(&mut corrected.robot, pose, seek.search.since_sweep);
            return seek.regain(corrected, Some(join), stages, events);
        }
        match trial.verdict(stages) {
            None => seek.trial = Some(trial),
            Some(true) => match seek.confirm(&trial, &corrected, stages) {
                None => seek.trial = Some(trial),
                Some((true, join)) => return seek.regain(corrected, join, stages, events),
                Some((false, _)) => seek.reject(trial, &mut corrected, stages),
            },
            Some(false) => seek.reject(trial, &mut corrected, stages),
        }
        Self::publish(corrected, seek, stages, events)
    }

    fn publish(corrected: Corrected<'_>, mut seek: Box<Seek>, stages: &Stages, events: &mut Vec<Event>) -> Following {
        if let Some(places) = seek.local.as_mut().and_then(|local| local.ambiguity()) {
            let change = LocalizationChange::Ambiguous { places };
            events.push(Event::Localization(LocalizationEvent {
                at: corrected.sweep.at,
                since: seek.search.since,
                change,
            }));
        }
        let covariance = unknown_within(stages.params.lost_within_m, &stages.params);
        Following::Lost(Self { robot: corrected.publish(Some(covariance), events), seek })
    }
}

impl Seek {
    /// Draws a sweep into the map since the loss. How that map joins the one before, once that is sure.
    fn draw(&mut self, sweep: &Sweep, stages: &Stages) -> Option<Join> {
        self.local.as_mut()?.update(sweep, &self.search, stages)
    }

    /// Whether the map since the loss allows the pose that was tried, and how it joins the one before; none while that is open.
    fn confirm(&mut self, trial: &Trial, corrected: &Corrected<'_>, stages: &Stages) -> Option<(bool, Option<Join>)> {
        let Self { search, local: Some(local), .. } = self else { return Some((true, None)) };
        let is_early = search.way_since_loss_m(&stages.trail) < stages.place_params.join.sparse_until_m;
        if trial.is_near || (local.is_sparse() && is_early) {
            return Some((true, None));
        }
        let join = local.confirm(corrected.robot.ekf.filter.pose(), search, stages)?;
        Some((join.is_some(), join))
    }

    /// The pose that was tried is wrong: follows the wheels again from the one before.
    fn reject(&mut self, trial: Trial, corrected: &mut Corrected<'_>, stages: &mut Stages) {
        let believed = self.search.believed(&stages.trail);
        corrected.robot.ekf = trial.ekf;
        corrected.robot.ekf.relocate(believed, self.search.since_sweep);
        stages.reject(&mut self.search);
    }

    /// The robot in the map before, if the maps join so.
    fn pose_after(&self, join: Join, stages: &Stages) -> Pose2 {
        let local = self.local.as_ref().and_then(|local| local.pose());
        local.map_or_else(|| self.search.believed(&stages.trail), |pose| join.transform(stages.grid.cell_m()) * pose)
    }

    /// Goes on at the pose that was found, and takes over what was drawn meanwhile.
    fn regain<'s>(
        self: Box<Self>,
        mut corrected: Corrected<'s>,
        join: Option<Join>,
        stages: &mut Stages,
        events: &mut Vec<Event>,
    ) -> Following {
        let (believed, pose) = (self.search.believed(&stages.trail), corrected.robot.ekf.filter.pose());
        let moved_m = (pose.position() - believed.position()).norm();
        let turned_rad = wrap_angle(pose.theta_rad - believed.theta_rad);
        let (at, since) = (corrected.sweep.at, self.search.since);
        if moved_m < stages.place_params.near_m && turned_rad.abs() < stages.params.same_pose_rad {
            stages.grid.restore_taken_back();
        } else {
            stages.grid.forget_marks();
        }
        if let (Some(join), Some(local), false) = (join, &self.local, corrected.robot.ekf.is_frozen()) {
            stages.adopt(local.grid(), join);
        }
        stages.place.reset();
        corrected.robot.ekf.reset_monitor();
        let change = LocalizationChange::Regained { moved_m, turned_rad };
        events.push(Event::Localization(LocalizationEvent { at, since, change }));
        Following::Tracking(Tracking { robot: corrected.publish(None, events) })
    }
}

impl Trial {
    /// Puts the robot where it may be.
    fn begin(robot: &mut RobotState, pose: Pose2, is_near: bool, since_sweep: u64) -> Self {
        let ekf = robot.ekf.clone();
        relocate(robot, pose, since_sweep);
        Self { ekf, is_near }
    }

    /// Whether the pose is right; none while that is open.
    fn verdict(&self, stages: &Stages) -> Option<bool> {
        let (search, record) = (&stages.place_params.search, stages.place.record());
        if stages.place.is_contradicted() {
            return Some(false);
        }
        let (min_way_m, min_explained, min_told) = if self.is_near {
            (search.near_trial_m, search.min_near_explained, 0.0)
        } else {
            (search.trial_m, search.trial_explained, search.trial_told)
        };
        let fits = record.explained() >= min_explained && record.told() >= min_told;
        match record.way_m {
            way_m if way_m < min_way_m => None,
            _ if fits => Some(true),
            way_m if way_m < 2.0 * min_way_m => None,
            _ => Some(false),
        }
    }
}

/// Puts the robot at a pose. What was learnt since that sweep is wrong.
fn relocate(robot: &mut RobotState, pose: Pose2, since_sweep: u64) {
    robot.ekf.relocate(pose, since_sweep);
    robot.ekf.reset_monitor();
    robot.history.clear();
}

impl From<Lost> for Mode {
    fn from(lost: Lost) -> Self {
        Self::Lost(lost)
    }
}
