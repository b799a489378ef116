//! One simulated drive and everything that is measured of it.

use super::case::Case;
use super::earliest::earliest_s;
use rustix::time::{ClockId, clock_gettime};
use slamd_core::{Config, Driver, Estimate, Event, Method, Pipeline, Pose2, Record, Start, Timestamp, Update};
use slamd_metrics::{
    Accuracy, AccuracyMeter, Detection, FaultMeter, MapMeter, MapQuality, Pair, Pairing, TrueFault, building_frame,
    mean_nees,
};
use slamd_sim::fault::SensorFault;
use slamd_sim::link::LinkFaults;
use slamd_sim::simulation::{SimConfig, Simulation, session};
use slamd_sim::sonar::MAX_RANGE_M;
use slamd_sim::world::World;
use std::time::Duration;

/// What was measured of one drive.
#[derive(Clone, Debug)]
pub struct Run {
    /// The simulation's seed.
    pub seed: u64,
    /// The estimate's errors.
    pub accuracy: Accuracy,
    /// Position error of the last estimate, metres.
    pub last_m: f64,
    /// The encoders' own ATE, metres.
    pub odometry_ate_m: f64,
    /// Length of the true path, metres.
    pub path_m: f64,
    /// The fault detector's sums.
    pub detection: Detection,
    /// Seconds until each saturated sensor could first be told from a healthy one.
    pub earliest_s: Vec<f64>,
    /// The map against the walls.
    pub map: MapQuality,
    /// Mean normalised innovation squared per wall seen; NaN where the method has none.
    pub nis: f64,
    /// Mean normalised estimation error squared per degree of freedom.
    pub nees: f64,
    /// Microseconds of computing for each sweep, from its bytes to the estimate; what the first sweeps cost, which wait for the building's axis,
    /// counts with the sweeps that they are used with.
    pub sweeps_us: Vec<f64>,
}

impl Run {
    /// Above this error a robot does not know where it is, metres.
    pub const LOST_M: f64 = 0.5;

    /// The last estimate is more than [`Run::LOST_M`] off.
    #[must_use]
    pub fn is_lost_at_end(&self) -> bool {
        self.last_m > Self::LOST_M
    }

    /// Some estimate is more than [`Run::LOST_M`] off; so is some estimate of every run whose ATE is.
    #[must_use]
    pub fn is_ever_lost(&self) -> bool {
        self.accuracy.ate_max_m > Self::LOST_M
    }
}

/// A drive as it was simulated and estimated: what pictures are made of.
#[derive(Debug)]
pub struct Drive {
    /// Estimates beside the truth.
    pub pairs: Vec<Pair<Estimate>>,
    /// The pipeline's driver.
    driver: Driver,
    /// Microseconds of computing for each sweep.
    pub sweeps_us: Vec<f64>,
    faults: FaultMeter,
    nis: (f64, f64),
}

/// Simulates a drive of `case` in `world` and measures it.
///
/// # Panics
/// Where not a single sweep came about: a drive of less than about a second.
#[must_use]
pub fn run(case: &Case, world: &World, seed: u64) -> Run {
    let (records, faults) = simulate(case, world, seed);
    let (drive, map) = follow(case, world, &records, faults.clone());
    let (mut estimate, mut odometry) = (AccuracyMeter::default(), AccuracyMeter::default());
    for pair in &drive.pairs {
        estimate.add(pair.estimate.pose, pair.truth);
        odometry.add(pair.estimate.odometry, pair.truth);
    }
    let world_from_map = estimate.world_from_map().unwrap_or_default();
    let true_frame = match (case.method, drive.pairs.first()) {
        (Method::Walls, Some(first)) => building_frame(first),
        _ => world_from_map,
    };
    let accuracy = |meter: &AccuracyMeter| meter.accuracy().expect("a drive has estimates");
    Run {
        seed,
        accuracy: accuracy(&estimate),
        last_m: estimate.last_m(),
        odometry_ate_m: accuracy(&odometry).ate_m,
        path_m: drive.pairs.windows(2).map(|pair| step_m(pair[0].truth, pair[1].truth)).sum(),
        detection: drive.faults.detection().clone(),
        earliest_s: drive
            .pipeline()
            .ring()
            .map_or_else(Vec::new, |ring| earliest_s(case, world, &records, ring, &faults)),
        map: map.score(&drive.pipeline().raster(), true_frame),
        nis: drive.nis.0 / drive.nis.1,
        nees: mean_nees(&drive.pairs, true_frame).unwrap_or(f64::NAN),
        sweeps_us: drive.sweeps_us,
    }
}

/// All that passes between host and board in a drive, with the truth, and the sensors that truly fail.
#[must_use]
pub fn simulate(case: &Case, world: &World, seed: u64) -> (Vec<Record>, Vec<TrueFault>) {
    let simulation = Simulation::new(SimConfig {
        world: world.clone(),
        seed,
        duration_s: case.seconds,
        mix: case.mix,
        faults: Vec::new(),
        beam: case.beam,
        sensors: case.sensors,
        odometry_errors: case.odometry_errors,
        clock_drift_ppm: 300.0,
        link: LinkFaults::default(),
    });
    let faults = simulation.faults().iter().map(true_fault).collect();
    (session(simulation).collect(), faults)
}

fn true_fault(fault: &SensorFault) -> TrueFault {
    let after = |seconds| Timestamp::default() + Duration::from_secs_f64(seconds);
    TrueFault {
        sensor: usize::from(fault.sensor),
        kind: fault.kind,
        from: after(fault.from_s),
        until: fault.until_s.is_finite().then(|| after(fault.until_s)),
    }
}

/// Runs the method over a drive; the map's meter has seen all that the robot could see.
#[must_use]
pub fn follow(case: &Case, world: &World, records: &[Record], faults: Vec<TrueFault>) -> (Drive, MapMeter) {
    let mut drive = Drive {
        pairs: Vec::new(),
        driver: Driver::new(
            slamd_paper::pipeline(&Config { method: case.method, ..Config::default() }, Start::Fresh)
                .expect("a fresh start has no saved state that could be refused"),
        ),
        faults: FaultMeter::new(usize::from(case.sensors), faults),
        nis: (0.0, 0.0),
        sweeps_us: Vec::new(),
    };
    let walls = world.outlines().iter().map(|segment| [segment.from, segment.to]).collect();
    let mut map = MapMeter::new(walls, MAX_RANGE_M);
    let mut pairing = Pairing::default();
    let mut rest = records;
    while !rest.is_empty() {
        rest = drive.next_sweep(rest, &mut map, &mut pairing);
    }
    (drive, map)
}

impl Drive {
    /// The pipeline at the end.
    #[must_use]
    pub const fn pipeline(&self) -> &Pipeline {
        self.driver.pipeline()
    }

    /// Handles records until a sweep has been used; the records left.
    fn next_sweep<'a>(
        &mut self,
        records: &'a [Record],
        map: &mut MapMeter,
        pairing: &mut Pairing<Estimate>,
    ) -> &'a [Record] {
        let (mut events, mut used, mut sweeps) = (Vec::new(), 0, 0u32);
        let begin_us = computed_us();
        while let (0, Some(record)) = (sweeps, records.get(used)) {
            used += 1;
            self.driver.feed(record, |_, update| {
                if let Update::Event(event) = update {
                    sweeps += u32::from(matches!(event, Event::Estimate(_)));
                    events.push(event.clone());
                }
            });
        }
        if sweeps > 0 {
            self.sweeps_us.push(computed_us() - begin_us);
        }
        let (done, rest) = records.split_at(used);
        for record in done {
            if let Record::Truth { at, pose } = record {
                map.truth(*pose);
                pairing.truth(*at, *pose);
                self.pairs.extend(std::iter::from_fn(|| pairing.next_pair()));
            }
        }
        let now = done.last().map_or_else(Timestamp::default, Record::at);
        self.count(&events, now, pairing);
        rest
    }

    fn count(&mut self, events: &[Event], now: Timestamp, pairing: &mut Pairing<Estimate>) {
        for event in events {
            match event {
                Event::Estimate(estimate) => {
                    self.faults.estimate(estimate.at, now);
                    pairing.estimate(estimate.at, *estimate);
                }
                Event::Fault(fault) => self.faults.state(fault.at, fault.sensor, fault.state),
                _ => {}
            }
        }
        self.pairs.extend(std::iter::from_fn(|| pairing.next_pair()));
        let nis = self.pipeline().nis();
        if nis.is_finite() && !events.is_empty() {
            self.nis = (self.nis.0 + nis, self.nis.1 + 1.0);
        }
    }
}

fn step_m(from: Pose2, to: Pose2) -> f64 {
    (to.position() - from.position()).norm()
}

/// Microseconds that this thread has computed: what else the machine does is not counted.
fn computed_us() -> f64 {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    time.tv_sec as f64 * 1e6 + time.tv_nsec as f64 * 1e-3
}
