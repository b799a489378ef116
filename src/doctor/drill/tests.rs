//! A drill in a room of 6 by 4 m, by robots with one mistake each.

use super::*;
use slamd_core::{Beam, Pose2};
use std::f64::consts::{FRAC_PI_2, PI};

/// Half the room's sides, metres, and where the drill begins.
const ROOM_M: [f64; 2] = [6.0, 4.0];
const BASE_M: f64 = 0.26;

/// How a robot differs from what it says.
#[derive(Clone, Copy)]
struct Robot {
    ticks: f64,
    range: f64,
    turned_rad: f64,
    is_mirrored: bool,
    is_swapped: bool,
}

const RIGHT: Robot = Robot { ticks: 1.0, range: 1.0, turned_rad: 0.0, is_mirrored: false, is_swapped: false };

/// The distance to the nearest wall within a cone.
fn range_m(x: f64, y: f64, heading: f64) -> f64 {
    let ray = |offset: f64| {
        let (sin, cos) = libm::sincos(heading + offset);
        let along = |at: f64, side: f64, step: f64| {
            if step.abs() < 1e-9 { f64::MAX } else { ((if step > 0.0 { side } else { 0.0 }) - at) / step }
        };
        along(x, ROOM_M[0], cos).min(along(y, ROOM_M[1], sin))
    };
    [-0.2, -0.1, 0.0, 0.1, 0.2].map(ray).into_iter().fold(f64::MAX, f64::min)
}

/// What the drill of this robot with so many sensors shows: two seconds of rest, 30 cm, a quarter turn, rest.
fn drill(robot: Robot, sensors: u8) -> Vec<Mistake> {
    let ring = Ring::circle(sensors, 0.15, 0.2, 1);
    let mut drill = Drill::new(BASE_M);
    for step in 0..80 {
        let (pushed_m, turned_rad) = match step {
            20..30 => (0.03, 0.0),
            30..56 => (0.0, FRAC_PI_2 / 26.0),
            _ => (0.0, 0.0),
        };
        let way_m = 0.03 * f64::from((step - 19).clamp(0, 10));
        let heading = FRAC_PI_2 / 26.0 * f64::from((step - 29).clamp(0, 26));
        let beams = ring.mountings.iter().map(|mounting| {
            let side = if robot.is_mirrored { -1.0 } else { 1.0 };
            let bearing = heading + side * mounting.robot_from_sensor.theta_rad + robot.turned_rad;
            let (x, y) = (3.0 + way_m + 0.15 * libm::cos(bearing), 1.0 + 0.15 * libm::sin(bearing));
            let read_m = robot.range * range_m(x, y, bearing);
            let range_m = if read_m > 3.0 { f64::INFINITY } else { read_m };
            Beam { range_m, no_measurement: None, age_s: 0.0, robot_from_sensor: Pose2::default(), half_angle_rad: 0.2 }
        });
        let half_m = 0.5 * BASE_M * turned_rad;
        let [left, right] = [pushed_m - half_m, pushed_m + half_m].map(|m| robot.ticks * m);
        let [left_m, right_m] = if robot.is_swapped { [right, left] } else { [left, right] };
        let sweep = Sweep { beams: beams.collect(), left_m, right_m, elapsed_s: 0.1, ..Sweep::default() };
        drill.sweep(&sweep);
    }
    assert!(drill.is_done(), "{}", drill.instruction());
    drill.result(&ring).mistakes()
}

#[test]
fn a_drill_names_each_mistake_and_no_other() {
    for sensors in [8, 12, 16, 32] {
        assert_eq!(drill(RIGHT, sensors), [], "{sensors}");
        for ticks in [0.5, 2.0, 4.0] {
            let mistakes = drill(Robot { ticks, ..RIGHT }, sensors);
            assert_eq!(mistakes, [Mistake::WheelScale(ticks)], "{sensors}");
        }
        let mistakes = drill(Robot { range: 0.5, ..RIGHT }, sensors);
        assert!(matches!(mistakes[..], [Mistake::RangeScale(factor)] if (factor - 0.5).abs() < 0.05), "{mistakes:?}");
        for turned in [FRAC_PI_2, -FRAC_PI_2, PI] {
            let mistakes = drill(Robot { turned_rad: turned, ..RIGHT }, sensors);
            assert!(
                matches!(mistakes[..], [Mistake::RingTurned(found)] if wrap_angle(found - turned).abs() < 1e-6),
                "{sensors} sensors turned by {turned}: {mistakes:?}"
            );
        }
        for turned_deg in [15.0_f64, -15.0, 12.0, -20.0] {
            let mistakes = drill(Robot { turned_rad: turned_deg.to_radians(), ..RIGHT }, sensors);
            assert!(
                matches!(mistakes[..], [Mistake::RingTurned(found)] if (found.to_degrees() - turned_deg).abs() < 4.0),
                "{sensors} sensors turned by {turned_deg} degrees: {mistakes:?}"
            );
        }
        assert_eq!(drill(Robot { is_mirrored: true, ..RIGHT }, sensors), [Mistake::Mirrored], "{sensors}");
        assert_eq!(drill(Robot { is_swapped: true, ..RIGHT }, sensors), [Mistake::Swapped], "{sensors}");
    }
}

#[test]
fn measured_factors_are_simple_where_they_are_near() {
    for (measured, simple) in [(2.08, 2.0), (0.52, 0.5), (4.1, 4.0), (1.3, 1.3)] {
        assert!((simple_factor(measured) - simple).abs() < 1e-9, "{measured}");
    }
}
