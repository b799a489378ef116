//! What the newest echoes change at once: slower, stop, wait, back off; and a slow look around without a pose.

use super::follow::{Twist, gap, permitted};
use super::params::Params;
use slamd_core::{Point, Pose2, Timestamp, wrap_angle};
use std::time::Duration;

/// What became of a wanted velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Outcome {
    /// The robot drives so.
    Drive(Twist),
    /// Something is in the way, for less than the robot's patience; it may turn.
    Blocked(Twist),
    /// It stood in the way for too long, at this point of the robot frame: the robot backs off from now on.
    GaveUp(Point),
    /// It still backs off.
    BackingOff(Twist),
}

/// The reactive part's state.
#[derive(Clone, Debug, Default)]
pub(crate) struct Reaction {
    blocked: Option<Timestamp>,
    back_until: Option<Timestamp>,
    /// Where and when the robot last moved.
    moved: Option<(Pose2, Timestamp)>,
    /// The side to which it turns while it looks around, 1 left.
    turns: Option<f64>,
}

impl Reaction {
    /// What the echoes permit of a wanted velocity.
    pub(crate) fn react(
        &mut self,
        at: Timestamp,
        pose: Pose2,
        wanted: Twist,
        echoes: &[Point],
        params: &Params,
    ) -> Outcome {
        self.turns = None;
        if self.back_until.is_some_and(|until| at < until) {
            let back = Twist { forward_m_s: -params.back_m_s, turn_rad_s: 0.0 };
            self.moved = Some((pose, at));
            return Outcome::BackingOff(permitted(back, echoes, params));
        }
        self.back_until = None;
        let twist = permitted(wanted, echoes, params);
        let is_blocked =
            wanted.forward_m_s > 0.0 && twist.forward_m_s < 0.25 * params.wander_m_s.min(wanted.forward_m_s);
        let since = if is_blocked { *self.blocked.get_or_insert(at) } else { at };
        if !is_blocked {
            self.blocked = None;
        }
        if at.seconds_since(since) > params.wait_s || self.stalls(at, pose, twist, params) {
            self.blocked = None;
            self.back_until = Some(at + seconds(params.back_s));
            let ahead = Point::new(params.body_radius_m + params.block_radius_m, 0.0);
            return Outcome::GaveUp(gap(echoes, 1.0, params).1.filter(|_| is_blocked).unwrap_or(ahead));
        }
        let held = Twist { forward_m_s: 0.0, ..twist };
        if is_blocked { Outcome::Blocked(held) } else { Outcome::Drive(twist) }
    }

    /// The wheels should move the robot, and it does not move.
    fn stalls(&mut self, at: Timestamp, pose: Pose2, twist: Twist, params: &Params) -> bool {
        let (then, since) = *self.moved.get_or_insert((pose, at));
        let way_m = (pose.position() - then.position()).norm();
        let has_moved = way_m > 0.03 || wrap_angle(pose.theta_rad - then.theta_rad).abs() > 0.1;
        if has_moved || twist.forward_m_s == 0.0 {
            self.moved = Some((pose, at));
            return false;
        }
        let is_over = at.seconds_since(since) > params.stall_s;
        if is_over {
            self.moved = Some((pose, at));
        }
        is_over
    }

    /// A slow drive by the echoes alone: ahead where there is room, else a turn to the side with more of it.
    pub(crate) fn wander(&mut self, echoes: &[Point], params: &Params) -> Twist {
        let (gap_m, _) = gap(echoes, 1.0, params);
        let enough_m = params.stop_gap_m + if self.turns.is_some() { 0.4 } else { 0.1 };
        if gap_m > enough_m {
            self.turns = None;
            let wanted = Twist { forward_m_s: params.wander_m_s, turn_rad_s: 0.0 };
            return permitted(wanted, echoes, params);
        }
        let room = |sign: f64| {
            let side = echoes.iter().filter(|echo| sign * echo.y > 0.0);
            side.map(|echo| echo.coords.norm()).fold(f64::INFINITY, f64::min)
        };
        let sign = *self.turns.get_or_insert_with(|| if room(1.0) >= room(-1.0) { 1.0 } else { -1.0 });
        Twist { forward_m_s: 0.0, turn_rad_s: sign * params.wander_turn_rad_s }
    }
}

pub(crate) fn seconds(seconds: f64) -> Duration {
    Duration::try_from_secs_f64(seconds).unwrap_or_default()
}
