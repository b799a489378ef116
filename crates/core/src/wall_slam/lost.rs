//! The robot is elsewhere: its pose follows the wheels, nothing is learnt or drawn, and it is sought in the map for as long as it takes.

use super::Mode;
use super::encoder_fault::{self, Response};
use super::initializing::Following;
use super::odometry_outage::unknown_within;
use super::place::search::{Find, PlaceSearch};
use super::relocalizing::Relocalizing;
use super::stages::Stages;
use super::step::{Corrected, Judged, Predicted, RobotState};
use super::tracking::Tracking;
use crate::event::{Event, LocalizationChange, LocalizationEvent};
use crate::geometry::wrap_angle;
use crate::position::ekf_slam::EkfSlam;
use crate::sweep::Sweep;
use crate::time::Timestamp;

/// Why a robot whose surroundings are in the map is not found.
const AMBIGUOUS: &str = "two places of the map explain the readings nearly alike: drive on to where they differ";

/// A robot that is elsewhere.
#[derive(Debug)]
pub(super) struct Lost {
    pub(super) robot: Box<RobotState>,
    pub(super) search: Box<PlaceSearch>,
    pub(super) trial: Option<Box<Trial>>,
}

/// A pose that was found is tried for some way: walls correct it, but nothing is learnt.
#[derive(Debug)]
pub(super) struct Trial {
    /// The filter before.
    ekf: EkfSlam,
    is_near: bool,
    moved_m: f64,
    turned_rad: f64,
}

impl Lost {
    /// Says that the pose is lost, and begins to search; `onset` is the last sweep without doubt.
    pub(super) fn begin(
        corrected: &Corrected<'_>,
        onset: (u64, Timestamp),
        stages: &mut Stages,
        events: &mut Vec<Event>,
    ) -> Box<PlaceSearch> {
        stages.grid.take_back(onset.0);
        let (pose, at) = (corrected.robot.ekf.filter.pose(), corrected.sweep.at);
        let change = LocalizationChange::Lost;
        events.push(Event::Localization(LocalizationEvent { at, since: onset.1, change }));
        Box::new(PlaceSearch::new(onset, pose, stages.place.hands(), &stages.trail, &stages.scene()))
    }

    pub(super) fn update(self, sweep: &Sweep, stages: &mut Stages, events: &mut Vec<Event>) -> Mode {
        let Self { robot, search, trial } = self;
        let predicted = robot.predict(sweep);
        // The map says nothing of the sensors while the pose is unknown.
        let judged = Judged::new(sweep, None, stages, events);
        let doubt = Some((search.since, search.since_sweep));
        match encoder_fault::respond(predicted, &judged, doubt, stages, events) {
            Response::Continue(predicted) => Self::follow(predicted, search, trial, &judged, stages, events).into(),
            Response::Relocalize(predicted, relocalizer) => {
                Relocalizing::follow(predicted, relocalizer, &judged, stages, events).into()
            }
            Response::Switch(mode) => mode,
        }
    }

    /// Follows the wheels and searches a little farther, or tries the pose that was found.
    pub(super) fn follow(
        predicted: Predicted,
        mut search: Box<PlaceSearch>,
        trial: Option<Box<Trial>>,
        judged: &Judged<'_>,
        stages: &mut Stages,
        events: &mut Vec<Event>,
    ) -> Following {
        let Some(trial) = trial else {
            let (mut corrected, hands) = predicted.hold(judged, stages);
            if let Some(hands) = hands {
                search.restart(hands, &stages.trail);
            }
            let found = stages.search(&mut search);
            if search.becomes_ambiguous() {
                let change = LocalizationChange::Doubted { reason: AMBIGUOUS.into() };
                events.push(Event::Localization(LocalizationEvent {
                    at: judged.sweep().at,
                    since: search.since,
                    change,
                }));
            }
            let trial = found.map(|find| Box::new(Trial::begin(&mut corrected.robot, &find, search.since_sweep)));
            if trial.is_some() {
                stages.place.reset();
            }
            return Self::publish(corrected, search, trial, stages, events);
        };
        let mut corrected = predicted.correct(judged, None, stages);
        match trial.verdict(&search, stages) {
            None => Self::publish(corrected, search, Some(trial), stages, events),
            Some(true) => {
                let Trial { moved_m, turned_rad, .. } = *trial;
                let (at, since) = (corrected.sweep.at, search.since);
                let change = LocalizationChange::Regained { moved_m, turned_rad };
                if stages.params.is_same_pose(moved_m, turned_rad) {
                    // What was drawn since the onset was right.
                    stages.grid.restore_taken_back();
                }
                corrected.robot.ekf.unlearn_contradicted_walls();
                corrected.robot.ekf.reset_monitor();
                events.push(Event::Localization(LocalizationEvent { at, since, change }));
                Following::Tracking(Tracking { robot: corrected.publish(None, events) })
            }
            Some(false) => {
                let believed = search.believed(&stages.trail);
                corrected.robot.ekf = trial.ekf;
                corrected.robot.ekf.relocate(believed, search.since_sweep);
                stages.reject(&mut search);
                Self::publish(corrected, search, None, stages, events)
            }
        }
    }

    fn publish(
        corrected: Corrected<'_>,
        search: Box<PlaceSearch>,
        trial: Option<Box<Trial>>,
        stages: &Stages,
        events: &mut Vec<Event>,
    ) -> Following {
        let covariance = unknown_within(stages.params.lost_within_m, &stages.params);
        Following::Lost(Self { robot: corrected.publish(Some(covariance), events), search, trial })
    }
}

impl Trial {
    /// Puts the robot where it may be.
    fn begin(robot: &mut RobotState, find: &Find, since_sweep: u64) -> Self {
        let (ekf, before) = (robot.ekf.clone(), robot.ekf.filter.pose());
        robot.ekf.relocate(find.pose, since_sweep);
        robot.ekf.reset_monitor();
        robot.history.clear();
        let moved_m = (find.pose.position() - before.position()).norm();
        let turned_rad = wrap_angle(find.pose.theta_rad - before.theta_rad);
        Self { ekf, is_near: find.is_near, moved_m, turned_rad }
    }

    /// Whether the pose is right; none while that is open.
    fn verdict(&self, search: &PlaceSearch, stages: &Stages) -> Option<bool> {
        let (params, record) = (&stages.place_params.search, stages.place.record());
        if stages.place.is_contradicted() {
            return Some(false);
        }
        let (min_way_m, min_explained, min_told) = match (self.is_near, search.is_pushed()) {
            (false, _) => (params.trial_m, params.trial_explained, params.trial_told),
            (true, false) => (params.near_trial_m, params.near_trial_explained, params.near_trial_told),
            // The push explains the loss: the map need not tell anything of where the robot goes next.
            (true, true) => (params.near_trial_m, params.min_near_explained, 0.0),
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

impl From<Lost> for Mode {
    fn from(lost: Lost) -> Self {
        Self::Lost(lost)
    }
}
