//! A robot that fits the walls, as the names, keys and values that mend the configuration.

use super::finding::{ModelAspect, ModelFinding};
use super::hypothesis::RobotModel;
use crate::config::{Config, RobotConfig, SettingValue};
use crate::geometry::wrap_angle;

/// What differs between a robot and its configuration, the most fundamental first; nothing if the two are the same.
pub(super) fn findings(config: &Config, model: &RobotModel) -> Vec<ModelFinding> {
    let robot = &config.robot;
    let mut findings = Vec::new();
    if model.ring_rad.abs() > MIN_TURNED_RAD {
        findings.push(ring_rotation(config.ring.rotation_deg, wrap_angle(model.ring_rad)));
    }
    match (model.travel < 0.0, model.turn < 0.0) {
        (false, true) => findings.push(turn_sign(config)),
        (true, true) => findings.push(wheel_signs(config)),
        _ => {}
    }
    let (travel, turn) = (model.travel.abs(), model.turn.abs());
    if is_off(model.range) {
        findings.push(range_scale(config.ring.range_scale, model.range));
    }
    match [is_off(travel), is_off(turn), is_off(travel / turn)] {
        [true, true, false] => findings.push(wheel_scale(robot, libm::sqrt(travel * turn))),
        [true, _, true] => {
            findings.push(wheel_scale(robot, travel));
            findings.push(turn_scale(robot, travel / turn, turn));
        }
        [false, true, _] => findings.push(turn_scale(robot, 1.0 / turn, turn)),
        [true, false, false] => findings.push(wheel_scale(robot, travel)),
        [false, false, _] => {}
    }
    findings
}

/// True if a factor lies where the search ends: the true one may be larger.
pub(super) fn is_beyond_search(model: &RobotModel) -> bool {
    [model.travel, model.turn, model.range].into_iter().any(is_limit)
}

fn is_limit(factor: f64) -> bool {
    libm::log(factor.abs()).abs() > libm::log(MAX_FACTOR)
}

/// Smaller differences are what the filter learns by itself: their names would be noise.
const MIN_FACTOR: f64 = 1.1;
const MIN_TURNED_RAD: f64 = 0.1;
/// Larger factors are told as "4 or more": the search has none beyond 5.
const MAX_FACTOR: f64 = 4.5;
/// Resolution of the search: its last step.
const FACTOR_SIGMA: f64 = 0.03;

fn is_off(factor: f64) -> bool {
    !(1.0 / MIN_FACTOR..=MIN_FACTOR).contains(&factor)
}

fn rounded(value: f64) -> String {
    format!("{}", (1e4 * value).round() / 1e4)
}

/// A factor for people.
fn times(measured: f64) -> String {
    match is_limit(measured) {
        false => format!("{measured:.2} times"),
        true if measured > 1.0 => "4 times or more".into(),
        true => "a quarter or less of".into(),
    }
}

/// What mends a factor, unless it is only known to be large.
fn known(measured: f64, remedies: Vec<(&'static str, String)>) -> Vec<(&'static str, String)> {
    if is_limit(measured) { Vec::new() } else { remedies }
}

/// Both wheels report `1 / factor` of the motion.
fn wheel_scale(robot: &RobotConfig, factor: f64) -> ModelFinding {
    let measured = 1.0 / factor;
    let mut remedies = vec![("robot.wheel_radius_m", rounded(robot.wheel_radius_m * factor))];
    if let Some(ticks) = robot.ticks_per_turn {
        remedies.insert(0, ticks_remedy(ticks, measured));
    }
    let clause = format!("the wheels report {} the travel that the walls show", times(measured));
    let clause =
        if is_limit(measured) { format!("{clause} (robot.ticks_per_turn, robot.wheel_radius_m)") } else { clause };
    let remedies = known(measured, remedies);
    ModelFinding { aspect: ModelAspect::WheelScale, measured, sigma: FACTOR_SIGMA * measured, clause, remedies }
}

/// The ticks per turn that mend wheels which report `measured` times their travel.
pub(crate) fn ticks_remedy(ticks: u32, measured: f64) -> (&'static str, String) {
    ("robot.ticks_per_turn", format!("{:.0}", f64::from(ticks) * measured))
}

/// The wheels report `1 / turn` of the rotation, the base is `base_factor` of the configured one.
fn turn_scale(robot: &RobotConfig, base_factor: f64, turn: f64) -> ModelFinding {
    let measured = 1.0 / turn;
    let clause = format!("the wheels report {} the turning that the walls show", times(measured));
    let clause = if is_limit(measured) { format!("{clause} (robot.wheel_base_m)") } else { clause };
    ModelFinding {
        aspect: ModelAspect::TurnScale,
        measured,
        sigma: FACTOR_SIGMA * measured,
        clause,
        remedies: known(measured, vec![("robot.wheel_base_m", rounded(robot.wheel_base_m * base_factor))]),
    }
}

/// The ranges are `1 / range` of the true ones, by travel and turning.
fn range_scale(configured: f64, range: f64) -> ModelFinding {
    let measured = 1.0 / range;
    let unit = if (measured - 0.5).abs() < 0.08 {
        ": the board may report the time of flight one way"
    } else {
        ": another unit, or wheels and base are both mis-measured"
    };
    let clause = format!("the ranges are {} what travel and turning show{unit}", times(measured));
    let clause = if is_limit(measured) { format!("{clause} (ring.range_scale)") } else { clause };
    ModelFinding {
        aspect: ModelAspect::RangeScale,
        measured,
        sigma: FACTOR_SIGMA * measured,
        clause,
        remedies: known(measured, vec![("ring.range_scale", rounded(configured * range))]),
    }
}

/// The opposite of a flag of the board; one that is not configured is taken as false.
fn toggled(config: &Config, key: &str) -> bool {
    config.board.get(key) != Some(&SettingValue::Flag(true))
}

/// Wheels and walls turn in opposite directions.
fn turn_sign(config: &Config) -> ModelFinding {
    ModelFinding {
        aspect: ModelAspect::TurnSign,
        measured: -1.0,
        sigma: FACTOR_SIGMA,
        clause: "the wheels turn left where the walls say right: left and right wheel are swapped, or the sensors are numbered clockwise"
            .into(),
        remedies: vec![
            ("board.wheels_swapped", toggled(config, "wheels_swapped").to_string()),
            ("ring.mirrored", (!config.ring.mirrored).to_string()),
        ],
    }
}

/// Wheels and walls move in opposite directions, forward and in turns.
fn wheel_signs(config: &Config) -> ModelFinding {
    let [left, right] = ["left_reversed", "right_reversed"].map(|key| toggled(config, key));
    ModelFinding {
        aspect: ModelAspect::WheelSigns,
        measured: -1.0,
        sigma: FACTOR_SIGMA,
        clause: "the wheels report backward where the walls say forward, and turn the wrong way: both count backwards"
            .into(),
        remedies: vec![("board.left_reversed", format!("{left} and board.right_reversed = {right}"))],
    }
}

/// The ring is turned counter-clockwise by an angle.
fn ring_rotation(configured_deg: f64, turned_rad: f64) -> ModelFinding {
    let degrees = turned_rad.to_degrees();
    let mended_deg = wrap_angle(configured_deg.to_radians() + turned_rad).to_degrees();
    // Not "-0".
    let mended_deg = libm::round(mended_deg) + 0.0;
    ModelFinding {
        aspect: ModelAspect::RingRotation,
        measured: degrees,
        sigma: 3.0,
        clause: format!(
            "the robot drives at {:.0} degrees to where sensor bearings say ahead is: the ring is turned",
            -degrees
        ),
        remedies: vec![("ring.rotation_deg", format!("{mended_deg:.0}"))],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(travel: f64, turn: f64, ring_rad: f64) -> Vec<(ModelAspect, &'static str, String)> {
        let mut config = Config::default();
        config.robot.ticks_per_turn = Some(360);
        let findings = findings(&config, &RobotModel { travel, turn, ring_rad, range: 1.0 });
        findings.into_iter().map(|f| (f.aspect, f.remedies[0].0, f.remedies[0].1.clone())).collect()
    }

    #[test]
    fn one_cause_has_one_name_and_the_value_that_mends_it() {
        assert_eq!(named(1.0, 1.02, 0.02), []);
        assert_eq!(named(0.25, 0.25, 0.0), [(ModelAspect::WheelScale, "robot.ticks_per_turn", "1440".into())]);
        assert_eq!(named(1.0, 0.65, 0.0), [(ModelAspect::TurnScale, "robot.wheel_base_m", "0.4".into())]);
        assert_eq!(named(1.0, -1.0, 0.0), [(ModelAspect::TurnSign, "board.wheels_swapped", "true".into())]);
        assert_eq!(named(1.0, 1.0, -1.571), [(ModelAspect::RingRotation, "ring.rotation_deg", "-90".into())]);
        assert_eq!(named(-1.0, -1.0, 0.0)[0].0, ModelAspect::WheelSigns);
        let two = named(0.5, 1.5, 0.0);
        assert_eq!(two.iter().map(|it| it.0).collect::<Vec<_>>(), [ModelAspect::WheelScale, ModelAspect::TurnScale]);
        // The base in metres: 0.26 * travel / turn.
        assert_eq!(two[1].2, "0.0867");
    }

    #[test]
    fn a_remedy_counts_from_what_is_configured() {
        let text = "[ring]\nrotation_deg = 45\nmirrored = true\nrange_scale = 0.5\n[board]\nwheels_swapped = true\n";
        let config = Config::from_toml(text).unwrap();
        let model = RobotModel { turn: -1.0, ring_rad: -0.785, range: 2.0, ..RobotModel::AS_CONFIGURED };
        let remedies: Vec<_> = findings(&config, &model).into_iter().flat_map(|finding| finding.remedies).collect();
        let text: Vec<_> = remedies.iter().map(|(key, value)| format!("{key} = {value}")).collect();
        let expected =
            "ring.rotation_deg = 0, board.wheels_swapped = false, ring.mirrored = false, ring.range_scale = 1";
        assert_eq!(text.join(", "), expected);
    }

    #[test]
    fn ranges_of_one_way_times_are_named() {
        let found = findings(&Config::default(), &RobotModel { range: 2.0, ..RobotModel::AS_CONFIGURED });
        assert_eq!(found.len(), 1);
        assert_eq!(
            (found[0].aspect, &found[0].remedies[0]),
            (ModelAspect::RangeScale, &("ring.range_scale", "2".into()))
        );
        assert!(found[0].clause.contains("0.50 times") && found[0].clause.contains("one way"), "{}", found[0].clause);
    }

    #[test]
    fn a_factor_at_the_end_of_the_search_is_told_without_a_value() {
        let model = RobotModel { travel: 0.21, turn: 0.21, ..RobotModel::AS_CONFIGURED };
        let found = findings(&Config::default(), &model);
        let expected = "the wheels report 4 times or more the travel that the walls show (robot.ticks_per_turn, robot.wheel_radius_m)";
        assert_eq!((found[0].clause.as_str(), found[0].remedies.len()), (expected, 0));
        assert!(is_beyond_search(&model) && !is_beyond_search(&RobotModel { travel: 0.25, turn: 0.25, ..model }));
    }
}
