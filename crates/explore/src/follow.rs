//! From a way to a velocity (pure pursuit), and what the echoes permit of it.

use super::costmap::Costmap;
use super::params::Params;
use slamd_core::{Point, Pose2, wrap_angle};

/// A velocity.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Twist {
    /// Forward, metres per second.
    pub forward_m_s: f64,
    /// Counter-clockwise, radians per second.
    pub turn_rad_s: f64,
}

/// The point of the way that the robot aims at: the farthest one within the look-ahead that it can drive to straight.
pub(crate) fn aim(map: &Costmap, way: &[Point], here: Point, params: &Params) -> Option<Point> {
    let off = |point: &Point| (point - here).norm_squared();
    let nearest = (0..way.len()).min_by(|&a, &b| match (way.get(a), way.get(b)) {
        (Some(a), Some(b)) => off(a).total_cmp(&off(b)),
        _ => std::cmp::Ordering::Equal,
    })?;
    let rest = way.get(nearest..)?;
    let is_straight = |point: &Point| map.line(here, *point, |cell| map.is_passable(cell));
    let ahead = rest.iter().take_while(|point| (*point - here).norm() < params.look_ahead_m);
    let mut aim = rest.get(1).or_else(|| rest.first()).copied();
    for point in ahead.filter(|point| is_straight(point)) {
        aim = Some(*point);
    }
    aim
}

/// The velocity towards a point: on the spot when far off course, slower the larger the turn and the nearer the end.
pub(crate) fn towards(pose: Pose2, aim: Point, end: Point, params: &Params) -> Twist {
    let off_rad = bearing(pose, aim);
    let turn_rad_s = (params.turn_gain * off_rad).clamp(-params.turn_rad_s, params.turn_rad_s);
    if off_rad.abs() > params.on_the_spot_rad {
        return Twist { forward_m_s: 0.0, turn_rad_s };
    }
    let near = ((end - pose.position()).norm() / params.brake_m).clamp(0.2, 1.0);
    let straight = 1.0 - off_rad.abs() / params.on_the_spot_rad;
    Twist { forward_m_s: params.speed_m_s * near * straight.max(0.1), turn_rad_s }
}

/// The direction of a point from the robot, radians.
pub(crate) fn bearing(pose: Pose2, point: Point) -> f64 {
    let offset = point - pose.position();
    wrap_angle(libm::atan2(offset.y, offset.x) - pose.theta_rad)
}

/// Metres from the body to the nearest echo in its way, driving forward (`sign` 1) or back (−1), and that echo, robot frame.
pub(crate) fn gap(echoes: &[Point], sign: f64, params: &Params) -> (f64, Option<Point>) {
    let reach_m = params.body_radius_m + params.side_m;
    let in_way = echoes.iter().filter(|echo| sign * echo.x > 0.0 && echo.y.abs() < reach_m);
    let nearest = in_way.min_by(|a, b| (sign * a.x).total_cmp(&(sign * b.x)));
    (nearest.map_or(f64::INFINITY, |echo| sign * echo.x - params.body_radius_m), nearest.copied())
}

/// The velocity that the newest echoes permit: slower near what is in the way, and no nearer to it than the gap.
pub(crate) fn permitted(wanted: Twist, echoes: &[Point], params: &Params) -> Twist {
    if wanted.forward_m_s == 0.0 {
        return wanted;
    }
    let sign = wanted.forward_m_s.signum();
    let (gap_m, _) = gap(echoes, sign, params);
    let stop_m = if sign > 0.0 { params.stop_gap_m } else { params.back_gap_m };
    let most_m_s = ((gap_m - stop_m) / params.stop_time_s).max(0.0);
    let beside_m = params.body_radius_m + params.graze_m;
    let grazes = echoes.iter().any(|echo| {
        (0.0..params.body_radius_m + params.stop_gap_m).contains(&(sign * echo.x)) && echo.coords.norm() < beside_m
    });
    let most_m_s = if grazes { most_m_s.min(params.graze_speed_m_s) } else { most_m_s };
    Twist { forward_m_s: sign * wanted.forward_m_s.abs().min(most_m_s), ..wanted }
}
