//! From a velocity to wheel speeds, within the configured limits and ramps.

use super::order::Twist;
use slamd_core::Config;
use slamd_protocol::WheelSpeeds;

/// Limits and ramps of the robot.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    most: Twist,
    /// Per second.
    ramp: Twist,
    wheel_base_m: f64,
}

impl Limits {
    pub(super) fn new(config: &Config) -> Self {
        let drive = &config.drive;
        Self {
            most: Twist { forward_m_s: drive.max_speed_m_s, turn_rad_s: drive.max_turn_rad_s },
            ramp: Twist { forward_m_s: drive.acceleration_m_s2, turn_rad_s: drive.turn_acceleration_rad_s2 },
            wheel_base_m: config.robot.wheel_base_m,
        }
    }

    /// The velocity within the limits, on the same curve; one that is no number is none.
    pub(super) fn within(&self, twist: Twist) -> Twist {
        if !(twist.forward_m_s.is_finite() && twist.turn_rad_s.is_finite()) {
            return Twist::default();
        }
        let over = |wanted: f64, most: f64| (wanted.abs() / most).max(1.0);
        let over = over(twist.forward_m_s, self.most.forward_m_s).max(over(twist.turn_rad_s, self.most.turn_rad_s));
        Twist { forward_m_s: twist.forward_m_s / over, turn_rad_s: twist.turn_rad_s / over }
    }

    /// The velocity `seconds` later on the way from `now` to `wanted`.
    pub(super) fn ramped(&self, now: Twist, wanted: Twist, seconds: f64) -> Twist {
        let follow = |now: f64, wanted: f64, ramp: f64| now + (wanted - now).clamp(-ramp * seconds, ramp * seconds);
        Twist {
            forward_m_s: follow(now.forward_m_s, wanted.forward_m_s, self.ramp.forward_m_s),
            turn_rad_s: follow(now.turn_rad_s, wanted.turn_rad_s, self.ramp.turn_rad_s),
        }
    }

    /// The wheels' speeds, both scaled alike where one is too fast for a DRIVE.
    pub(super) fn wheels(&self, twist: Twist) -> WheelSpeeds {
        let half = 0.5 * self.wheel_base_m * twist.turn_rad_s;
        let mm_s = [twist.forward_m_s - half, twist.forward_m_s + half].map(|m_s| 1e3 * m_s);
        let most = f64::from(WheelSpeeds::MAX_MM_S);
        let over = mm_s.iter().fold(1.0, |over: f64, mm_s| over.max(mm_s.abs() / most));
        #[expect(clippy::cast_possible_truncation, reason = "within the limit of a DRIVE")]
        let [left, right] = mm_s.map(|mm_s| (mm_s / over).round() as i16);
        WheelSpeeds::new(left, right).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn twist(forward_m_s: f64, turn_rad_s: f64) -> Twist {
        Twist { forward_m_s, turn_rad_s }
    }

    #[test]
    fn a_velocity_is_limited_on_its_curve() {
        let limits = Limits::new(&Config::default());
        let limited = limits.within(twist(2.0, -1.0));
        assert!((limited.forward_m_s - 0.2).abs() < 1e-12 && (limited.turn_rad_s + 0.1).abs() < 1e-12);
        assert_eq!(limits.within(twist(0.1, 0.5)), twist(0.1, 0.5));
        for nonsense in [f64::NAN, f64::INFINITY] {
            assert_eq!(limits.within(twist(nonsense, 0.1)), Twist::default());
        }
    }

    #[test]
    fn wheels_follow_from_the_base_and_stay_within_a_drive() {
        let limits = Limits::new(&Config::default());
        let wheels = |forward, turn| {
            let speeds = limits.wheels(twist(forward, turn));
            (speeds.left_mm_s(), speeds.right_mm_s())
        };
        assert_eq!(wheels(0.2, 1.0), (70, 330));
        assert_eq!(wheels(4.0, 0.0), (2_000, 2_000));
        assert_eq!(wheels(f64::NAN, 0.0), (0, 0));
    }

    #[test]
    fn speed_changes_by_the_ramp() {
        let limits = Limits::new(&Config::default());
        let after = limits.ramped(Twist::default(), twist(0.2, -1.0), 0.1);
        assert!((after.forward_m_s - 0.04).abs() < 1e-12 && (after.turn_rad_s + 0.3).abs() < 1e-12);
        assert_eq!(limits.ramped(after, after, 0.1), after);
    }
}
