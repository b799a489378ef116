//! Hands that carry the robot away or push it aside. Its wheels stand still meanwhile.

use super::{LIFT_S, RobotFault};
use crate::random::Random;
use crate::robot::BODY_RADIUS_M;
use crate::route::RouteGrid;
use crate::world::World;
use nalgebra::Vector2;
use slamd_core::{Point, Pose2};
use std::f64::consts::PI;

/// The robot stops within this time, seconds.
const STOP_S: f64 = 1.0;
/// It stands for this time afterwards, seconds.
const REST_S: f64 = 0.5;
/// A push takes this time, seconds.
const PUSH_S: f64 = 0.5;
/// Minimum distance between the old and the new place of a kidnapped robot, metres.
const MIN_CARRY_M: f64 = 1.5;
/// Minimum distance between a robot that was carried or pushed and everything, metres.
const CLEARANCE_M: f64 = BODY_RADIUS_M + 0.04;

/// What the hands do now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Act {
    /// Nothing: the robot drives.
    Free,
    /// The robot stands still; its sensors may be in the air.
    Hold { is_lifted: bool },
    /// The robot stands still at this pose from now on.
    Carry(Pose2),
}

/// The hands of a session.
#[derive(Clone, Debug)]
pub(crate) struct Hands {
    /// Earliest first.
    pending: Vec<RobotFault>,
    /// Start of what happens now, seconds; the pose before a push and the whole way.
    grasp: Option<(f64, RobotFault, Pose2, Vector2<f64>)>,
    is_done: bool,
    random: Random,
}

impl Hands {
    pub(crate) fn new(faults: &[RobotFault], random: Random) -> Self {
        let is_hands = |fault: &&RobotFault| matches!(fault, RobotFault::Kidnap { .. } | RobotFault::Push { .. });
        let mut pending: Vec<RobotFault> = faults.iter().filter(is_hands).copied().collect();
        pending.sort_by(|a, b| begin_s(a).total_cmp(&begin_s(b)));
        Self { pending, grasp: None, is_done: false, random }
    }

    /// What happens at `now_s` seconds to a robot at `pose`.
    pub(crate) fn step(&mut self, world: &World, pose: Pose2, now_s: f64) -> Act {
        let Some((from_s, fault, before, way)) = self.grasp else {
            let Some(fault) = self.pending.first().copied().filter(|fault| begin_s(fault) <= now_s) else {
                return Act::Free;
            };
            // A push waits until there is room for it. The robot stops a little later, so the way is checked again then.
            if let RobotFault::Push { metres, .. } = fault
                && self.side(world, pose, metres).is_none()
            {
                return Act::Free;
            }
            self.pending.remove(0);
            self.grasp = Some((now_s, fault, pose, Vector2::zeros()));
            self.is_done = false;
            return Act::Hold { is_lifted: false };
        };
        let since_s = now_s - from_s;
        if since_s < STOP_S {
            return Act::Hold { is_lifted: false };
        }
        match fault {
            RobotFault::Kidnap { is_lifted, .. } => {
                let carry_s = STOP_S + if is_lifted { LIFT_S } else { 0.0 };
                if since_s < carry_s {
                    return Act::Hold { is_lifted: true };
                }
                if !self.is_done {
                    self.is_done = true;
                    return Act::Carry(self.elsewhere(world, pose));
                }
                self.rest(since_s - carry_s)
            }
            RobotFault::Push { metres, .. } => {
                if !self.is_done {
                    self.is_done = true;
                    // Where the robot stopped there may be no room after all: then the push comes later.
                    let Some(way) = self.side(world, pose, metres) else {
                        self.pending.insert(0, fault);
                        self.grasp = None;
                        return Act::Free;
                    };
                    self.grasp = Some((from_s, fault, pose, way));
                    return Act::Hold { is_lifted: false };
                }
                let share = ((since_s - STOP_S) / PUSH_S).min(1.0);
                let there = before.position() + way * share;
                if since_s < STOP_S + PUSH_S + 0.01 {
                    return Act::Carry(Pose2::new(there.x, there.y, before.theta_rad));
                }
                self.rest(since_s - STOP_S - PUSH_S)
            }
            _ => Act::Free,
        }
    }

    fn rest(&mut self, since_s: f64) -> Act {
        if since_s < REST_S {
            return Act::Hold { is_lifted: false };
        }
        self.grasp = None;
        Act::Free
    }

    /// What a sensor in the air reads: nothing or anything, metres.
    pub(crate) fn nonsense(&mut self) -> Option<f64> {
        let (is_heard, range_m) = (self.random.chance(0.5), self.random.uniform(0.03, 3.0));
        is_heard.then_some(range_m)
    }

    /// The way to the robot's left or right that is free.
    fn side(&self, world: &World, pose: Pose2, metres: f64) -> Option<Vector2<f64>> {
        let left = pose.transform(Point::new(0.0, metres)) - pose.position();
        let is_free = |way: &Vector2<f64>| {
            let share_m = |step: u8| world.clearance(pose.position() + way * (f64::from(step) / 8.0));
            (1..=8).all(|step| share_m(step) > CLEARANCE_M)
        };
        [left, -left].into_iter().find(is_free)
    }

    /// Another free pose that the robot could also have driven to; the same one if there is none.
    fn elsewhere(&mut self, world: &World, pose: Pose2) -> Pose2 {
        let grid = RouteGrid::new(world);
        let routes = grid.routes(world.start);
        for _ in 0..2000 {
            let point = grid.middle(self.random.below(grid.len()));
            let heading_rad = self.random.uniform(-PI, PI);
            let is_far = (point - pose.position()).norm() > MIN_CARRY_M;
            if is_far && routes.cost(grid.cell(point)).is_some() && world.clearance(point) > CLEARANCE_M {
                return Pose2::new(point.x, point.y, heading_rad);
            }
        }
        pose
    }
}

fn begin_s(fault: &RobotFault) -> f64 {
    match fault {
        RobotFault::Kidnap { at_s, .. } | RobotFault::Push { at_s, .. } => *at_s,
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    /// The poses of a robot that does not move by itself, one per step of 5 ms, and whether it was in the air.
    fn moved(fault: &str) -> Vec<(Pose2, bool, bool)> {
        let world = World::named("flat").unwrap();
        let mut hands = Hands::new(&[fault.parse().unwrap()], Random::new(1, Stream::RobotFault));
        let mut pose = Pose2::new(world.start.x, world.start.y, 0.4);
        let step = |step: i32| {
            let act = hands.step(&world, pose, f64::from(step) * 0.005);
            if let Act::Carry(there) = act {
                pose = there;
            }
            (pose, act == Act::Hold { is_lifted: true }, act == Act::Free)
        };
        (0..2000).map(step).collect()
    }

    #[test]
    fn a_kidnapped_robot_stands_elsewhere_in_the_world() {
        let (plain, lifted) = (moved("kidnap@2"), moved("kidnap=lifted@2"));
        let way_m = |poses: &[(Pose2, bool, bool)]| (poses[1999].0.position() - poses[0].0.position()).norm();
        assert!(way_m(&plain) > MIN_CARRY_M && way_m(&lifted) > MIN_CARRY_M);
        assert_eq!(plain.iter().filter(|(_, is_lifted, _)| *is_lifted).count(), 0);
        assert!((590..610).contains(&lifted.iter().filter(|(_, is_lifted, _)| *is_lifted).count()));
        assert!(plain[1999].2 && !plain[410].2 && plain[390].2);
    }

    #[test]
    fn a_push_goes_sideways_by_the_stated_distance() {
        let poses = moved("push=0.3@2");
        let way = poses[0].0.inverse() * poses[1999].0;
        assert!(way.x_m.abs() < 1e-9 && (way.y_m.abs() - 0.3).abs() < 1e-9 && way.theta_rad.abs() < 1e-9, "{way:?}");
    }
}
