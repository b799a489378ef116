//! Robots that walls cannot tell from the one that was found: mirror images, one that drives backward, one that is twice as large.

use super::robot::{self, Change, Wiring};
use slamd_core::{Config, Wheel};
use std::f64::consts::PI;

const BOTH: Change = Change::Reverse([true; 2]);

/// What is to be changed when a person turns the left wheel forward, and the board reports this wheel, forward or not. In each of these
/// robots the same counts and readings make the same map, or its mirror image.
pub(super) const fn of_left_wheel_forward(wheel: Wheel, is_forward: bool) -> &'static [Change] {
    match (wheel, is_forward) {
        (Wheel::Left, true) => &[],
        (Wheel::Right, true) => &[Change::Swap, Change::Mirror],
        (Wheel::Left, false) => &[BOTH, Change::Mirror, Change::Ring(PI)],
        (Wheel::Right, false) => &[BOTH, Change::Swap, Change::Ring(PI)],
    }
}

/// Whether another robot is about as likely as this one: its sides or its front are not as the board says.
pub(super) fn is_of_sides(config: &Config, before: Wiring, wiring: Wiring) -> bool {
    wiring != before || config.ring.mirrored || is_turned_about(config)
}

fn is_turned_about(config: &Config) -> bool {
    config.ring.rotation_deg.abs() > 150.0
}

/// The likelier one of the robots that make a mirror image of the map, as keys to set.
pub(super) fn mirror_image(config: &Config, before: Wiring, wiring: Wiring) -> String {
    let changed = |changes: &[Change]| {
        let mut other = (config.clone(), wiring);
        changes.iter().for_each(|change| robot::change(&mut other.0, &mut other.1, *change));
        other
    };
    let mistakes = |(config, wiring): &(Config, Wiring)| {
        let is_swapped = wiring.is_swapped != before.is_swapped;
        // Two wheels that count backwards are one mistake.
        let is_reversed = wiring.is_reversed != before.is_reversed;
        let mistakes = [is_swapped, is_reversed, config.ring.mirrored, is_turned_about(config)];
        mistakes.into_iter().filter(|is_made| *is_made).count()
    };
    let others =
        [(Wheel::Right, true), (Wheel::Left, false)].map(|seen| changed(of_left_wheel_forward(seen.0, seen.1)));
    let [first, second] = &others;
    let (other, other_wiring) = if mistakes(second) < mistakes(first) { second } else { first };
    let mut keys = Vec::new();
    for ((setting, value), (_, now)) in other_wiring.values().into_iter().zip(wiring.values()) {
        keys.extend((value != now).then(|| format!("{} = {value} in [board]", setting.name())));
    }
    if other.ring.mirrored != config.ring.mirrored {
        keys.push(format!("mirrored = {} in [ring]", other.ring.mirrored));
    }
    if (other.ring.rotation_deg - config.ring.rotation_deg).abs() > 1e-9 {
        keys.push(format!("rotation_deg = {} in [ring]", other.ring.rotation_deg));
    }
    keys.join(", ")
}

/// The robot that is twice as large and whose ranges are one-way times, as keys to set; none if nothing hints at it.
pub(super) fn one_way(config: &Config, said: Option<u32>) -> Option<String> {
    let (said, ticks) = (said?, config.robot.ticks_per_turn?);
    let is_double = (1.8..2.2).contains(&(f64::from(ticks) / f64::from(said)));
    (is_double && config.ring.range_scale.to_bits() == 1f64.to_bits()).then(|| {
        let base_m = 2.0 * config.robot.wheel_base_m;
        format!("range_scale = 2 in [ring], ticks_per_turn = {said} and wheel_base_m = {base_m:.3} in [robot]")
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use slamd_core::config::CircleConfig;
    use slamd_core::{Pose2, wrap_angle};

    /// A robot's configuration, its wiring, and what its board counts as the wheels roll: the mistakes are in the robot.
    fn robot(is_swapped: bool, is_reversed: bool, mirrored: bool, rotation_deg: f64) -> (Config, Wiring) {
        let mut config = Config::default();
        let circle = CircleConfig { count: 8, radius_m: 0.1, half_angle_deg: 10.0, groups: 4, clockwise: false };
        (config.ring.circle, config.ring.mirrored, config.ring.rotation_deg) = (Some(circle), mirrored, rotation_deg);
        (config, Wiring { is_swapped, is_reversed: [is_reversed; 2] })
    }

    /// Motion forward and to the left that this wiring makes of raw counts.
    fn motion(wiring: Wiring, [left, right]: [f64; 2]) -> [f64; 2] {
        let (left, right) = if wiring.is_swapped { (right, left) } else { (left, right) };
        let [left, right] = [(left, wiring.is_reversed[0]), (right, wiring.is_reversed[1])]
            .map(|(count, is_reversed)| if is_reversed { -count } else { count });
        [0.5 * (left + right), right - left]
    }

    /// Where a sensor looks after the robot has moved: a point of the map.
    fn seen((config, wiring): &(Config, Wiring), counts: &[[f64; 2]], sensor: usize) -> Pose2 {
        let mut pose = Pose2::default();
        for step in counts {
            let [ahead, left] = motion(*wiring, *step);
            pose = pose * Pose2::new(ahead, 0.0, 0.0) * Pose2::new(0.0, 0.0, left);
        }
        pose * config.ring.ring().unwrap().mountings[sensor].robot_from_sensor * Pose2::new(1.0, 0.0, 0.0)
    }

    #[test]
    fn each_answer_of_the_person_leads_to_a_robot_with_the_same_map_or_its_mirror_image() {
        let counts = [[0.3, 0.1], [0.2, 0.5], [-0.1, 0.2], [0.4, 0.4]];
        for found in [robot(false, false, false, 0.0), robot(true, false, false, 90.0), robot(false, true, true, 180.0)]
        {
            for (wheel, is_forward) in
                [(Wheel::Left, true), (Wheel::Right, true), (Wheel::Left, false), (Wheel::Right, false)]
            {
                let mut other = found.clone();
                for change in of_left_wheel_forward(wheel, is_forward) {
                    robot::change(&mut other.0, &mut other.1, *change);
                }
                // The left wheel forward is now the left wheel forward.
                let raw = [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]];
                let reported = if wheel == Wheel::Left { [1.0, 0.0] } else { [0.0, 1.0] };
                let reported = reported.map(|m| if is_forward { m } else { -m });
                let as_found = [0.5 * (reported[0] + reported[1]), reported[1] - reported[0]];
                let is = |one: [f64; 2], two: [f64; 2]| one.iter().zip(two).all(|(a, b)| (a - b).abs() < 1e-9);
                let count = raw.into_iter().find(|count| is(motion(found.1, *count), as_found)).unwrap();
                assert!(is(motion(other.1, count), [0.5, -1.0]), "{wheel:?} {is_forward}");
                // Two points of the map, measured from the first one, keep their distance and, mirrored or not, their angle.
                let relations = |robot: &(Config, Wiring)| {
                    let [a, b, c] =
                        [(1, 0), (4, 2), (4, 7)].map(|(steps, sensor)| seen(robot, &counts[..steps], sensor));
                    let (b, c) = (b.position() - a.position(), c.position() - a.position());
                    let angle = wrap_angle(libm::atan2(c.y, c.x) - libm::atan2(b.y, b.x));
                    [b.norm(), c.norm(), angle.abs()]
                };
                let (one, two) = (relations(&found), relations(&other));
                assert!(
                    one.iter().zip(two).all(|(a, b)| (a - b).abs() < 1e-9),
                    "{wheel:?} {is_forward}: {one:?} {two:?}"
                );
            }
        }
    }

    #[test]
    fn the_simpler_mirror_image_is_named() {
        let plain = Wiring::default();
        let (config, wiring) = robot(true, false, false, 90.0);
        let keys = "wheels_swapped = false in [board], mirrored = true in [ring], rotation_deg = -90 in [ring]";
        assert_eq!(mirror_image(&config, plain, wiring), keys);
        let (config, wiring) = robot(false, false, false, -180.0);
        assert!(is_of_sides(&config, plain, wiring));
        let keys = "left_reversed = true in [board], right_reversed = true in [board], mirrored = true in [ring], \
                    rotation_deg = 0 in [ring]";
        assert_eq!(mirror_image(&config, plain, wiring), keys);
    }
}
