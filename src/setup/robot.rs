//! A robot's configuration as far as `slamd setup` has found it out, and as TOML.

use slamd_core::{
    Board, Config, ModelAspect, ModelFinding, Ring, config::CircleConfig, config::RobotConfig, config::SettingValue,
    wrap_angle,
};
use slamd_protocol::Setting;
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// How the encoders are wired, as settings of the board.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Wiring {
    pub(super) is_swapped: bool,
    /// Left and right wheel, after the exchange.
    pub(super) is_reversed: [bool; 2],
}

impl Wiring {
    /// The settings, in the order of their keys.
    pub(super) const SETTINGS: [Setting; 3] = [Setting::LeftReversed, Setting::RightReversed, Setting::WheelsSwapped];

    /// The wiring from the board's values, in the order of [`Self::SETTINGS`].
    pub(super) fn of_values(values: [i32; 3]) -> Self {
        let [left, right, swapped] = values.map(|value| value == 1);
        Self { is_swapped: swapped, is_reversed: [left, right] }
    }

    /// The values in the order of [`Self::SETTINGS`].
    pub(super) fn values(self) -> [(Setting, bool); 3] {
        let [left, right] = self.is_reversed;
        let [of_left, of_right, of_both] = Self::SETTINGS;
        [(of_left, left), (of_right, right), (of_both, self.is_swapped)]
    }

    /// What is set in one of both.
    pub(super) fn or(self, other: Self) -> Self {
        let [left, right] = self.is_reversed;
        let [of_left, of_right] = other.is_reversed;
        Self { is_swapped: self.is_swapped || other.is_swapped, is_reversed: [left || of_left, right || of_right] }
    }

    /// The wiring where these reported wheels count backwards and, `is_swapped`, report the other wheel.
    pub(super) fn corrected(self, reversed: [bool; 2], is_swapped: bool) -> Self {
        let signs = [self.is_reversed[0] ^ reversed[0], self.is_reversed[1] ^ reversed[1]];
        let [left, right] = signs;
        Self {
            is_swapped: self.is_swapped ^ is_swapped,
            // A sign belongs to an encoder, not to a side.
            is_reversed: if is_swapped { [right, left] } else { signs },
        }
    }
}

/// What a finding changes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Change {
    /// The ranges are this part of the true ones.
    Ranges(f64),
    /// The wheels count this many times the travel.
    Ticks(f64),
    /// Wheels and base are this many times larger.
    Size(f64),
    /// The distance between the wheels, metres.
    Base(f64),
    /// The ring is turned counter-clockwise, radians.
    Ring(f64),
    /// The sensors are numbered the other way round.
    Mirror,
    /// The wheels are swapped.
    Swap,
    /// These reported wheels count backwards.
    Reverse([bool; 2]),
}

impl Change {
    /// What mends a finding of the pipeline; none if nothing in the configuration does.
    pub(super) fn of_model(finding: &ModelFinding) -> Option<Self> {
        Some(match finding.aspect {
            ModelAspect::WheelScale => Self::Ticks(finding.measured),
            ModelAspect::TurnScale => {
                let (_, base_m) = finding.remedies.iter().find(|(key, _)| *key == "robot.wheel_base_m")?;
                Self::Base(base_m.parse().ok()?)
            }
            ModelAspect::RangeScale => Self::Size(finding.measured),
            ModelAspect::TurnSign => Self::Swap,
            ModelAspect::WheelSigns => Self::Reverse([true; 2]),
            ModelAspect::RingRotation => Self::Ring(finding.measured.to_radians()),
            ModelAspect::SensorBearing(_) | ModelAspect::RangeNoise | ModelAspect::Inconsistent => return None,
        })
    }

    /// What was found, for people.
    pub(super) fn words(self) -> String {
        match self {
            Self::Ranges(factor) => range_unit(factor),
            Self::Ticks(factor) => format!("the wheels count {factor:.2} times the travel: ticks_per_turn corrected"),
            Self::Size(factor) => format!("the wheels roll {factor:.2} times as far as assumed"),
            Self::Base(base_m) => format!("the wheels are {:.0} mm apart", 1e3 * base_m),
            Self::Ring(turned_rad) => format!("the ring is turned by {:.0} degrees", turned_rad.to_degrees()),
            Self::Mirror => "the sensors are numbered the other way round".into(),
            Self::Swap => "left and right wheel are swapped".into(),
            Self::Reverse([true, true]) => "both wheels count backwards".into(),
            Self::Reverse([true, false]) => "the left wheel counts backwards".into(),
            Self::Reverse(_) => "the right wheel counts backwards".into(),
        }
    }
}

/// Makes the change in the configuration.
pub(super) fn change(config: &mut Config, wiring: &mut Wiring, change: Change) {
    let robot = &mut config.robot;
    match change {
        Change::Ranges(factor) => config.ring.range_scale = (1e4 * config.ring.range_scale / factor).round() * 1e-4,
        Change::Ticks(factor) => {
            let ticks = f64::from(robot.ticks_per_turn.unwrap_or(1)) * factor;
            robot.ticks_per_turn = Some(whole(ticks));
        }
        Change::Size(factor) => {
            robot.wheel_radius_m = rounded(robot.wheel_radius_m * factor);
            robot.wheel_base_m = rounded(robot.wheel_base_m * factor);
        }
        Change::Base(base_m) => robot.wheel_base_m = rounded(base_m),
        Change::Ring(turned_rad) => {
            let turned_deg = wrap_angle(config.ring.rotation_deg.to_radians() + turned_rad).to_degrees();
            let nearest = (turned_deg / 15.0).round() * 15.0;
            config.ring.rotation_deg = if (turned_deg - nearest).abs() < 6.0 { nearest } else { turned_deg.round() };
        }
        // The whole ring, turned as it is, seen in a mirror: a ring is mirrored before it is turned.
        Change::Mirror => {
            (config.ring.mirrored, config.ring.rotation_deg) = (!config.ring.mirrored, 0.0 - config.ring.rotation_deg);
        }
        Change::Swap => *wiring = wiring.corrected([false; 2], true),
        Change::Reverse(reversed) => *wiring = wiring.corrected(reversed, false),
    }
}

/// True if the ranges are scaled.
fn is_scaled(range_scale: f64) -> bool {
    (range_scale - 1.0).abs() > 1e-3
}

/// What ranges that are `factor` of the true ones are.
fn range_unit(factor: f64) -> String {
    let unit = match factor {
        _ if (0.4..0.6).contains(&factor) => ": one-way times of flight",
        _ if !(0.3..3.0).contains(&factor) => ": millimetres and centimetres are mixed up",
        _ => "",
    };
    format!(
        "the board reports {factor:.2} of the true ranges{unit}; ring.range_scale corrects it, better correct the firmware"
    )
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the key's range")]
fn whole(ticks: f64) -> u32 {
    ticks.round().clamp(1.0, 1e7) as u32
}

fn rounded(metres: f64) -> f64 {
    (metres * 1e4).round() / 1e4
}

/// The circle that these sensors sit on at equal angles, facing outward; none if they do not.
pub(super) fn circle(ring: &Ring) -> Option<CircleConfig> {
    let first = ring.mountings.first()?;
    let count = u8::try_from(ring.len()).ok()?;
    let radius_m = (first.robot_from_sensor.position().coords.norm() * 1e3).round() * 1e-3;
    let half_angle_deg = (first.half_angle_rad.to_degrees() * 100.0).round() * 0.01;
    let groups = ring.mountings.iter().map(|mounting| mounting.group).max()?.checked_add(1)?.min(count);
    [false, true].into_iter().find_map(|clockwise| {
        let circle = CircleConfig { count, radius_m, half_angle_deg, groups, clockwise };
        let config = slamd_core::config::RingConfig { circle: Some(circle.clone()), ..Default::default() };
        let same = config.ring()?.mountings.iter().zip(&ring.mountings).all(|(a, b)| {
            let (a, b, group) = (a.robot_from_sensor, b.robot_from_sensor, a.group == b.group);
            let apart = (a.position() - b.position()).norm();
            group && apart < 0.004 && wrap_angle(a.theta_rad - b.theta_rad).abs() < 0.01
        });
        same.then_some(circle)
    })
}

/// The board's settings of the wiring, where they are not the defaults or, at any time `before`, were not.
pub(super) fn settings(wiring: Wiring, before: Wiring) -> BTreeMap<String, SettingValue> {
    let changed = wiring.values().into_iter().zip(before.values()).filter(|(now, then)| now.1 || then.1);
    changed.map(|((setting, value), _)| (setting.name().into(), SettingValue::Flag(value))).collect()
}

/// What the robot is, where it is not what the board says and not `assumed`; with the wiring as it was and as it is.
pub(super) fn differences(
    config: &Config,
    assumed: &RobotConfig,
    said: Option<u32>,
    (before, wiring): (Wiring, Wiring),
) -> Vec<String> {
    let (robot, ring) = (&config.robot, &config.ring);
    let mut found = Vec::new();
    if let (Some(said), Some(ticks)) = (said, robot.ticks_per_turn)
        && said != ticks
    {
        let factor = f64::from(ticks) / f64::from(said);
        found.push(format!(
            "the wheels count {factor:.2} times the ticks that the board says: {ticks} per turn, not {said}"
        ));
    }
    let millimetres = |metres: f64| (1e3 * metres).round();
    if libm::log(robot.wheel_radius_m / assumed.wheel_radius_m).abs() > 0.05 {
        found.push(format!("the wheels have a radius of {} mm", millimetres(robot.wheel_radius_m)));
    }
    if libm::log(robot.wheel_base_m / assumed.wheel_base_m).abs() > 0.05 {
        found.push(format!("the wheels are {} mm apart", millimetres(robot.wheel_base_m)));
    }
    if wiring.is_swapped != before.is_swapped {
        found.push("left and right encoder are swapped".into());
    }
    for (wheel, index) in [("left", 0), ("right", 1)] {
        if wiring.is_reversed[index] != before.is_reversed[index] {
            found.push(format!("the {wheel} encoder counts backwards"));
        }
    }
    if is_scaled(ring.range_scale) {
        found.push(range_unit(1.0 / ring.range_scale));
    }
    if ring.rotation_deg != 0.0 {
        found.push(format!("the ring is turned by {} degrees", ring.rotation_deg));
    }
    if ring.mirrored {
        found.push("the sensors are numbered the other way round".into());
    }
    found
}

/// The file: every key that a hobbyist may want to change, and what was found.
pub(super) fn to_toml(config: &Config, board: &Board, found: &[String]) -> String {
    let (robot, ring) = (&config.robot, &config.ring);
    let mut text = format!("# Written by `slamd setup` for: {}.\n", board.description().replace('\n', " "));
    for line in found {
        let _ = writeln!(text, "# Found: {line}.");
    }
    text += "# `slamd --config robot.toml --port auto` uses it; configs/README.md describes each key.\n\n[robot]\n";
    let _ = writeln!(text, "wheel_radius_m = {}", robot.wheel_radius_m);
    let _ = writeln!(text, "wheel_base_m = {}", robot.wheel_base_m);
    if let Some(ticks) = robot.ticks_per_turn {
        let _ = writeln!(text, "ticks_per_turn = {ticks}");
    }
    if ring.mirrored || ring.rotation_deg != 0.0 || is_scaled(ring.range_scale) {
        let _ = writeln!(text, "\n[ring]\nrotation_deg = {}\nmirrored = {}", ring.rotation_deg, ring.mirrored);
        if is_scaled(ring.range_scale) {
            let _ = writeln!(text, "range_scale = {}", ring.range_scale);
        }
    }
    if let Some(circle) = &ring.circle {
        let CircleConfig { count, radius_m, half_angle_deg, groups, clockwise } = circle;
        let _ = writeln!(
            text,
            "\n[ring.circle]\ncount = {count}\nradius_m = {radius_m}\nhalf_angle_deg = {half_angle_deg}\ngroups = {groups}"
        );
        if *clockwise {
            text += "clockwise = true\n";
        }
    }
    if !config.board.is_empty() {
        text += "\n# Settings that slamd writes to the board.\n[board]\n";
        for (name, value) in &config.board {
            let _ = writeln!(text, "{name} = {}", value.value() == 1);
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sign_moves_with_its_encoder() {
        let plain = Wiring::default();
        let swapped = plain.corrected([false; 2], true);
        assert_eq!(swapped, Wiring { is_swapped: true, is_reversed: [false; 2] });
        // The reported left wheel counts backwards and is the right one: that one is reversed.
        let both = plain.corrected([true, false], true);
        assert_eq!(both, Wiring { is_swapped: true, is_reversed: [false, true] });
        assert_eq!(
            both.corrected([false, true], true),
            plain.corrected([true, true], false).corrected([true, true], false)
        );
    }

    #[test]
    fn a_circle_is_recognized_and_written() {
        let ring = Ring::circle(8, 0.15, 12.5_f64.to_radians(), 4);
        let mut config = Config::default();
        config.ring.circle = circle(&ring);
        config.ring.rotation_deg = 45.0;
        config.robot.ticks_per_turn = Some(2880);
        config.board = settings(Wiring { is_swapped: true, is_reversed: [false; 2] }, Wiring::default());
        let text = to_toml(&config, &Board::default(), &["x".into()]);
        assert_eq!(Config::from_toml(&text).as_ref(), Ok(&config), "{text}");
        assert_eq!(config.ring.circle.as_ref().map(|circle| (circle.count, circle.groups)), Some((8, 4)));
        let mut odd = ring;
        odd.mountings[3].robot_from_sensor.x_m += 0.05;
        assert_eq!(circle(&odd), None);
    }
}
