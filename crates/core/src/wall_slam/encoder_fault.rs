//! What an encoder fault does to the pose.
//!
//! When the fault is declared, the wheels have been wrong for a second or two, so the poses since then are void. A reversed encoder
//! is used with its sign turned over: the robot continues from its last good pose along the wheels' true motion, and is
//! relocalized, because slip may have moved it meanwhile. A dead encoder starts an outage of the odometry at the last good pose.

use super::Mode;
use super::initializer::Initializer;
use super::initializing::Initializing;
use super::odometry_outage::{HeldPose, OdometryOutage};
use super::params::Params;
use super::relocalizer::Relocalizer;
use super::stages::Stages;
use super::step::{Judged, Predicted, RobotState};
use crate::event::{EncoderState, Event, LocalizationChange, LocalizationEvent, Wheel};
use crate::fault::encoder::EncoderChange;
use crate::geometry::Pose2;
use crate::sweep::Sweep;
use crate::time::Timestamp;

/// How to go on.
#[derive(Debug)]
pub(super) enum Response {
    /// In the same mode.
    Continue(Predicted),
    /// The poses since the reversal were computed anew; the walls must confirm the result.
    Relocalize(Predicted, Relocalizer),
    /// In another mode, with the next sweep.
    Switch(Mode),
}

/// The pose without what a faulty encoder made of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rewound {
    /// Start of the uncertain time.
    pub(super) since: Timestamp,
    /// Its first sweep: walls learnt from it on are void.
    pub(super) since_sweep: u64,
    pub(super) pose: Pose2,
    /// How far the robot may have moved since then, metres.
    pub(super) travel_m: f64,
}

/// Acts on an encoder fault of this sweep, if there is one. `doubt` is the start of the uncertain poses, time and sweep, if there are any.
pub(super) fn respond(
    mut predicted: Predicted,
    judged: &Judged<'_>,
    doubt: Option<(Timestamp, u64)>,
    stages: &mut Stages,
    events: &mut Vec<Event>,
) -> Response {
    let Some(fault) = judged.encoder_fault() else { return Response::Continue(predicted) };
    let (sweep, params) = (judged.sweep(), &stages.params);
    if began_with_map(fault, predicted.robot_mut(), params) {
        return Response::Switch(restart(fault, stages));
    }
    let Some(mut rewound) = rewind(fault, predicted.robot_mut(), sweep, params) else {
        return Response::Continue(predicted);
    };
    // The encoder explains the doubt that there was.
    if let Some((since, since_sweep)) = doubt {
        rewound.since = rewound.since.min(since);
        rewound.since_sweep = rewound.since_sweep.min(since_sweep);
    } else {
        let change = LocalizationChange::Lost;
        events.push(Event::Localization(LocalizationEvent { at: sweep.at, since: rewound.since, change }));
    }
    let Rewound { since, since_sweep, pose, .. } = rewound;
    stages.forget_way();
    let params = &stages.params;
    let robot = predicted.robot_mut();
    robot.ekf.relocate(pose, since_sweep);
    robot.ekf.reset_monitor();
    robot.history.clear();
    if fault.state == EncoderState::Dead {
        let held = HeldPose { robot: predicted.into_robot(), rewound };
        return Response::Switch(held.hold(sweep, params, events).into());
    }
    let relocalizer = Relocalizer::new(since, since_sweep, pose, sweep.odometry, params);
    Response::Relocalize(predicted, relocalizer)
}

/// True if the encoder was faulty from the start of this run's map, or nearly so: then nothing of the map is right.
pub(super) fn began_with_map(fault: EncoderChange, robot: &RobotState, params: &Params) -> bool {
    let since_sweep = fault.since_sweep.unwrap_or(0);
    robot.first_sweep.is_some_and(|first| since_sweep < first + params.start_fault_sweeps)
}

/// Discards the map and initializes again, with a dead encoder once it counts.
pub(super) fn restart(fault: EncoderChange, stages: &mut Stages) -> Mode {
    stages.discard_map();
    if fault.state == EncoderState::Dead {
        OdometryOutage::BeforeMap(Initializer::default()).into()
    } else {
        Initializing::default().into()
    }
}

/// The last good pose, moved along the wheels' true motion where that is known; none without a history.
fn rewind(fault: EncoderChange, robot: &RobotState, sweep: &Sweep, params: &Params) -> Option<Rewound> {
    let since_sweep = fault.since_sweep.unwrap_or(0);
    let is_dead = fault.state == EncoderState::Dead;
    let wheel = usize::from(fault.wheel == Wheel::Right);
    let (last_good, mut rolled) = if is_dead {
        robot.history.since(since_sweep)?
    } else {
        robot.history.before_reversal(since_sweep, wheel, params)?
    };
    let mut last_m = [sweep.left_m, sweep.right_m];
    last_m[wheel] = -last_m[wheel];
    rolled.push(last_m);
    let base_m = robot.ekf.filter.calibration().wheel_base_m;
    let (mut pose, mut travel_m) = (last_good.pose, 0.0);
    for [left_m, right_m] in rolled {
        travel_m += left_m.abs().max(right_m.abs());
        if !is_dead {
            pose = pose.rolled(left_m, right_m, base_m);
        }
    }
    Some(Rewound { since: last_good.at, since_sweep: last_good.sweep, pose, travel_m })
}
