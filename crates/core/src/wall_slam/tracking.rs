//! The pose is known: each sweep corrects it, updates the walls and is drawn into the map.

use super::Mode;
use super::encoder_fault::{self, Response};
use super::initializing::Following;
use super::lost::Lost;
use super::place::search::PlaceSearch;
use super::relocalizing::Relocalizing;
use super::stages::Stages;
use super::step::{Corrected, Judged, Predicted, RobotState};
use crate::event::Event;
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
        let may_learn = !stages.encoders.is_suspected() && !stages.place.is_suspicious();
        let permit = may_learn.then_some(LearningPermit(()));
        let corrected = predicted.correct(judged, permit, stages);
        let search = detect_loss(&corrected, stages, events);
        if let Some(permit) = permit.filter(|_| !stages.place.is_suspicious()) {
            stages.update_map(&corrected, permit);
        }
        let robot = corrected.publish(None, events);
        match search {
            None => Following::Tracking(Self { robot }),
            Some(search) => Following::Lost(Lost { robot, search, trial: None }),
        }
    }
}

/// Begins a search if the echoes contradict the walls or the map.
fn detect_loss(corrected: &Corrected<'_>, stages: &mut Stages, events: &mut Vec<Event>) -> Option<Box<PlaceSearch>> {
    let Corrected { robot, sweep } = corrected;
    if robot.ekf.monitor().is_sure() {
        stages.last_agreement = (sweep.index, sweep.at);
    }
    let onset = if let Some(onset) = stages.axis_monitor.onset() {
        stages.axis_monitor.reset();
        onset
    } else if stages.place.is_lost() {
        stages.place.onset()
    } else if stages.can_detect_loss && robot.ekf.monitor().is_lost() {
        stages.last_agreement
    } else {
        return None;
    };
    Some(Lost::begin(corrected, onset, stages, events))
}
