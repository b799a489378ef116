//! The simulated board's motors, as `protocol/README.md` describes them under "Driving". The reference firmware is another implementation.
//!
//! Commands, echoes and times go in; what the wheels are driven to comes out. A simulated wheel does not stall, and nothing opens the
//! emergency pin.

use super::fault::Reading;
use super::robot::{STEP_S, WheelDrive};
use slamd_core::{Ring, Timestamp};
use slamd_protocol::{Drive, MotionState, WheelSpeeds};
use std::time::Duration;

/// Without a frame of the host for so long the motors stop.
const SILENCE: Duration = Duration::from_millis(250);
/// Way until the robot stands, in seconds of its speed.
const REACH_S: f64 = 0.2;
/// An echo farther to the side than the ring's radius and this is passed by, metres.
const SIDE_M: f64 = 0.05;
/// Sensors this near to the motion's direction must tell something, degrees.
const LOOKS_DEG: f64 = 45.0;

/// The limits that the board's settings give, in metres and seconds.
#[derive(Clone, Copy, Debug)]
pub struct MotorLimits {
    /// Highest speed of a wheel; 0 without motors.
    pub top_speed_m_s: f64,
    /// Ramp of a wheel.
    pub acceleration_m_s2: f64,
    /// Nearest echo where the robot drives.
    pub stop_distance_m: f64,
}

/// What the motors are told, and why they stand.
#[derive(Clone, Debug)]
pub struct Motors {
    /// The last DRIVE and when it expires; none before the first.
    wanted: Option<(WheelSpeeds, Timestamp)>,
    heard_at: Timestamp,
    commanded_m_s: [f64; 2],
    state: MotionState,
    /// What each sensor last read; none if it tells nothing.
    views: Vec<Option<Reading>>,
    is_known: bool,
}

impl Motors {
    /// Motors that stand.
    #[must_use]
    pub fn new(sensors: usize) -> Self {
        Self {
            wanted: None,
            heard_at: Timestamp::default(),
            commanded_m_s: [0.0; 2],
            state: MotionState::Idle,
            views: vec![None; sensors],
            is_known: false,
        }
    }

    /// A DRIVE came since the board's start.
    #[must_use]
    pub const fn are_known(&self) -> bool {
        self.is_known
    }

    /// What the motors do.
    #[must_use]
    pub const fn state(&self) -> MotionState {
        self.state
    }

    /// The speeds that the wheels are driven to now, metres per second.
    #[must_use]
    pub const fn commanded_m_s(&self) -> [f64; 2] {
        self.commanded_m_s
    }

    /// A valid frame of the host arrived.
    pub fn heard(&mut self, at: Timestamp) {
        self.heard_at = at;
    }

    /// A DRIVE arrived.
    pub fn drive(&mut self, at: Timestamp, drive: &Drive) {
        self.is_known = true;
        self.wanted = Some((drive.speeds(), at + Duration::from_millis(drive.valid_ms().into())));
    }

    /// STOP arrived.
    pub fn stop(&mut self) {
        self.wanted = None;
        self.views.fill(None);
    }

    /// What a sensor read.
    pub fn see(&mut self, sensor: u8, reading: Reading) {
        if let Some(view) = self.views.get_mut(usize::from(sensor)) {
            *view = Some(reading).filter(|reading| !matches!(reading, Reading::Missing));
        }
    }

    /// One step of the control. True if the state has changed.
    pub fn step(&mut self, at: Timestamp, ring: &Ring, limits: MotorLimits) -> bool {
        let before = self.state;
        let wanted_m_s = self.wanted.map_or([0.0; 2], |(speeds, _)| scaled(speeds, limits.top_speed_m_s));
        self.state = self.judge(at, ring, limits, wanted_m_s);
        if self.state == MotionState::Driving {
            let ramp = limits.acceleration_m_s2 * STEP_S;
            for (commanded, wanted) in self.commanded_m_s.iter_mut().zip(wanted_m_s) {
                *commanded += (wanted - *commanded).clamp(-ramp, ramp);
            }
        } else {
            self.commanded_m_s = [0.0; 2];
        }
        self.is_known && self.state != before
    }

    /// What the wheels are driven to.
    #[must_use]
    pub fn drives(&self) -> [WheelDrive; 2] {
        let at = |m_s: f64| if m_s == 0.0 { WheelDrive::Brake } else { WheelDrive::Speed(m_s) };
        self.commanded_m_s.map(at)
    }

    fn judge(&self, at: Timestamp, ring: &Ring, limits: MotorLimits, wanted_m_s: [f64; 2]) -> MotionState {
        let Some((_, until)) = self.wanted.filter(|(speeds, _)| *speeds != WheelSpeeds::ZERO) else {
            return MotionState::Idle;
        };
        if limits.top_speed_m_s == 0.0 {
            MotionState::NoMotors
        } else if at >= until || at >= self.heard_at + SILENCE {
            MotionState::TimeOut
        } else if self.is_blocked(ring, limits.stop_distance_m, wanted_m_s) {
            MotionState::Obstacle
        } else {
            MotionState::Driving
        }
    }

    /// Something stands where the robot would drive, or nothing there tells.
    fn is_blocked(&self, ring: &Ring, stop_distance_m: f64, [left, right]: [f64; 2]) -> bool {
        let (ahead, turn) = (left + right, right - left);
        if 8.0 * ahead.abs() <= turn.abs() {
            return false;
        }
        let reach_m = stop_distance_m + REACH_S * 0.5 * ahead.abs();
        let (mut looking, mut telling) = (0, 0);
        for (mounting, view) in ring.mountings.iter().zip(&self.views) {
            let pose = mounting.robot_from_sensor;
            let cos = libm::cos(pose.theta_rad) * ahead.signum();
            let looks = cos >= libm::cos(LOOKS_DEG.to_radians());
            looking += u32::from(looks);
            telling += u32::from(looks && view.is_some());
            if let Some(Reading::Range(range_m)) = view
                && cos > 0.0
            {
                let (radius_m, point) = (pose.position().coords.norm(), pose.ahead(*range_m));
                if point.x * ahead.signum() - radius_m < reach_m && point.y.abs() <= radius_m + SIDE_M {
                    return true;
                }
            }
        }
        looking == 0 || 2 * telling < looking
    }
}

/// Speeds within the top speed, both scaled alike, metres per second.
fn scaled(speeds: WheelSpeeds, top_m_s: f64) -> [f64; 2] {
    let speeds = [speeds.left_mm_s(), speeds.right_mm_s()].map(|mm_s| 1e-3 * f64::from(mm_s));
    let fastest = speeds[0].abs().max(speeds[1].abs());
    if fastest <= top_m_s { speeds } else { speeds.map(|m_s| m_s * top_m_s / fastest) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: MotorLimits = MotorLimits { top_speed_m_s: 0.6, acceleration_m_s2: 0.5, stop_distance_m: 0.25 };

    fn ring() -> Ring {
        Ring::circle(16, 0.15, 0.2, 4)
    }

    fn drive(left_mm_s: i16, right_mm_s: i16) -> Drive {
        let speeds = WheelSpeeds::new(left_mm_s, right_mm_s).unwrap();
        Drive::new(speeds, 300, Drive::FROM_SOCKET).unwrap()
    }

    /// The state after `ms` of a command that came at 0, with what sensor 0, straight ahead, reads.
    fn state(drive: &Drive, ms: u64, ahead: Reading) -> MotionState {
        let mut motors = Motors::new(16);
        (0..16).for_each(|sensor| motors.see(sensor, Reading::NoEcho));
        motors.see(0, ahead);
        motors.drive(Timestamp::default(), drive);
        for step in 0..=ms / 5 {
            motors.step(Timestamp::from_us(5_000 * step), &ring(), LIMITS);
        }
        motors.state()
    }

    #[test]
    fn a_command_holds_until_it_expires_or_the_line_is_silent() {
        assert_eq!(state(&drive(300, 300), 240, Reading::NoEcho), MotionState::Driving);
        assert_eq!(state(&drive(300, 300), 255, Reading::NoEcho), MotionState::TimeOut);
        assert_eq!(state(&drive(0, 0), 500, Reading::NoEcho), MotionState::Idle);
    }

    #[test]
    fn only_the_way_to_an_obstacle_is_blocked() {
        let near = Reading::Range(0.28);
        assert_eq!(state(&drive(300, 300), 50, near), MotionState::Obstacle);
        for (left, right) in [(-300, -300), (-300, 300), (100, 100)] {
            assert_eq!(state(&drive(left, right), 50, near), MotionState::Driving, "{left} {right}");
        }
    }

    #[test]
    fn both_wheels_are_scaled_to_the_top_speed() {
        let speeds = scaled(WheelSpeeds::new(-2_000, 1_000).unwrap(), 0.6);
        assert!((speeds[0] + 0.6).abs() < 1e-12 && (speeds[1] - 0.3).abs() < 1e-12);
    }
}
