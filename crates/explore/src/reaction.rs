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
    turn_until: Option<Timestamp>,
    /// The nearest and the mean echo while it looks around, metres, and since when they are so.
    heard: Option<((f64, f64), Timestamp)>,
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
        (self.turns, self.heard) = (None, None);
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
        if at.seconds_since(since) > params.wait_s || self.stalls(at, pose, wanted, params) {
            self.blocked = None;
            self.back_until = Some(at + seconds(params.back_s));
            let ahead = Point::new(params.body_radius_m + params.block_radius_m, 0.0);
            return Outcome::GaveUp(gap(echoes, 1.0, params).1.filter(|_| is_blocked).unwrap_or(ahead));
        }
        let held = Twist { forward_m_s: 0.0, ..twist };
        if is_blocked { Outcome::Blocked(held) } else { Outcome::Drive(twist) }
    }

    /// The robot shall drive, and hardly moves: something is in the way, or its wheels slip.
    fn stalls(&mut self, at: Timestamp, pose: Pose2, wanted: Twist, params: &Params) -> bool {
        let (then, since) = *self.moved.get_or_insert((pose, at));
        let has_moved = (pose.position() - then.position()).norm() > params.stall_m
            || wrap_angle(pose.theta_rad - then.theta_rad).abs() > params.stall_rad;
        let is_over = at.seconds_since(since) > params.stall_s;
        if has_moved || is_over || wanted == Twist::default() {
            self.moved = Some((pose, at));
        }
        is_over && !has_moved && wanted != Twist::default()
    }

    /// A slow drive by the echoes alone: ahead where there is room, else a turn to the side with more of it. Where the echoes stay the same
    /// the robot touches something that they do not see: it backs off, then turns.
    pub(crate) fn wander(&mut self, at: Timestamp, echoes: &[Point], params: &Params) -> Twist {
        if self.back_until.is_some_and(|until| at < until) {
            return permitted(Twist { forward_m_s: -params.back_m_s, turn_rad_s: 0.0 }, echoes, params);
        }
        let (gap_m, _) = gap(echoes, 1.0, params);
        if self.turn_until.is_none_or(|until| at >= until) && gap_m > params.stop_gap_m + params.wander_gap_m {
            let wanted = Twist { forward_m_s: params.wander_m_s, turn_rad_s: 0.0 };
            self.turns = None;
            if self.is_same(at, echoes, params) {
                self.back_until = Some(at + seconds(params.back_s));
                self.turn_until = Some(at + seconds(params.back_s + params.wander_turn_s));
            }
            return permitted(wanted, echoes, params);
        }
        self.heard = None;
        if self.turns.is_none() {
            self.turn_until =
                self.turn_until.filter(|until| at < *until).or_else(|| Some(at + seconds(params.wander_turn_s)));
        }
        let room = |sign: f64| {
            let side = echoes.iter().filter(|echo| sign * echo.y > 0.0);
            side.map(|echo| echo.coords.norm()).fold(f64::INFINITY, f64::min)
        };
        let sign = *self.turns.get_or_insert_with(|| if room(1.0) >= room(-1.0) { 1.0 } else { -1.0 });
        Twist { forward_m_s: 0.0, turn_rad_s: sign * params.wander_turn_rad_s }
    }

    /// The echoes have not changed for as long as a stall takes.
    fn is_same(&mut self, at: Timestamp, echoes: &[Point], params: &Params) -> bool {
        let norms = || echoes.iter().map(|echo| echo.coords.norm());
        let now = (norms().fold(f64::INFINITY, f64::min), norms().sum::<f64>() / echoes.len().max(1) as f64);
        let ((nearest_m, mean_m), since) = *self.heard.get_or_insert((now, at));
        let is_other = (now.0 - nearest_m).abs() > params.stall_m || (now.1 - mean_m).abs() > params.stall_m;
        let is_over = at.seconds_since(since) > params.stall_s;
        if is_other || is_over {
            self.heard = Some((now, at));
        }
        is_over && !is_other
    }
}

pub(crate) fn seconds(seconds: f64) -> Duration {
    Duration::try_from_secs_f64(seconds).unwrap_or_default()
}
