//! The pose is known: each sweep corrects it, updates the walls and is drawn into the map.

use super::Mode;
use super::encoder_fault::{self, Response};
use super::initializing::Following;
use super::relocalizer::Relocalizer;
use super::relocalizing::Relocalizing;
use super::stages::Stages;
use super::step::{Corrected, Judged, Predicted, RobotState};
use crate::event::{Event, LocalizationChange, LocalizationEvent};
use crate::sweep::Sweep;

/// A robot that knows its pose.
#[derive(Debug)]
pub(super) struct Tracking {
    pub(super) robot: Box<RobotState>,
}

/// Permits learning walls and drawing the map. Only tracking gives it, and only while no encoder is suspected.
#[derive(Clone, Copy, Debug)]
pub(super) struct LearningPermit(());

impl Tracking {
    pub(super) fn update(self, sweep: &Sweep, stages: &mut Stages, events: &mut Vec<Event>) -> Mode {
        let predicted = self.robot.predict(sweep);
        let map_pose = (!stages.encoders.is_suspected()).then(|| predicted.pose());
        let judged = Judged::new(sweep, map_pose, stages, events);
        match encoder_fault::respond(predicted, &judged, None, stages, events) {
            Response::Continue(predicted) => Self::follow(predicted, &judged, stages, events).into(),
            Response::Relocalize(predicted, relocalizer) => {
                Relocalizing::follow(predicted, relocalizer, &judged, stages, events).into()
            }
            Response::Switch(mode) => mode,
        }
    }

    /// Corrects the pose and updates the map; if the echoes contradict the walls, relocalization starts with the next sweep.
    pub(super) fn follow(
        predicted: Predicted,
        judged: &Judged<'_>,
        stages: &mut Stages,
        events: &mut Vec<Event>,
    ) -> Following {
        let permit = (!stages.encoders.is_suspected()).then_some(LearningPermit(()));
        let corrected = predicted.correct(judged, permit, stages);
        let relocalizer = detect_loss(&corrected, stages, events);
        if let Some(permit) = permit {
            stages.update_map(&corrected, permit);
        }
        let robot = corrected.publish(None, events);
        match relocalizer {
            None => Following::Tracking(Self { robot }),
            Some(relocalizer) => Following::Relocalizing(Relocalizing { robot, relocalizer }),
        }
    }
}

/// Starts a relocalization if the echoes contradict the walls.
fn detect_loss(corrected: &Corrected<'_>, stages: &mut Stages, events: &mut Vec<Event>) -> Option<Relocalizer> {
    let Corrected { robot, sweep } = corrected;
    if robot.ekf.monitor().is_sure() {
        stages.last_agreement = (sweep.index, sweep.at);
    }
    if !stages.can_detect_loss || !robot.ekf.monitor().is_lost() {
        return None;
    }
    let (since_sweep, since) = stages.last_agreement;
    let change = LocalizationChange::Lost;
    events.push(Event::Localization(LocalizationEvent { at: sweep.at, since, change }));
    Some(Relocalizer::new(since, since_sweep, robot.ekf.filter.pose(), sweep.odometry, &stages.params))
}
