//! A robot that fits the walls, as the names, keys and values that mend the configuration.

use super::finding::{ModelAspect, ModelFinding};
use super::hypothesis::RobotModel;
use crate::config::RobotConfig;
use crate::geometry::wrap_angle;

/// What differs between a robot and its configuration, the most fundamental first; nothing if the two are the same.
pub(super) fn findings(robot: &RobotConfig, model: &RobotModel) -> Vec<ModelFinding> {
    let mut findings = Vec::new();
    if model.ring_rad.abs() > MIN_TURNED_RAD {
        findings.push(ring_rotation(wrap_angle(model.ring_rad)));
    }
    match (model.travel < 0.0, model.turn < 0.0) {
        (false, true) => findings.push(turn_sign()),
        (true, true) => findings.push(wheel_signs()),
        _ => {}
    }
    let (travel, turn) = (model.travel.abs(), model.turn.abs());
    match [is_off(travel), is_off(turn), is_off(travel / turn)] {
        [true, true, false] => findings.push(wheel_scale(robot, libm::sqrt(travel * turn))),
        [true, false, true] => findings.push(range_scale(robot, travel)),
        [true, true, true] => {
            findings.push(wheel_scale(robot, travel));
            findings.push(turn_scale(robot, travel / turn, turn));
        }
        [false, true, _] => findings.push(turn_scale(robot, 1.0 / turn, turn)),
        [true, false, false] => findings.push(wheel_scale(robot, travel)),
        [false, false, _] => {}
    }
    findings
}

/// Smaller differences are what the filter learns by itself: their names would be noise.
const MIN_FACTOR: f64 = 1.1;
const MIN_TURNED_RAD: f64 = 0.1;
/// Resolution of the search: its last step.
const FACTOR_SIGMA: f64 = 0.03;

fn is_off(factor: f64) -> bool {
    !(1.0 / MIN_FACTOR..=MIN_FACTOR).contains(&factor)
}

fn rounded(value: f64) -> String {
    format!("{}", (1e4 * value).round() / 1e4)
}

/// Both wheels report `1 / factor` of the motion.
fn wheel_scale(robot: &RobotConfig, factor: f64) -> ModelFinding {
    let measured = 1.0 / factor;
    let mut remedies = vec![("robot.wheel_radius_m", rounded(robot.wheel_radius_m * factor))];
    if let Some(ticks) = robot.ticks_per_turn {
        remedies.insert(0, ("robot.ticks_per_turn", format!("{:.0}", f64::from(ticks) * measured)));
    }
    let clause = format!("the wheels report {measured:.2} times the travel that the walls show");
    ModelFinding { aspect: ModelAspect::WheelScale, measured, sigma: FACTOR_SIGMA * measured, clause, remedies }
}

/// The wheels report `1 / turn` of the rotation, the base is `base_factor` of the configured one.
fn turn_scale(robot: &RobotConfig, base_factor: f64, turn: f64) -> ModelFinding {
    let measured = 1.0 / turn;
    ModelFinding {
        aspect: ModelAspect::TurnScale,
        measured,
        sigma: FACTOR_SIGMA * measured,
        clause: format!("the wheels report {measured:.2} times the turning that the walls show"),
        remedies: vec![("robot.wheel_base_m", rounded(robot.wheel_base_m * base_factor))],
    }
}

/// Straight travel differs and turning does not.
fn range_scale(robot: &RobotConfig, travel: f64) -> ModelFinding {
    let measured = travel;
    let both = format!("{} and robot.wheel_base_m = {}", rounded(robot.wheel_radius_m * travel), rounded(robot.wheel_base_m * travel));
    let unit = if (measured - 0.5).abs() < 0.08 {
        "; a board that reports one-way times of flight has ranges half as long"
    } else {
        ""
    };
    ModelFinding {
        aspect: ModelAspect::RangeScale,
        measured,
        sigma: FACTOR_SIGMA * measured,
        clause: format!(
            "walls come nearer by {measured:.2} of the travel that the wheels report, and turning agrees: the ranges are in another unit{unit}, or wheels and base are both mis-measured"
        ),
        remedies: vec![("robot.wheel_radius_m", both)],
    }
}

/// Wheels and walls turn in opposite directions.
fn turn_sign() -> ModelFinding {
    ModelFinding {
        aspect: ModelAspect::TurnSign,
        measured: -1.0,
        sigma: FACTOR_SIGMA,
        clause: "the wheels turn left where the walls say right: left and right wheel are swapped, or the sensors are numbered clockwise"
            .into(),
        remedies: vec![("board.wheels_swapped", "true".into()), ("ring.mirrored", "true".into())],
    }
}

/// Wheels and walls move in opposite directions, forward and in turns.
fn wheel_signs() -> ModelFinding {
    ModelFinding {
        aspect: ModelAspect::WheelSigns,
        measured: -1.0,
        sigma: FACTOR_SIGMA,
        clause: "the wheels report backward where the walls say forward, and turn the wrong way: both count backwards".into(),
        remedies: vec![("board.left_reversed", "true and board.right_reversed = true".into())],
    }
}

/// The ring is turned counter-clockwise by an angle.
fn ring_rotation(turned_rad: f64) -> ModelFinding {
    let degrees = turned_rad.to_degrees();
    ModelFinding {
        aspect: ModelAspect::RingRotation,
        measured: degrees,
        sigma: 3.0,
        clause: format!("the robot drives at {:.0} degrees to where sensor bearings say ahead is: the ring is turned", -degrees),
        remedies: vec![("ring.rotation_deg", format!("{degrees:.0}"))],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(travel: f64, turn: f64, ring_rad: f64) -> Vec<(ModelAspect, &'static str, String)> {
        let robot = RobotConfig { ticks_per_turn: Some(360), ..RobotConfig::default() };
        let findings = findings(&robot, &RobotModel { travel, turn, ring_rad });
        findings.into_iter().map(|f| (f.aspect, f.remedies[0].0, f.remedies[0].1.clone())).collect()
    }

    #[test]
    fn one_cause_has_one_name_and_the_value_that_mends_it() {
        assert_eq!(named(1.0, 1.02, 0.02), []);
        assert_eq!(named(0.25, 0.25, 0.0), [(ModelAspect::WheelScale, "robot.ticks_per_turn", "1440".into())]);
        assert_eq!(named(1.0, 0.65, 0.0), [(ModelAspect::TurnScale, "robot.wheel_base_m", "0.4".into())]);
        assert_eq!(named(1.0, -1.0, 0.0), [(ModelAspect::TurnSign, "board.wheels_swapped", "true".into())]);
        assert_eq!(named(1.0, 1.0, -1.571), [(ModelAspect::RingRotation, "ring.rotation_deg", "-90".into())]);
        assert_eq!(named(0.5, 1.0, 0.0)[0].0, ModelAspect::RangeScale);
        assert_eq!(named(-1.0, -1.0, 0.0)[0].0, ModelAspect::WheelSigns);
        let two = named(0.5, 1.5, 0.0);
        assert_eq!(two.iter().map(|it| it.0).collect::<Vec<_>>(), [ModelAspect::WheelScale, ModelAspect::TurnScale]);
        // The base in metres: 0.26 * travel / turn.
        assert_eq!(two[1].2, "0.0867");
    }
}
