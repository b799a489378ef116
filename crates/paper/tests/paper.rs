//! The paper's method where it works: point beams, ideal wheels, a rectangular room whose walls are always in range.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd_core::{
    Beam, Config, Estimate, Estimator, Event, FaultEvent, FaultKind, NoMeasurement, Point, Pose2, Ring, SensorState,
    Sweep, Timestamp, wrap_angle,
};
use slamd_paper::Paper;
use slamd_paper::detector::PaperDetector;
use slamd_paper::params::Params;

const SENSORS: u8 = 32;
const MAX_RANGE_M: f64 = 3.0;
const PERIOD_S: f64 = 0.1;
/// The room, metres from its middle.
const HALF: (f64, f64) = (2.4, 1.7);
const NOISE_M: f64 = 0.02;

/// Numbers in [0, 1) that look random: Knuth's generator.
struct Dice(u64);

impl Dice {
    fn roll(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as f64 / f64::from(1_u32 << 31)
    }

    /// About normal, variance 1.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.roll()).sum::<f64>() - 6.0
    }
}

/// A robot on an ellipse in the room, at sweep k.
fn truth(k: u32) -> Pose2 {
    let phase = 0.012 * f64::from(k);
    let (sin, cos) = libm::sincos(phase);
    Pose2::new(1.2 * cos, 0.7 * sin, libm::atan2(0.7 * cos, -1.2 * sin))
}

/// What a point beam measures.
fn range(room_from_sensor: Pose2) -> f64 {
    let (sin, cos) = libm::sincos(room_from_sensor.theta_rad);
    let along = |position: f64, direction: f64, half: f64| {
        if direction.abs() < 1e-12 { f64::INFINITY } else { (half.copysign(direction) - position) / direction }
    };
    let range = along(room_from_sensor.x_m, cos, HALF.0).min(along(room_from_sensor.y_m, sin, HALF.1));
    if range > MAX_RANGE_M { f64::INFINITY } else { range }
}

/// Sweep k of the drive, with `fault` applied to each (sensor, healthy range).
fn sweep(k: u32, dice: &mut Dice, fault: &mut impl FnMut(usize, f64, &mut Dice) -> f64) -> Sweep {
    let ring = Ring::circle(SENSORS, 0.15, 0.0, 1);
    let pose = truth(k);
    let mut beams = Vec::new();
    for (sensor, mounting) in ring.mountings.iter().enumerate() {
        let healthy = range(pose * mounting.robot_from_sensor) + NOISE_M * dice.normal();
        let range_m = fault(sensor, healthy, dice);
        beams.push(Beam {
            range_m,
            no_measurement: range_m.is_nan().then_some(NoMeasurement::Absent),
            age_s: 0.0,
            robot_from_sensor: mounting.robot_from_sensor,
            half_angle_rad: 0.0,
        });
    }
    Sweep {
        index: u64::from(k),
        at: Timestamp::from_us(u64::from(k) * 100_000),
        elapsed_s: if k == 0 { 0.0 } else { PERIOD_S },
        beams,
        odometry: truth(0).inverse() * pose,
        ..Sweep::default()
    }
}

/// The paper's test: two sensors always saturated, two missing, four with 20 to 80 cm of noise.
fn paper_faults(sensor: usize, healthy: f64, dice: &mut Dice) -> f64 {
    match sensor {
        3 | 19 => f64::INFINITY,
        8 | 25 => f64::NAN,
        5 | 12 | 22 | 30 => wild(healthy, dice),
        _ => healthy,
    }
}

fn wild(healthy: f64, dice: &mut Dice) -> f64 {
    let error = (0.2 + 0.6 * dice.roll()).copysign(dice.roll() - 0.5);
    (healthy.min(MAX_RANGE_M) + error).clamp(0.02, MAX_RANGE_M)
}

/// Runs the method; the estimates, and the method at the end.
fn drive(sweeps: u32, mut fault: impl FnMut(usize, f64, &mut Dice) -> f64) -> (Vec<Estimate>, Paper) {
    let mut paper = Paper::new(&Config::default(), &Ring::circle(SENSORS, 0.15, 0.0, 1));
    let (mut dice, mut events) = (Dice(7), Vec::new());
    for k in 0..sweeps {
        paper.update(&sweep(k, &mut dice, &mut fault), &mut events);
    }
    let estimates = events.into_iter().filter_map(|e| if let Event::Estimate(e) = e { Some(e) } else { None });
    (estimates.collect(), paper)
}

/// Heading RMSE in degrees, position RMSE in metres, aligned at the first pose only.
fn errors(estimates: &[Estimate]) -> (f64, f64) {
    let (mut heading, mut position) = (0.0, 0.0);
    for (k, estimate) in (0..).zip(estimates) {
        let expected = truth(0).inverse() * truth(k);
        heading += wrap_angle(estimate.pose.theta_rad - expected.theta_rad).powi(2);
        position += (estimate.pose.position() - expected.position()).norm_squared();
    }
    let count = estimates.len() as f64;
    ((heading / count).sqrt().to_degrees(), (position / count).sqrt())
}

/// The share of 5 cm pieces of the four walls with an occupied cell within 5 cm.
fn walls_found(paper: &Paper) -> [f64; 4] {
    let raster = paper.raster();
    let map_from_room = truth(0).inverse();
    let occupied = |point: Point| {
        let centre = map_from_room.transform(point);
        (-5..=5).any(|dx| {
            (-5..=5).any(|dy| {
                let near = centre + nalgebra::Vector2::new(f64::from(dx), f64::from(dy)) * 0.01;
                raster.cell(near).is_some_and(|(column, row)| raster.occupancy[row * raster.width + column] == 100)
            })
        })
    };
    let share = |wall: &dyn Fn(f64) -> Point, half: f64| {
        let pieces: Vec<f64> = (0..40).map(|i| half * (f64::from(i) / 20.0 - 0.975)).collect();
        pieces.iter().filter(|t| occupied(wall(**t))).count() as f64 / 40.0
    };
    [
        share(&|t| Point::new(t, HALF.1), HALF.0),
        share(&|t| Point::new(t, -HALF.1), HALF.0),
        share(&|t| Point::new(HALF.0, t), HALF.1),
        share(&|t| Point::new(-HALF.0, t), HALF.1),
    ]
}

#[test]
fn point_beams_and_healthy_sensors_give_heading_position_and_four_walls() {
    let (estimates, paper) = drive(1100, |_, healthy, _| healthy);
    let (heading_deg, position_m) = errors(&estimates);
    println!("healthy: {heading_deg:.2} deg, {position_m:.3} m, walls {:?}", walls_found(&paper));
    assert!(heading_deg < 2.0 && position_m < 0.08, "{heading_deg} deg, {position_m} m");
    assert!(walls_found(&paper).iter().all(|share| *share > 0.9), "{:?}", walls_found(&paper));
}

#[test]
fn the_papers_eight_faults_leave_heading_position_and_walls() {
    let (estimates, paper) = drive(1100, paper_faults);
    let (heading_deg, position_m) = errors(&estimates);
    println!("paper's faults: {heading_deg:.2} deg, {position_m:.3} m, walls {:?}", walls_found(&paper));
    assert!(heading_deg < 2.0 && position_m < 0.08, "{heading_deg} deg, {position_m} m");
    assert!(walls_found(&paper).iter().all(|share| *share > 0.9), "{:?}", walls_found(&paper));
}

/// The detector alone on such a drive: its events, and the number of sweeps for which each sensor was ignored.
fn judge(sweeps: u32, mut fault: impl FnMut(usize, u32, f64, &mut Dice) -> f64) -> (Vec<FaultEvent>, Vec<u32>) {
    let mut detector = PaperDetector::new(usize::from(SENSORS), MAX_RANGE_M, Params::default());
    let (mut dice, mut events, mut ignored) = (Dice(3), Vec::new(), vec![0; usize::from(SENSORS)]);
    for k in 0..sweeps {
        let sweep = sweep(k, &mut dice, &mut |sensor, healthy, dice| fault(sensor, k, healthy, dice));
        detector.inspect(&sweep, &mut events);
        for (count, state) in ignored.iter_mut().zip(detector.states()) {
            *count += u32::from(*state != SensorState::Healthy);
        }
    }
    let faults = events.into_iter().filter_map(|e| if let Event::Fault(fault) = e { Some(fault) } else { None });
    (faults.collect(), ignored)
}

#[test]
fn the_papers_faults_are_found_except_the_saturated() {
    let (faults, ignored) = judge(600, |sensor, _, healthy, dice| paper_faults(sensor, healthy, dice));
    println!("ignored sweeps by sensor: {ignored:?}");
    let kinds = |sensor| faults.iter().filter(move |fault| fault.sensor == sensor).map(|fault| fault.state);
    for missing in [8, 25] {
        assert_eq!(kinds(missing).collect::<Vec<_>>(), [SensorState::Faulty(FaultKind::Missing)]);
        assert_eq!(ignored[missing], 592, "from the ninth sweep on");
    }
    for noisy in [5, 12, 22, 30] {
        assert_eq!(kinds(noisy).next(), Some(SensorState::Faulty(FaultKind::Noisy)));
        assert!(ignored[noisy] > 570, "{ignored:?}");
    }
    assert_eq!((ignored[3], ignored[19]), (0, 0), "a row that never changes: the literal method cannot see it");
}

#[test]
fn a_stuck_sensor_is_found_while_the_robot_moves() {
    let (faults, ignored) = judge(100, |sensor, k, healthy, _| if sensor == 4 && k > 30 { 0.7 } else { healthy });
    let stuck = faults.iter().find(|fault| fault.state == SensorState::Faulty(FaultKind::Stuck)).unwrap();
    assert_eq!(stuck.sensor, 4);
    assert!(stuck.reason.starts_with("read 0.700 m"), "{}", stuck.reason);
    assert!(ignored[4] > 50, "{ignored:?}");
}

#[test]
fn a_single_noisy_sensor_hides_in_the_first_component() {
    let (_, ignored) = judge(300, |sensor, _, healthy, dice| if sensor == 9 { wild(healthy, dice) } else { healthy });
    assert!(ignored[9] < 30, "literal: {ignored:?}");
}

#[test]
fn falling_silent_is_noticed_and_forgiven_because_silence_itself_is_not_seen() {
    let silent_from = 90;
    let (faults, _) = judge(200, |sensor, k, healthy, _| {
        let near = healthy.min(1.0);
        if sensor != 6 {
            healthy
        } else if k < silent_from {
            near
        } else {
            f64::INFINITY
        }
    });
    let of_six: Vec<&FaultEvent> = faults.iter().filter(|fault| fault.sensor == 6).collect();
    assert_eq!(of_six.last().unwrap().state, SensorState::Healthy, "{of_six:?}");
    assert!(of_six.iter().any(|fault| matches!(fault.state, SensorState::Faulty(_))));
}

#[test]
fn noisy_sensors_that_recover_are_forgiven_after_the_stated_time() {
    let (faults, _) =
        judge(
            120,
            |sensor, k, healthy, dice| {
                if [2, 9, 16, 23].contains(&sensor) && k < 30 { wild(healthy, dice) } else { healthy }
            },
        );
    let of_nine: Vec<&FaultEvent> = faults.iter().filter(|fault| fault.sensor == 9).collect();
    let forgiven = of_nine.iter().find(|fault| fault.state == SensorState::Healthy).unwrap();
    let sweeps = forgiven.at.us() / 100_000;
    let ignored_sweeps = Params::default().ignored_sweeps;
    assert!((29 + ignored_sweeps..29 + ignored_sweeps + 18).contains(&sweeps), "{of_nine:?}");
}

#[test]
fn silence_absence_and_nonsense_are_no_danger() {
    let ring = Ring::circle(8, 0.15, 0.0, 1);
    let mut paper = Paper::new(&Config::default(), &ring);
    let mut events = Vec::new();
    let mut dice = Dice(1);
    for k in 0..40 {
        let odd = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -5.0, 0.0];
        let mut sweep = sweep(k, &mut dice, &mut |sensor, _, _| odd[sensor % odd.len()]);
        sweep.elapsed_s = [f64::NAN, 1e9, -1.0, 0.0][k as usize % 4];
        sweep.beams.truncate(k as usize);
        paper.update(&sweep, &mut events);
    }
    assert_eq!(events.iter().filter(|event| matches!(event, Event::Estimate(_))).count(), 40);
    assert_eq!(paper.states().len(), 8);
}
