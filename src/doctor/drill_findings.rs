//! What the drill shows, as findings; and remedies of a recording, where no board can be asked.

use super::drill::{DrillResult, Mistake, PUSH_M};
use super::finding::{Finding, Level};
use slamd_core::config::RobotConfig;

/// The findings of the drill. `ticks` is the number of ticks per turn in use.
pub(super) fn findings(result: &DrillResult, robot: &RobotConfig, ticks: Option<u32>) -> Vec<Finding> {
    let mut findings: Vec<Finding> =
        result.mistakes().into_iter().map(|mistake| finding(mistake, robot, ticks)).collect();
    let pushed_m = result.pushed_m.map(|rolled| 0.5 * rolled.iter().map(|m| m.abs()).sum::<f64>());
    if let (Some(pushed_m), None) = (pushed_m, result.walls_per_counted)
        && !(0.6 * PUSH_M..=1.6 * PUSH_M).contains(&pushed_m)
    {
        let text = format!(
            "the wheels counted {:.0} cm of the first push; no wall ahead or behind tells more",
            100.0 * pushed_m
        );
        let fix = match ticks {
            Some(ticks) => format!(
                "if it was pushed 30 cm, set robot.ticks_per_turn = {:.0} in the robot's TOML (--config)",
                f64::from(ticks) * pushed_m / PUSH_M
            ),
            None => "if it was pushed 30 cm, correct robot.ticks_per_turn or robot.wheel_radius_m".into(),
        };
        findings.push(Finding::new(Level::Note, "wheels.scale", text, fix));
    }
    findings
}

fn finding(mistake: Mistake, robot: &RobotConfig, ticks: Option<u32>) -> Finding {
    const TOML: &str = "in the robot's TOML (--config)";
    let warning = |id, text: String, fix: String| Finding::new(Level::Warning, id, text, fix);
    match mistake {
        Mistake::WheelScale(factor) => {
            let radius_m = robot.wheel_radius_m / factor;
            let ticks = ticks.map(|ticks| format!("robot.ticks_per_turn = {:.0} or ", f64::from(ticks) * factor));
            warning(
                "wheels.scale",
                format!("in the push, the wheels count {factor:.2} times the travel that the walls show"),
                format!("set {}robot.wheel_radius_m = {radius_m:.4} {TOML}", ticks.unwrap_or_default()),
            )
        }
        Mistake::RangeScale(factor) => {
            let unit = if (0.4..0.6).contains(&factor) { ": one-way times of flight?" } else { "" };
            warning(
                "sensors.unit",
                format!("in the push, the ranges change by {factor:.2} of the travel{unit}"),
                "send the round-trip time of flight in microseconds, there and back".into(),
            )
        }
        Mistake::RingTurned(turned_rad) => {
            let turned_deg = turned_rad.to_degrees();
            warning(
                "sensors.turned",
                format!("the robot was pushed towards where its sensors say {:.0} degrees is", -turned_deg),
                format!("if it was pushed straight ahead, set ring.rotation_deg = {turned_deg:.0} {TOML}"),
            )
        }
        Mistake::Swapped => warning(
            "wheels.swapped",
            "the wheels count a turn to the right, the walls show one to the left: the wheels are swapped".into(),
            format!("set [board] wheels_swapped {TOML}, or exchange the encoders' plugs"),
        ),
        Mistake::Mirrored => warning(
            "sensors.mirrored",
            "the wheels count a turn to the left, the walls show one to the right: the sensors are numbered the other way \
             round"
                .into(),
            format!("set ring.mirrored = true {TOML}"),
        ),
    }
}

/// Remedies that only a live board can take, and what to do about a recording instead.
const RECORDED: &[(&str, &str)] = &[
    ("run longer: --seconds 30", "record for longer"),
    (
        "push the robot forward 30 cm while this runs, then turn it left on the spot",
        "record a push of 30 cm and a turn to the left on the spot",
    ),
    (
        "after the push, turn the robot left (counter-clockwise) by a quarter while this runs",
        "record a turn to the left (counter-clockwise) after the push",
    ),
    (
        "press its reset button while this runs; if that does not help,",
        "record from the start of the board on; if that does not help,",
    ),
    (
        "press the board's reset button; if that does not help,",
        "record again after a reset of the board; if that does not help,",
    ),
    ("hold something 30 cm in front of the sensors", "record with something 30 cm in front of the sensors"),
    (" while this runs; if it still", " and record again; if it still"),
    ("start slamd with --baud", "record with --baud"),
];

/// The finding, with a remedy that somebody with a recording can take.
pub(super) fn of_recording(mut finding: Finding) -> Finding {
    if let Some(fix) = &mut finding.fix {
        for (live, recorded) in RECORDED {
            *fix = fix.replace(live, recorded);
        }
    }
    finding
}
