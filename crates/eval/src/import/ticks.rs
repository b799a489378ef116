//! Poses of a recording → the encoder ticks that would have given them.

use slamd_core::{Pose2, config::RobotConfig, sinc, wrap_angle};
use std::f64::consts::TAU;

/// Encoder ticks along a path of poses: an exact arc from each pose to the next.
///
/// The metres are summed unrounded and rounded to ticks at the end, so rounding never accumulates. A step to the side, which
/// two wheels cannot make, is dropped.
#[derive(Clone, Debug)]
pub struct WheelTicks {
    metres_per_tick: f64,
    base_m: f64,
    last: Option<Pose2>,
    left_m: f64,
    right_m: f64,
}

impl WheelTicks {
    /// Wheels as configured; none where the configuration lacks `robot.ticks_per_turn`.
    #[must_use]
    pub fn new(robot: &RobotConfig) -> Option<Self> {
        let metres_per_tick = TAU * robot.wheel_radius_m / f64::from(robot.ticks_per_turn?);
        Some(Self { metres_per_tick, base_m: robot.wheel_base_m, last: None, left_m: 0.0, right_m: 0.0 })
    }

    /// The robot is now at `pose`: the left and the right wheel's ticks since the first pose.
    pub fn at(&mut self, pose: Pose2) -> [i32; 2] {
        let last = self.last.replace(pose).unwrap_or(pose);
        let turn_rad = wrap_angle(pose.theta_rad - last.theta_rad);
        let (sin, cos) = libm::sincos(last.theta_rad + 0.5 * turn_rad);
        let chord_m = (pose.x_m - last.x_m) * cos + (pose.y_m - last.y_m) * sin;
        let arc_m = chord_m / sinc(0.5 * turn_rad);
        self.left_m += arc_m - 0.5 * turn_rad * self.base_m;
        self.right_m += arc_m + 0.5 * turn_rad * self.base_m;
        [self.ticks(self.left_m), self.ticks(self.right_m)]
    }

    /// Wraps as a board's counter does.
    #[expect(clippy::cast_possible_truncation, reason = "the low 32 bits are meant")]
    fn ticks(&self, travel_m: f64) -> i32 {
        (travel_m / self.metres_per_tick).round() as i64 as i32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_comes_back_from_its_ticks() {
        let robot = RobotConfig { ticks_per_turn: Some(2_000), ..RobotConfig::default() };
        let metres_per_tick = TAU * robot.wheel_radius_m / 2_000.0;
        let mut wheels = WheelTicks::new(&robot).unwrap();
        let (mut pose, mut back, mut before) = (Pose2::default(), Pose2::default(), wheels.at(Pose2::default()));
        for step in 0..5_000 {
            let turn = 0.0004 * f64::from(step % 7 - 3);
            pose = pose.rolled(0.0031 - turn, 0.0031 + turn, robot.wheel_base_m);
            let ticks = wheels.at(pose);
            let [left, right] = [0, 1].map(|side| f64::from(ticks[side] - before[side]) * metres_per_tick);
            back = back.rolled(left, right, robot.wheel_base_m);
            before = ticks;
        }
        assert!((pose.position() - back.position()).norm() < 0.02, "{pose:?} {back:?}");
        assert!(wrap_angle(pose.theta_rad - back.theta_rad).abs() < 2.0 * metres_per_tick / robot.wheel_base_m);
    }

    #[test]
    fn wheels_without_ticks_are_refused() {
        assert!(WheelTicks::new(&RobotConfig::default()).is_none());
    }
}
