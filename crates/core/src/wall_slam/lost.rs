//! The robot is elsewhere: its pose follows the wheels, nothing is learnt or drawn, and it is sought in the map for as long as it takes.

use super::Mode;
use super::encoder_fault::{self, Response};
use super::initializing::Following;
use super::odometry_outage::unknown_within;
use super::place::search::PlaceSearch;
use super::relocalizing::Relocalizing;
use super::stages::Stages;
use super::step::{Corrected, Judged, Predicted, RobotState};
use super::tracking::Tracking;
use crate::event::{Event, LocalizationChange, LocalizationEvent};
use crate::geometry::{Pose2, wrap_angle};
use crate::sweep::Sweep;
use crate::time::Timestamp;

/// A robot that is elsewhere.
#[derive(Debug)]
pub(super) struct Lost {
    pub(super) robot: Box<RobotState>,
    pub(super) search: Box<PlaceSearch>,
}

impl Lost {
    /// Says that the pose is lost, and begins to search; `onset` is the last sweep without doubt.
    pub(super) fn begin(
        corrected: &Corrected<'_>,
        onset: (u64, Timestamp),
        stages: &Stages,
        events: &mut Vec<Event>,
    ) -> Box<PlaceSearch> {
        let (pose, at) = (corrected.robot.ekf.filter.pose(), corrected.sweep.at);
        let change = LocalizationChange::Lost;
        events.push(Event::Localization(LocalizationEvent { at, since: onset.1, change }));
        Box::new(PlaceSearch::new(onset, pose, &stages.trail, &stages.scene()))
    }

    pub(super) fn update(self, sweep: &Sweep, stages: &mut Stages, events: &mut Vec<Event>) -> Mode {
        let Self { robot, search } = self;
        let predicted = robot.predict(sweep);
        // The map says nothing of the sensors while the pose is unknown.
        let judged = Judged::new(sweep, None, stages, events);
        let doubt = Some((search.since, search.since_sweep));
        match encoder_fault::respond(predicted, &judged, doubt, stages, events) {
            Response::Continue(predicted) => Self::follow(predicted, search, &judged, stages, events).into(),
            Response::Relocalize(predicted, relocalizer) => {
                Relocalizing::follow(predicted, relocalizer, &judged, stages, events).into()
            }
            Response::Switch(mode) => mode,
        }
    }

    /// Follows the wheels and searches a little farther.
    pub(super) fn follow(
        predicted: Predicted,
        mut search: Box<PlaceSearch>,
        judged: &Judged<'_>,
        stages: &mut Stages,
        events: &mut Vec<Event>,
    ) -> Following {
        let mut corrected = predicted.hold(judged, stages);
        let Some(pose) = stages.search(&mut search) else {
            let covariance = unknown_within(stages.params.lost_within_m, &stages.params);
            return Following::Lost(Self { robot: corrected.publish(Some(covariance), events), search });
        };
        let change = move_to(&mut corrected.robot, pose, search.since_sweep);
        stages.place.reset();
        stages.learn_errors(&corrected.robot.ekf);
        events.push(Event::Localization(LocalizationEvent { at: corrected.sweep.at, since: search.since, change }));
        Following::Tracking(Tracking { robot: corrected.publish(None, events) })
    }
}

/// Puts the robot where it was found.
fn move_to(robot: &mut RobotState, pose: Pose2, since_sweep: u64) -> LocalizationChange {
    let before = robot.ekf.filter.pose();
    robot.ekf.relocate(pose, since_sweep);
    robot.ekf.reset_monitor();
    robot.history.clear();
    let moved_m = (pose.position() - before.position()).norm();
    LocalizationChange::Regained { moved_m, turned_rad: wrap_angle(pose.theta_rad - before.theta_rad) }
}

impl From<Lost> for Mode {
    fn from(lost: Lost) -> Self {
        Self::Lost(lost)
    }
}
