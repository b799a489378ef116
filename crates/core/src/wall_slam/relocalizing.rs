//! The pose is in doubt after an encoder fault: the filter goes on, nothing is learnt, and the recent returns are matched with the walls known before.

use super::Mode;
use super::encoder_fault::{self, Response};
use super::initializing::Following;
use super::relocalizer::Relocalizer;
use super::stages::Stages;
use super::step::{Judged, Predicted, RobotState};
use super::tracking::Tracking;
use crate::event::{Event, LocalizationChange, LocalizationEvent};
use crate::geometry::wrap_angle;
use crate::sweep::Sweep;

/// A robot that an encoder fault has misplaced.
#[derive(Debug)]
pub(super) struct Relocalizing {
    pub(super) robot: Box<RobotState>,
    pub(super) relocalizer: Relocalizer,
}

impl Relocalizing {
    pub(super) fn update(self, sweep: &Sweep, stages: &mut Stages, events: &mut Vec<Event>) -> Mode {
        let Self { robot, relocalizer } = self;
        let predicted = robot.predict(sweep);
        // The map says nothing of the sensors while the pose is in doubt.
        let judged = Judged::new(sweep, None, stages, events);
        let doubt = Some((relocalizer.since, relocalizer.since_sweep));
        match encoder_fault::respond(predicted, &judged, doubt, stages, events) {
            Response::Continue(predicted) => Self::follow(predicted, relocalizer, &judged, stages, events).into(),
            Response::Relocalize(predicted, relocalizer) => {
                Self::follow(predicted, relocalizer, &judged, stages, events).into()
            }
            Response::Switch(mode) => mode,
        }
    }

    /// Corrects the pose without learning, then searches for a better one.
    pub(super) fn follow(
        predicted: Predicted,
        mut relocalizer: Relocalizer,
        judged: &Judged<'_>,
        stages: &mut Stages,
        events: &mut Vec<Event>,
    ) -> Following {
        let mut corrected = predicted.correct(judged, None, stages);
        let sweep = corrected.sweep;
        relocalizer.add(sweep, |sensor| stages.detector.is_trusted(sensor), &stages.params);
        let Some(change) = search(&mut corrected.robot, &relocalizer, sweep, stages) else {
            let robot = corrected.publish(relocalizer.covariance(&stages.params), events);
            return Following::Relocalizing(Self { robot, relocalizer });
        };
        corrected.robot.ekf.reset_monitor();
        stages.learn_errors(&corrected.robot.ekf);
        events.push(Event::Localization(LocalizationEvent { at: sweep.at, since: relocalizer.since, change }));
        Following::Tracking(Tracking { robot: corrected.publish(None, events) })
    }
}

/// Moves the robot where the returns fit, if they do. Tells how the relocalization ended; none while it goes on.
fn search(
    robot: &mut RobotState,
    relocalizer: &Relocalizer,
    sweep: &Sweep,
    stages: &mut Stages,
) -> Option<LocalizationChange> {
    let Stages { params, finder, .. } = stages;
    let ekf = &mut robot.ekf;
    let before = ekf.filter.pose();
    let walls = ekf.known_walls(relocalizer.since_sweep);
    if let Some(pose) = relocalizer.find(sweep.odometry, finder, ekf.params(), walls, params) {
        let moved_m = (pose.position() - before.position()).norm();
        let turned_rad = wrap_angle(pose.theta_rad - before.theta_rad);
        if !params.is_same_pose(moved_m, turned_rad) {
            ekf.relocate(pose, relocalizer.since_sweep);
        }
        return Some(LocalizationChange::Regained { moved_m, turned_rad });
    }
    None
}
