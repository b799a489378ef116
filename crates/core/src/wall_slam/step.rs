//! The order of the work within a sweep, as types: a [`Predicted`] pose and a [`Judged`] sweep make a [`Corrected`] pose.
//!
//! Each type can be made only from the ones before it. So no echo is used before its sensor is judged, no pose is corrected twice
//! or without its wheels, and nothing is drawn from an uncorrected pose.

use super::params::Params;
use super::place::jump::Hands;
use super::pose_history::PoseHistory;
use super::stages::Stages;
use super::tracking::LearningPermit;
use crate::event::{EncoderState, Estimate, Event};
use crate::fault::encoder::EncoderChange;
use crate::geometry::{Placement, Pose2};
use crate::position::ekf_slam::EkfSlam;
use crate::sweep::Sweep;
use nalgebra::Matrix3;
use std::collections::VecDeque;

/// A robot with a pose in the map.
#[derive(Debug)]
pub(super) struct RobotState {
    pub(super) ekf: EkfSlam,
    pub(super) history: PoseHistory,
    /// The motion of the last prediction.
    step: Pose2,
    /// The first sweep of a map that this run began; none for a saved map.
    pub(super) first_sweep: Option<u64>,
}

/// A robot whose pose includes the wheels' motion of a sweep, but not yet its echoes.
#[derive(Debug)]
pub(super) struct Predicted {
    robot: Box<RobotState>,
    sweep: u64,
}

/// A sweep whose sensors and encoders have been judged.
#[derive(Clone, Copy, Debug)]
pub(super) struct Judged<'s> {
    sweep: &'s Sweep,
    encoder_change: Option<EncoderChange>,
}

/// Judged sweeps that wait for their turn.
#[derive(Debug)]
pub(super) struct Backlog(VecDeque<Sweep>);

/// A robot whose pose includes all of a sweep.
#[derive(Debug)]
pub(super) struct Corrected<'s> {
    pub(super) robot: Box<RobotState>,
    pub(super) sweep: &'s Sweep,
}

impl RobotState {
    pub(super) fn new(ekf: EkfSlam, first_sweep: Option<u64>, params: &Params) -> Box<Self> {
        Box::new(Self { ekf, history: PoseHistory::new(params), step: Pose2::default(), first_sweep })
    }

    /// Moves the pose with the wheels, and predicts the range of each beam that faces a well-known wall.
    pub(super) fn predict(mut self: Box<Self>, sweep: &Sweep) -> Predicted {
        let before = self.ekf.filter.pose();
        self.ekf.predict(sweep.left_m, sweep.right_m);
        self.step = before.inverse() * self.ekf.filter.pose();
        self.ekf.predict_ranges(sweep);
        Predicted { robot: self, sweep: sweep.index }
    }
}

impl Predicted {
    pub(super) fn pose(&self) -> Pose2 {
        self.robot.ekf.filter.pose()
    }

    /// The robot, to change its pose before the correction.
    pub(super) fn robot_mut(&mut self) -> &mut RobotState {
        &mut self.robot
    }

    /// The robot, without a correction: this sweep's motion or echoes are not to be used.
    pub(super) fn into_robot(self) -> Box<RobotState> {
        self.robot
    }

    /// Associates the trusted beams with walls, corrects the pose with them and checks the heading. Learns walls only with a permit.
    pub(super) fn correct<'s>(
        mut self,
        judged: &Judged<'s>,
        permit: Option<LearningPermit>,
        stages: &mut Stages,
    ) -> Corrected<'s> {
        let sweep = judged.sweep;
        debug_assert_eq!(self.sweep, sweep.index, "the prediction of another sweep");
        let way_m = stages.follow_way(sweep, self.robot.step);
        let can_correct = stages.can_correct;
        if can_correct {
            stages.check_heading(&mut self.robot.ekf, sweep);
        }
        self.robot.ekf.correct(sweep, permit.is_some(), |sensor| can_correct && stages.detector.is_trusted(sensor));
        stages.learn_errors(&self.robot.ekf);
        stages.check_place(sweep, self.robot.ekf.filter.pose(), way_m);
        Corrected { robot: self.robot, sweep }
    }

    /// Leaves the pose where the wheels put it: the walls around it are not those that the map has there.
    ///
    /// Tells what hands did to the robot meanwhile, too.
    pub(super) fn hold<'s>(mut self, judged: &Judged<'s>, stages: &mut Stages) -> (Corrected<'s>, Option<Hands>) {
        let sweep = judged.sweep;
        let hands = stages.follow_way(sweep, self.robot.step).err();
        // Wherever the robot is, the building's axis is the same.
        if stages.can_correct && hands.is_none() {
            stages.check_heading(&mut self.robot.ekf, sweep);
        }
        self.robot.ekf.ignore_sweep();
        (Corrected { robot: self.robot, sweep }, hands)
    }
}

impl<'s> Judged<'s> {
    /// Runs the fault tests. With a `pose` the map is evidence, too: what it says a beam must hear from there.
    pub(super) fn new(sweep: &'s Sweep, pose: Option<Pose2>, stages: &mut Stages, events: &mut Vec<Event>) -> Self {
        stages.judge_sensors(sweep, pose.map(Placement::from), events);
        Self { sweep, encoder_change: stages.judge_encoders(sweep, events) }
    }

    pub(super) fn sweep(&self) -> &'s Sweep {
        self.sweep
    }

    /// The encoder that this sweep found to be dead or reversed, or no longer reversed.
    pub(super) fn encoder_fault(&self) -> Option<EncoderChange> {
        self.encoder_change.filter(|change| change.before != EncoderState::Dead)
    }

    /// True if a dead encoder counts again.
    pub(super) fn has_encoder_recovered(&self) -> bool {
        self.encoder_change.is_some_and(|change| change.before == EncoderState::Dead)
    }
}

impl Backlog {
    /// The sweeps of an initializer, which takes judged ones only.
    pub(super) fn new(judged: Vec<Sweep>) -> Self {
        Self(judged.into())
    }

    pub(super) fn push(&mut self, judged: &Judged<'_>) {
        self.0.push_back(judged.sweep.clone());
    }

    pub(super) fn pop(&mut self) -> Option<JudgedEarlier> {
        self.0.pop_front().map(JudgedEarlier)
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

/// A sweep out of the backlog.
#[derive(Debug)]
pub(super) struct JudgedEarlier(Sweep);

impl JudgedEarlier {
    /// The sweep. What its encoders told was acted on when it came.
    pub(super) fn judged(&self) -> Judged<'_> {
        Judged { sweep: &self.0, encoder_change: None }
    }
}

impl Corrected<'_> {
    /// Publishes the pose, with `covariance` in place of the filter's if it is given, and gives the robot back for the next sweep.
    pub(super) fn publish(self, covariance: Option<Matrix3<f64>>, events: &mut Vec<Event>) -> Box<RobotState> {
        let Self { mut robot, sweep } = self;
        let pose = robot.ekf.filter.pose();
        robot.history.push(sweep, pose);
        events.push(Event::Estimate(Estimate {
            at: sweep.at,
            sweep: sweep.index,
            pose,
            covariance: covariance.unwrap_or_else(|| robot.ekf.stated_covariance()),
            odometry: sweep.odometry,
            nis: robot.ekf.nis(),
        }));
        robot
    }
}
