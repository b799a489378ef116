//! The map's frame is not known yet, or the first sweeps are still being processed in it.
//!
//! Sweeps are collected until they agree on the building's axis. Then they are processed a few at a time, because all of them at
//! once would hold up the next sweep; sweeps that arrive meanwhile queue behind them.

use super::Mode;
use super::initializer::{Initialized, Initializer};
use super::lost::Lost;
use super::odometry_outage::OdometryOutage;
use super::relocalizing::Relocalizing;
use super::stages::Stages;
use super::step::{Backlog, Judged, RobotState};
use super::tracking::Tracking;
use crate::event::{EncoderState, Event};
use crate::sweep::Sweep;

/// A robot in a building that it does not know.
#[derive(Debug)]
pub(super) enum Initializing {
    /// The axis is not found.
    Collecting(Initializer),
    /// The axis is found; the collected sweeps are processed.
    CatchingUp(CatchUp),
}

/// The pose of the last processed sweep, and the sweeps after it.
#[derive(Debug)]
pub(super) struct CatchUp {
    following: Following,
    backlog: Backlog,
}

/// The modes that have a pose and follow the wheels.
#[derive(Debug)]
pub(super) enum Following {
    Tracking(Tracking),
    Relocalizing(Relocalizing),
    Lost(Lost),
}

impl Default for Initializing {
    fn default() -> Self {
        Self::Collecting(Initializer::default())
    }
}

impl Initializing {
    pub(super) fn update(self, sweep: &Sweep, stages: &mut Stages, events: &mut Vec<Event>) -> Mode {
        // Without a pose at this sweep the map says nothing of the sensors.
        let judged = Judged::new(sweep, None, stages, events);
        match judged.encoder_fault() {
            None => self.follow(&judged, stages, events),
            Some(fault) => {
                stages.discard_map();
                if fault.state == EncoderState::Dead {
                    let mut initializer = Initializer::default();
                    initializer.keep(&judged, &stages.params);
                    return OdometryOutage::BeforeMap(initializer).into();
                }
                Self::default().follow(&judged, stages, events)
            }
        }
    }

    /// Collects the sweep or queues it.
    fn follow(self, judged: &Judged<'_>, stages: &mut Stages, events: &mut Vec<Event>) -> Mode {
        match self {
            Self::Collecting(mut initializer) => match initializer.add(judged, stages) {
                None => Self::Collecting(initializer).into(),
                Some(Initialized { robot, backlog }) => {
                    CatchUp { following: Following::Tracking(Tracking { robot }), backlog }.step(stages, events)
                }
            },
            Self::CatchingUp(mut catch_up) => {
                catch_up.backlog.push(judged);
                catch_up.step(stages, events)
            }
        }
    }

    /// Processes the whole backlog.
    pub(super) fn end(self, stages: &mut Stages, events: &mut Vec<Event>) -> Mode {
        let mut mode = Mode::Initializing(self);
        while let Mode::Initializing(Self::CatchingUp(catch_up)) = mode {
            mode = catch_up.step(stages, events);
        }
        mode
    }

    /// The robot, once the axis is found.
    pub(super) fn robot(&self) -> Option<&RobotState> {
        match self {
            Self::Collecting(_) => None,
            Self::CatchingUp(CatchUp { following: Following::Tracking(tracking), .. }) => Some(&tracking.robot),
            Self::CatchingUp(CatchUp { following: Following::Relocalizing(relocalizing), .. }) => {
                Some(&relocalizing.robot)
            }
            Self::CatchingUp(CatchUp { following: Following::Lost(lost), .. }) => Some(&lost.robot),
        }
    }
}

impl CatchUp {
    /// Processes a few sweeps; initialization is over once none waits.
    fn step(self, stages: &mut Stages, events: &mut Vec<Event>) -> Mode {
        let Self { mut following, mut backlog } = self;
        for _ in 0..stages.params.catch_up_sweeps {
            let Some(sweep) = backlog.pop() else { break };
            following = following.follow(&sweep.judged(), stages, events);
        }
        if backlog.is_empty() { following.into() } else { Initializing::CatchingUp(Self { following, backlog }).into() }
    }
}

impl Following {
    /// Processes a sweep that was judged before.
    fn follow(self, judged: &Judged<'_>, stages: &mut Stages, events: &mut Vec<Event>) -> Self {
        match self {
            Self::Tracking(Tracking { robot }) => {
                Tracking::follow(robot.predict(judged.sweep()), judged, stages, events)
            }
            Self::Relocalizing(Relocalizing { robot, relocalizer }) => {
                Relocalizing::follow(robot.predict(judged.sweep()), relocalizer, judged, stages, events)
            }
            Self::Lost(Lost { robot, search, trial }) => {
                Lost::follow(robot.predict(judged.sweep()), search, trial, judged, stages, events)
            }
        }
    }
}

impl From<Initializing> for Mode {
    fn from(initializing: Initializing) -> Self {
        Self::Initializing(initializing)
    }
}

impl From<Following> for Mode {
    fn from(following: Following) -> Self {
        match following {
            Following::Tracking(tracking) => Self::Tracking(tracking),
            Following::Relocalizing(relocalizing) => Self::Relocalizing(relocalizing),
            Following::Lost(lost) => Self::Lost(lost),
        }
    }
}
