//! A wheel encoder is dead: the motion is unknown until it counts again.
//!
//! The pose is held where the encoder last counted. Nothing is learnt or drawn, and the pose is the less certain the farther the
//! other wheel rolls. Once the encoder counts again, the robot is relocalized among the known walls, for as long as it takes.

use super::Mode;
use super::encoder_fault::{self, Rewound};
use super::initializer::Initializer;
use super::initializing::Initializing;
use super::params::Params;
use super::relocalizer::Relocalizer;
use super::relocalizing::Relocalizing;
use super::stages::Stages;
use super::step::{Judged, RobotState};
use crate::event::{Estimate, Event};
use crate::sweep::Sweep;
use nalgebra::{Matrix3, Vector3};
use std::f64::consts::PI;

/// A robot that does not know how it moves.
#[derive(Debug)]
pub(super) enum OdometryOutage {
    /// There was no pose yet; the initializer goes on when the encoder counts again.
    BeforeMap(Initializer),
    /// The pose is held.
    PoseHeld(HeldPose),
}

/// The last pose before the outage.
#[derive(Debug)]
pub(super) struct HeldPose {
    pub(super) robot: Box<RobotState>,
    /// `travel_m` grows with the other wheel.
    pub(super) rewound: Rewound,
}

impl OdometryOutage {
    pub(super) fn update(self, sweep: &Sweep, stages: &mut Stages, events: &mut Vec<Event>) -> Mode {
        let judged = Judged::new(sweep, None, stages, events);
        match self {
            Self::BeforeMap(initializer) if judged.has_encoder_recovered() => {
                Initializing::Collecting(initializer).into()
            }
            Self::PoseHeld(held) if judged.has_encoder_recovered() => {
                Mode::Relocalizing(held.relocalize(sweep, &stages.params))
            }
            Self::BeforeMap(initializer) => match judged.encoder_fault() {
                None => Self::BeforeMap(initializer).into(),
                Some(fault) => encoder_fault::restart(fault, stages),
            },
            Self::PoseHeld(held) => match judged.encoder_fault() {
                Some(fault) if encoder_fault::began_with_map(fault, &held.robot, &stages.params) => {
                    encoder_fault::restart(fault, stages)
                }
                // The other encoder died, too. There are no poses to take back.
                Some(_) | None => held.hold(sweep, &stages.params, events).into(),
            },
        }
    }
}

impl HeldPose {
    /// Publishes the held pose for a sweep.
    pub(super) fn hold(mut self, sweep: &Sweep, params: &Params, events: &mut Vec<Event>) -> OdometryOutage {
        self.rewound.travel_m += sweep.left_m.abs().max(sweep.right_m.abs());
        events.push(Event::Estimate(Estimate {
            at: sweep.at,
            sweep: sweep.index,
            pose: self.rewound.pose,
            covariance: unknown_within(self.rewound.travel_m, params),
            odometry: sweep.odometry,
            nis: f64::NAN,
        }));
        OdometryOutage::PoseHeld(self)
    }

    /// The encoder counts again: the robot is somewhere around the held pose.
    fn relocalize(self, sweep: &Sweep, params: &Params) -> Relocalizing {
        let Rewound { since, since_sweep, pose, travel_m } = self.rewound;
        let relocalizer = Relocalizer::new(since, since_sweep, pose, sweep.odometry, params);
        Relocalizing { robot: self.robot, relocalizer: relocalizer.after_outage(travel_m) }
    }
}

impl From<OdometryOutage> for Mode {
    fn from(outage: OdometryOutage) -> Self {
        Self::OdometryOutage(outage)
    }
}

/// Covariance of a pose that may be anywhere within `travel_m`, with any heading.
pub(super) fn unknown_within(travel_m: f64, params: &Params) -> Matrix3<f64> {
    // Of a heading that is uniform over the circle.
    let sigma_rad = PI / 3.0_f64.sqrt();
    let position_m2 = (travel_m * travel_m).max(params.axis_sigma_rad * params.axis_sigma_rad);
    Matrix3::from_diagonal(&Vector3::new(position_m2, position_m2, sigma_rad * sigma_rad))
}
