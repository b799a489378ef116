//! Faulty sensors are found and named, in the simulator and on a real ring of 24 sonars.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd_core::{
    Beam, Config, Driver, Event, FaultEvent, FaultKind, NoMeasurement, Ring, SensorState, Sweep, Timestamp, Update,
    stages::Detector,
};
use slamd_metrics::{Detection, FaultMeter, TrueFault, quantile};
use slamd_sim::simulation::{SimConfig, Simulation, session};
use slamd_sim::world::World;

/// What a run says of its sensors, each event at the time of the input that brought it.
struct Run {
    faults: Vec<FaultEvent>,
    first_estimate_s: f64,
}

fn run(sensors: u8, seed: u64, duration_s: f64, faults: &[&str]) -> Run {
    let simulation = Simulation::new(SimConfig {
        faults: faults.iter().map(|text| text.parse().unwrap()).collect(),
        ..SimConfig::usual(World::named("flat").unwrap(), seed, duration_s, sensors)
    });
    let pipeline = slamd_paper::pipeline(&Config::default(), slamd_core::Start::Fresh).unwrap();
    let mut driver = Driver::new(pipeline);
    let mut run = Run { faults: Vec::new(), first_estimate_s: f64::INFINITY };
    for record in session(simulation) {
        driver.feed(&record, |context, update| match update {
            Update::Event(Event::Fault(fault)) => {
                run.faults.push(FaultEvent { at: context.now, ..fault.clone() });
            }
            Update::Event(Event::Estimate(_)) => {
                run.first_estimate_s = run.first_estimate_s.min(context.now.seconds());
            }
            _ => {}
        });
    }
    run
}

impl Run {
    /// Seconds at which the sensor changed its state, and to what.
    fn of(&self, sensor: usize) -> Vec<(f64, SensorState)> {
        let own = self.faults.iter().filter(|fault| fault.sensor == sensor);
        own.map(|fault| (fault.at.seconds(), fault.state)).collect()
    }
}

#[test]
fn each_fault_is_found_in_time_named_and_cleared_after_recovery() {
    let faults = ["3:saturated@20-60", "11:missing@20-30", "17:noisy@20-30", "29:stuck@20-30"];
    let run = run(32, 1, 90.0, &faults);
    // A saturated sensor is told by the map alone, when the robot comes by a known wall: its latency has a p90 of 18 to 35 s.
    let limits = [
        (3, FaultKind::Saturated, 35.0),
        (11, FaultKind::Missing, 0.5),
        (17, FaultKind::Noisy, 2.0),
        (29, FaultKind::Stuck, 5.0),
    ];
    for (sensor, kind, limit_s) in limits {
        let changes = run.of(sensor);
        println!("{sensor} {kind:?}: {changes:?}");
        let (found_s, state) = changes[0];
        assert_eq!(state, SensorState::Faulty(kind), "{changes:?}");
        assert!((20.0..20.0 + limit_s).contains(&found_s), "{changes:?}");
        let (passed_s, state) = changes[1];
        assert_eq!(state, SensorState::Healthy, "{changes:?}");
        assert!(passed_s < if sensor == 3 { 89.0 } else { 35.0 }, "{changes:?}");
    }
}

#[test]
fn healthy_sensors_stay_trusted() {
    let run = run(32, 2, 240.0, &[]);
    let alarms = run.faults.iter().filter(|fault| fault.state != SensorState::Healthy).count();
    println!("{alarms} false alarms in {:.1} sensor-hours", 32.0 * 240.0 / 3600.0);
    assert!(alarms <= 2, "{:?}", run.faults);
}

#[test]
fn sensors_broken_from_the_start_are_found_before_the_robot_knows_where_it_is() {
    let run = run(8, 3, 20.0, &["2:missing", "5:noisy", "7:stuck"]);
    for (sensor, kind) in [(2, FaultKind::Missing), (5, FaultKind::Noisy), (7, FaultKind::Stuck)] {
        let changes = run.of(sensor);
        assert_eq!(changes[0].1, SensorState::Faulty(kind), "{sensor}: {changes:?}");
        assert!(changes[0].0 < run.first_estimate_s, "{changes:?}, first estimate {}", run.first_estimate_s);
    }
}

#[test]
fn a_fault_that_comes_and_goes_is_trusted_less_each_time() {
    let faults = ["9:missing@20-22", "9:missing@25-27", "9:missing@30-32"];
    let run = run(32, 4, 36.0, &faults);
    let changes = run.of(9);
    println!("{changes:?}");
    let distrusted_s: Vec<f64> = changes.chunks_exact(2).map(|pair| pair[1].0 - pair[0].0).collect();
    assert_eq!(distrusted_s.len(), 3, "{changes:?}");
    assert!(distrusted_s.windows(2).all(|pair| pair[1] > pair[0] + 0.3), "{distrusted_s:?}");
}

/// The real ring: rows of ranges, 5 m standing for no echo.
fn ring24() -> Option<Vec<Vec<f64>>> {
    let path = slamd_testkit::root().join("../shared/data/scitos_g5_ring24/sensor_readings_24_first_half.csv");
    let Ok(text) = std::fs::read_to_string(&path) else {
        println!("skipped: {} is absent", path.display());
        return None;
    };
    let row = |line: &str| line.split(',').take(24).map(|field| field.parse().unwrap()).collect();
    Some(text.lines().skip(1).map(row).collect())
}

/// Nine rows a second.
fn row_at(row: usize) -> Timestamp {
    Timestamp::from_us(row as u64 * 1_000_000 / 9)
}

/// One sweep of the real ring, its true faults put on it.
fn sweep(ring: &Ring, row: usize, rows: &[Vec<f64>], faults: &[TrueFault], dice: &mut u64) -> Sweep {
    let mut random = || {
        *dice = dice.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*dice >> 11) as f64 / (1u64 << 53) as f64
    };
    let beams = ring.mountings.iter().zip(&rows[row]).enumerate().map(|(sensor, (mounting, &read_m))| {
        let fault = faults.iter().find(|fault| fault.sensor == sensor && fault.from <= row_at(row));
        let off_m = (0.2 + 0.6 * random()) * if random() < 0.5 { -1.0 } else { 1.0 };
        let range_m = match fault.map(|fault| fault.kind) {
            None => read_m,
            Some(FaultKind::Saturated) => 5.0,
            Some(FaultKind::Missing) => f64::NAN,
            Some(FaultKind::Noisy) if read_m >= 4.9 => 0.5 + 4.3 * random(),
            Some(FaultKind::Noisy) => (read_m + off_m).clamp(0.03, 4.8),
            Some(FaultKind::Stuck) => {
                let before = (0..rows.len()).take_while(|&row| row_at(row) < fault.unwrap().from);
                before.map(|row| rows[row][sensor]).filter(|range_m| *range_m < 4.9).last().unwrap()
            }
        };
        Beam {
            range_m: if range_m >= 4.9 { f64::INFINITY } else { range_m },
            no_measurement: range_m.is_nan().then_some(NoMeasurement::Absent),
            age_s: 0.0,
            robot_from_sensor: mounting.robot_from_sensor,
            half_angle_rad: mounting.half_angle_rad,
        }
    });
    Sweep { index: row as u64, at: row_at(row), elapsed_s: 1.0 / 9.0, beams: beams.collect(), ..Sweep::default() }
}

fn judge(ring: &Ring, rows: &[Vec<f64>], faults: &[TrueFault]) -> Detection {
    let mut meter = FaultMeter::new(ring.len(), faults.to_vec());
    let (mut detector, mut events, mut dice) = (Detector::new(ring, 4.9), Vec::new(), 1);
    for row in 0..rows.len() {
        detector.inspect(&sweep(ring, row, rows, faults, &mut dice), |_| None, &mut events);
        for event in events.drain(..) {
            let Event::Fault(fault) = event else { continue };
            if std::env::var_os("VERBOSE").is_some() {
                println!("{:.1} s: {}", fault.at.seconds(), fault.reason);
            }
            meter.state(fault.at, fault.sensor, fault.state);
        }
        meter.estimate(row_at(row), row_at(row));
    }
    meter.detection().clone()
}

/// Three sensors a third of the ring apart break half a minute into the recording, each third in turn; without a map and without a pose.
#[test]
fn faults_put_on_a_real_ring_are_found() {
    let Some(rows) = ring24() else { return };
    let config =
        Config::from_toml(&std::fs::read_to_string(slamd_testkit::root().join("configs/scitos24.toml")).unwrap())
            .unwrap();
    let ring = config.ring.ring().unwrap();
    let healthy = judge(&ring, &rows, &[]);
    let alarms_per_hour = healthy.false_alarms_per_hour().unwrap();
    println!("no fault: {} false alarms, {alarms_per_hour:.1} per sensor and hour", healthy.false_alarms);
    assert!(alarms_per_hour < 5.0, "{alarms_per_hour}");
    println!("| kind | precision | recall | latency s p50 / p90 | found |\n|---|---|---|---|---|");
    for kind in [FaultKind::Saturated, FaultKind::Missing, FaultKind::Noisy, FaultKind::Stuck] {
        let mut sums = Detection::default();
        for first in 0..8 {
            let fault = |place: usize| TrueFault { sensor: first + 8 * place, kind, from: row_at(270), until: None };
            sums.add(&judge(&ring, &rows, &[0, 1, 2].map(fault)));
        }
        let (precision, recall) = (sums.precision().unwrap(), sums.recall().unwrap());
        let latencies_s: Vec<f64> = sums.kinds.iter().flat_map(|kind| kind.latencies_s.clone()).collect();
        println!(
            "| {} | {precision:.3} | {recall:.3} | {:.1} / {:.1} | {} of 24 |",
            kind.word(),
            quantile(&latencies_s, 0.5),
            quantile(&latencies_s, 0.9),
            latencies_s.len(),
        );
        assert!(precision > 0.95 && recall > 0.95, "{kind:?}: {precision} {recall}");
    }
}
