//! A robot as it may really be: how it moves when its wheels report a motion, and where its sensors point.

use super::concentration::Opening;
use crate::config::{Config, SettingValue};
use crate::geometry::{Mounting, Placement, Pose2, Ring, sinc, wrap_angle};
use crate::saved_state::{FoundRobot, InvalidState};
use crate::sweep::Sweep;
use std::f64::consts::PI;

/// The difference between a robot and its configuration.
///
/// | symbol | meaning |
/// |---|---|
/// | travel | true over reported distance of the midpoint between the wheels; negative: backward |
/// | turn | true over reported rotation; negative: the other way |
/// | ring | rotation of the ring of sensors against the configured one (rad) |
/// | range | true over reported range |
///
/// Walls alone cannot tell a mirrored ring from swapped wheels: both have `turn < 0`, and their maps are mirror images. The wheels are
/// believed then ([`RobotModel::is_mirrored`]). Nor can they tell another unit of the ranges from wheels and base that are both
/// mis-measured by the same factor: the wheels are believed there, too.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RobotModel {
    /// True over reported distance.
    pub(crate) travel: f64,
    /// True over reported rotation.
    pub(crate) turn: f64,
    /// Rotation of the ring, radians.
    pub(crate) ring_rad: f64,
    /// True over reported range.
    pub(crate) range: f64,
}

impl Default for RobotModel {
    fn default() -> Self {
        Self::AS_CONFIGURED
    }
}

impl RobotModel {
    /// The robot of the configuration.
    pub(crate) const AS_CONFIGURED: Self = Self { travel: 1.0, turn: 1.0, ring_rad: 0.0, range: 1.0 };

    /// The motion of this robot where the configured one would have moved by `ds_m` along an arc of `dtheta_rad`.
    pub(super) fn moved(&self, ds_m: f64, dtheta_rad: f64) -> Pose2 {
        let (ds_m, dtheta_rad) = (self.travel * ds_m, self.turn * dtheta_rad);
        let (sin, cos) = libm::sincos(0.5 * dtheta_rad);
        let chord_m = ds_m * sinc(0.5 * dtheta_rad);
        Pose2::new(chord_m * cos, chord_m * sin, dtheta_rad)
    }

    /// A motion of the configured robot within a sweep, which is small, as this robot's.
    pub(super) fn scaled(&self, moved: Pose2) -> Pose2 {
        Pose2::new(self.travel * moved.x_m, self.travel * moved.y_m, self.turn * moved.theta_rad)
    }

    /// True if its ranges are those of `other`, or half or twice as long: one way is counted for two, or two for one. Sound has one
    /// speed, so no other unit is believed.
    pub(super) fn has_known_unit(&self, other: &Self) -> bool {
        let ratio = self.range / other.range;
        KNOWN_UNITS.into_iter().chain([1.0]).any(|unit| (ratio - unit).abs() < 1e-9)
    }

    /// The configured robot with ranges of half or twice the length, if the walls can hardly tell it from this one: that travel alone
    /// is off by just such a factor is rare. What the filter has learnt of a wrong robot does not count.
    pub(super) fn with_known_unit(&self) -> Option<Self> {
        let of_unit = KNOWN_UNITS.map(|range| Self { range, ..Self::AS_CONFIGURED });
        let apart = |a: f64, b: f64| if a * b > 0.0 { libm::log(a / b).abs() } else { f64::INFINITY };
        let is_like = |other: &Self| {
            let (own, other) = (self.in_reported_ranges(), other.in_reported_ranges());
            let turned_rad = wrap_angle(own.ring_rad - other.ring_rad).abs();
            apart(own.travel, other.travel).max(apart(own.turn, other.turn)).max(turned_rad) < UNIT_TOLERANCE
        };
        of_unit.into_iter().find(is_like)
    }

    /// The robot of a saved session, if it was found with the same configuration; impossible numbers are refused.
    pub(super) fn restore(found: &FoundRobot, config: &Config) -> Result<Self, InvalidState> {
        if found.configured.is_empty() || found.configured != configured(config) {
            return Ok(Self::AS_CONFIGURED);
        }
        let &FoundRobot { travel, turn, ring_rad, range, .. } = found;
        let is_factor = |factor: f64| (MIN_FACTOR..=1.0 / MIN_FACTOR).contains(&factor);
        if is_factor(travel.abs()) && is_factor(turn.abs()) && is_factor(range) && ring_rad.abs() <= PI {
            Ok(Self { travel, turn, ring_rad, range })
        } else {
            Err(InvalidState("the robot that was found is impossible"))
        }
    }

    /// The robot to be saved.
    pub(super) fn saved(&self, config: &Config) -> FoundRobot {
        if *self == Self::AS_CONFIGURED {
            return FoundRobot::default();
        }
        let Self { travel, turn, ring_rad, range } = *self;
        FoundRobot { travel, turn, ring_rad, range, configured: configured(config) }
    }

    /// True if wheels and walls turn in opposite directions: the sensors are taken as numbered the other way round.
    pub(super) fn is_mirrored(&self) -> bool {
        self.travel > 0.0 && self.turn < 0.0
    }

    /// This robot's ring, where `configured` is the configured one.
    pub(super) fn ring(&self, configured: &Ring) -> Ring {
        let mut ring = configured.clone();
        for mounting in &mut ring.mountings {
            mounting.robot_from_sensor = self.mounted(mounting.robot_from_sensor);
        }
        ring
    }

    /// Where a sensor of the configured robot is on this one.
    fn mounted(&self, robot_from_sensor: Pose2) -> Pose2 {
        let turned = Pose2::new(0.0, 0.0, self.ring_rad) * robot_from_sensor;
        if self.is_mirrored() { Pose2::new(turned.x_m, -turned.y_m, -turned.theta_rad) } else { turned }
    }

    /// The same robot measured by the reported ranges: one whose ranges are half the true ones moves half as far, on a ring half as large.
    pub(super) fn in_reported_ranges(&self) -> Self {
        Self { travel: self.travel / self.range, range: 1.0, ..*self }
    }

    /// The sensors of the turned ring, not mirrored and measured by the reported ranges, into as many existing ones.
    pub(super) fn turn_ring(&self, configured: &Ring, into: &mut [Sensor]) {
        let turned = Placement::from(Pose2::new(0.0, 0.0, self.ring_rad));
        for (mounting, own) in configured.mountings.iter().zip(into) {
            let on_ring: Pose2 = turned * mounting.robot_from_sensor;
            let (sin, cos) = libm::sincos(on_ring.theta_rad);
            own.robot_from_sensor = Pose2::new(on_ring.x_m / self.range, on_ring.y_m / self.range, on_ring.theta_rad);
            own.axis = (cos, sin);
        }
    }

    /// What this robot makes of a sweep of the configured one, whose wheels are `base_m` apart. `odometry` is its pose by the wheels
    /// before the sweep, and after it.
    pub(super) fn correct(&self, sweep: &mut Sweep, configured: &Ring, base_m: f64, odometry: &mut Pose2) {
        let driven = if self.is_mirrored() { Self { turn: -self.turn, ..*self } } else { *self };
        let (ds_m, dtheta_rad) = motion(sweep, base_m);
        let half_m = 0.5 * base_m * driven.turn * dtheta_rad;
        (sweep.left_m, sweep.right_m) = (self.travel * ds_m - half_m, self.travel * ds_m + half_m);
        *odometry = *odometry * driven.moved(ds_m, dtheta_rad);
        sweep.odometry = *odometry;
        for (beam, mounting) in sweep.beams.iter_mut().zip(&configured.mountings) {
            let moved = beam.robot_from_sensor * mounting.robot_from_sensor.inverse();
            beam.robot_from_sensor = driven.scaled(moved) * self.mounted(mounting.robot_from_sensor);
            beam.range_m *= self.range;
        }
    }

    /// How far two models lie apart: 1 is what the window of a check can tell with certainty.
    pub(super) fn distance(&self, other: &Self) -> f64 {
        let ratio = |a: f64, b: f64| if a * b > 0.0 { libm::log(a / b).abs() / 0.2 } else { 9.0 };
        let turned_rad = wrap_angle(self.ring_rad - other.ring_rad).abs();
        let scales = ratio(self.travel, other.travel).max(ratio(self.turn, other.turn));
        scales.max(ratio(self.range, other.range)).max(turned_rad / 0.15)
    }
}

/// True over reported range where one way is counted for two, or two for one: definitions.
const KNOWN_UNITS: [f64; 2] = [0.5, 2.0];
/// Factors and angles (rad) this near are one: a definition, three times the resolution of the search.
const UNIT_TOLERANCE: f64 = 0.08;

/// A sensor of a hypothesis.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sensor {
    pub(super) robot_from_sensor: Pose2,
    /// Cosine and sine of its heading on the robot.
    pub(super) axis: (f64, f64),
    pub(super) opening: Opening,
}

impl Sensor {
    /// The sensors of a ring.
    pub(super) fn of(ring: &Ring) -> Vec<Self> {
        let sensor = |mounting: &Mounting| {
            let (sin, cos) = libm::sincos(mounting.robot_from_sensor.theta_rad);
            let opening = Opening::new(mounting.half_angle_rad);
            Self { robot_from_sensor: mounting.robot_from_sensor, axis: (cos, sin), opening }
        };
        ring.mountings.iter().map(sensor).collect()
    }
}

/// No robot differs from its configuration by such a factor: a definition, not tuned.
const MIN_FACTOR: f64 = 0.01;

/// The configured values that a found robot differs from.
fn configured(config: &Config) -> Vec<f64> {
    let (robot, ring) = (&config.robot, &config.ring);
    let is_set = |key: &str| f64::from(u8::from(config.board.get(key) == Some(&SettingValue::Flag(true))));
    let ticks = robot.ticks_per_turn.map_or(-1.0, f64::from);
    let mirrored = f64::from(u8::from(ring.mirrored));
    let numbers = [robot.wheel_radius_m, ticks, robot.wheel_base_m, ring.rotation_deg, ring.range_scale, mirrored];
    let signs = ["wheels_swapped", "left_reversed", "right_reversed"].map(is_set);
    numbers.into_iter().chain(signs).collect()
}

/// The reported distance (m) and rotation (rad) of a sweep.
pub(super) fn motion(sweep: &Sweep, base_m: f64) -> (f64, f64) {
    (0.5 * (sweep.left_m + sweep.right_m), (sweep.right_m - sweep.left_m) / base_m)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_configured_robot_leaves_a_sweep_as_it_is() {
        let ring = Ring::circle(8, 0.1, 0.2, 2);
        let beam = |mounting: &Mounting| crate::sweep::Beam {
            range_m: 1.0,
            no_measurement: None,
            age_s: 0.01,
            robot_from_sensor: Pose2::new(-0.01, 0.002, 0.03) * mounting.robot_from_sensor,
            half_angle_rad: 0.2,
        };
        let beams = ring.mountings.iter().map(beam).collect();
        let sweep = Sweep { beams, left_m: 0.02, right_m: 0.03, ..Sweep::default() };
        let (mut same, mut odometry) = (sweep.clone(), Pose2::default());
        RobotModel::AS_CONFIGURED.correct(&mut same, &ring, 0.26, &mut odometry);
        assert!((same.left_m - sweep.left_m).abs() < 1e-12 && (same.right_m - sweep.right_m).abs() < 1e-12);
        for (a, b) in same.beams.iter().zip(&sweep.beams) {
            assert!((a.robot_from_sensor.position() - b.robot_from_sensor.position()).norm() < 1e-12);
        }
        assert!((odometry.x_m - 0.025).abs() < 1e-4 && (odometry.theta_rad - 0.01 / 0.26).abs() < 1e-12);
    }

    #[test]
    fn a_mirrored_robot_keeps_its_wheels_and_mirrors_its_ring() {
        let model = RobotModel { turn: -1.0, ring_rad: 0.5, ..RobotModel::default() };
        let ring = Ring::circle(4, 0.1, 0.2, 1);
        assert!(
            (model.ring(&ring).mountings[1].robot_from_sensor.theta_rad + 0.5 + 0.5 * std::f64::consts::PI).abs()
                < 1e-12
        );
        let mut sweep = Sweep { left_m: 0.02, right_m: 0.03, ..Sweep::default() };
        model.correct(&mut sweep, &ring, 0.26, &mut Pose2::default());
        assert!((sweep.right_m - 0.03).abs() < 1e-12, "{}", sweep.right_m);
    }

    #[test]
    fn a_saved_robot_holds_for_the_same_configuration_alone() {
        let model = RobotModel { travel: 0.25, turn: 0.25, ..RobotModel::AS_CONFIGURED };
        let config = Config::default();
        let saved = model.saved(&config);
        assert_eq!(RobotModel::restore(&saved, &config), Ok(model));
        let mut mended = config.clone();
        mended.robot.wheel_radius_m *= 0.25;
        assert_eq!(RobotModel::restore(&saved, &mended), Ok(RobotModel::AS_CONFIGURED));
        let impossible = FoundRobot { travel: f64::NAN, ..saved };
        assert!(RobotModel::restore(&impossible, &config).is_err());
        assert_eq!(RobotModel::restore(&FoundRobot::default(), &config), Ok(RobotModel::AS_CONFIGURED));
    }

    #[test]
    fn a_turned_ring_turns_the_sensors_and_not_the_way() {
        let model = RobotModel { ring_rad: 0.5, ..RobotModel::default() };
        let ring = model.ring(&Ring::circle(4, 0.1, 0.2, 1));
        assert!((ring.mountings[0].robot_from_sensor.theta_rad - 0.5).abs() < 1e-12);
        assert!((model.moved(0.1, 0.0).x_m - 0.1).abs() < 1e-12);
    }
}
