//! A drive whose sweeps are made without board and line: the readings' noise, the rate of the sweeps and the wheels' errors are free.

use nalgebra::{Matrix3, Vector3};
use slamd_core::stages::{Params, WallSlam};
use slamd_core::{
    Beam, Config, Driver, Estimate, Event, FaultEvent, LocalizationEvent, ModelEvent, Point, Pose2, Record, Ring,
    Sweep, Timestamp, Update, wrap_angle,
};
use slamd_metrics::{Pair, Pairing, building_frame};
use slamd_sim::explore::{Explorer, PERIOD_S};
use slamd_sim::floor_plan::box_faces;
use slamd_sim::random::{Random, Stream};
use slamd_sim::robot::{Robot, STEP_S, Twist};
use slamd_sim::sonar::{BeamShape, MAX_RANGE_M, MIN_RANGE_M};
use slamd_sim::world::World;
use std::f64::consts::TAU;

/// Where the robot drives.
#[derive(Clone, Debug)]
pub enum Route {
    /// Everywhere, again and again.
    Everywhere,
    /// Straight on along x.
    Straight,
}

/// What is driven.
#[derive(Clone, Debug)]
pub struct PlainDrive {
    pub world: World,
    pub route: Route,
    pub sensors: u8,
    /// Seconds between two sweeps.
    pub sweep_s: f64,
    pub noise_m: f64,
    /// 0: exact wheels, 1: usual ones.
    pub odometry_errors: f64,
    /// A person walks to and fro before the robot.
    pub has_person: bool,
    pub seed: u64,
    pub seconds: f64,
}

/// A sweep's pose as told, its error, and the error of the encoders alone.
#[derive(Clone, Copy, Debug)]
pub struct Told {
    pub at_s: f64,
    pub error_m: f64,
    /// The same with the map's frame turned so that the first pose is right: the error of the motion alone.
    pub moved_m: f64,
    /// Of the encoders alone, from the same first pose on.
    pub wheels_m: f64,
    /// Standard deviation along the direction in which the position is least certain, metres.
    pub sigma_m: f64,
    /// Error of the heading over its standard deviation.
    pub heading_sigmas: f64,
    /// Normalized estimation error squared over its three degrees of freedom.
    pub nees: f64,
    pub is_uncertain: bool,
}

/// What came of it.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    pub sweeps: Vec<Told>,
    pub faults: Vec<FaultEvent>,
    pub locks: Vec<LocalizationEvent>,
    pub models: Vec<ModelEvent>,
}

/// A rectangular room from the origin on.
pub fn room(width_m: f64, depth_m: f64, start: Point) -> World {
    let faces = box_faces(Point::new(0.5 * width_m, 0.5 * depth_m), [width_m, depth_m], 0.0);
    World::new("room", faces.to_vec(), start, Some(0.0))
}

impl PlainDrive {
    /// A drive through a built-in world under usual conditions.
    pub fn through(world: &str, seed: u64, seconds: f64) -> Self {
        Self {
            world: World::named(world).expect("a built-in world"),
            route: Route::Everywhere,
            sensors: 16,
            sweep_s: 0.1,
            noise_m: 0.02,
            odometry_errors: 1.0,
            has_person: false,
            seed,
            seconds,
        }
    }

    /// Drives and estimates.
    pub fn run(&self) -> Outcome {
        self.run_with(&Config::default())
    }

    /// The same with another configuration of noise and wheels.
    pub fn run_with(&self, config: &Config) -> Outcome {
        let half_rad = BeamShape::Cone.half_angle_rad();
        let ring = Ring::circle(self.sensors, 0.15, half_rad, 1);
        let mut slam = WallSlam::with_params(config, &ring, &Params::default());
        let heading_rad = self
            .world
            .start_heading_rad
            .unwrap_or_else(|| TAU * Random::new(self.seed, Stream::Start).uniform(0.0, 1.0));
        let start = Pose2::new(self.world.start.x, self.world.start.y, heading_rad);
        let mut robot = Robot::new(start, self.odometry_errors, Random::new(self.seed, Stream::Robot));
        let mut explorer = Explorer::new(&self.world, Random::new(self.seed, Stream::Explore));
        let mut noise = Random::new(self.seed, Stream::Sonar);
        let (mut command, mut events, mut truths) = (Twist::default(), Vec::new(), Vec::new());
        let (mut ticks, mut odometry, mut outcome) = ([0, 0], Pose2::default(), Outcome::default());
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "some thousand steps")]
        let [steps, per_sweep, per_command] =
            [self.seconds / STEP_S, self.sweep_s / STEP_S, PERIOD_S / STEP_S].map(|steps| steps.round() as u64);
        for step in 0..steps {
            let at_s = STEP_S * step as f64;
            let pose = robot.pose(0.0);
            if step % per_command == 0 {
                command = match self.route {
                    Route::Everywhere => explorer.command(&self.world, pose, at_s),
                    Route::Straight => Twist { forward_m_s: 0.3, turn_rad_s: 0.0 },
                };
            }
            if step % per_sweep == 0 {
                let beam = |sensor: usize| {
                    let robot_from_sensor = ring.mountings[sensor].robot_from_sensor;
                    let from = pose * robot_from_sensor;
                    let wall_m = BeamShape::Cone.distance(&self.world, from).unwrap_or(f64::INFINITY);
                    let person_m = if self.has_person { person_m(pose, from, half_rad, at_s) } else { f64::INFINITY };
                    (robot_from_sensor, wall_m.min(person_m))
                };
                let beams =
                    (0..ring.len()).map(beam).collect::<Vec<_>>().into_iter().map(|(robot_from_sensor, true_m)| {
                        let read_m = (true_m + self.noise_m * noise.normal()).max(MIN_RANGE_M);
                        let range_m = if read_m > MAX_RANGE_M { f64::INFINITY } else { read_m };
                        Beam { range_m, no_measurement: None, age_s: 0.0, robot_from_sensor, half_angle_rad: half_rad }
                    });
                let beams = beams.collect();
                let now = robot.ticks(0.0);
                let per_tick = TAU * config.robot.wheel_radius_m / 1440.0;
                let [left_m, right_m] = [0, 1].map(|wheel| per_tick * f64::from(now[wheel] - ticks[wheel]));
                ticks = now;
                odometry = odometry.rolled(left_m, right_m, config.robot.wheel_base_m);
                let index = step / per_sweep;
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "some minutes")]
                let at = Timestamp::from_us((1e6 * at_s) as u64);
                let sweep = Sweep { index, at, elapsed_s: self.sweep_s, beams, odometry, left_m, right_m };
                truths.push(pose);
                slam.update(&sweep, &mut events);
            }
            robot.step(command);
        }
        let mut pairs = Vec::new();
        for event in events {
            match event {
                Event::Estimate(estimate) => {
                    let (at, truth) = (estimate.at, truths[usize::try_from(estimate.sweep).unwrap()]);
                    pairs.push(Pair { at, estimate, truth });
                }
                other => outcome.tell(other),
            }
        }
        outcome.compare(&pairs);
        outcome
    }
}

/// The distance at which a beam meets the person, metres.
fn person_m(robot: Pose2, from: Pose2, half_rad: f64, at_s: f64) -> f64 {
    let [ahead, aside] = [0.9 + 0.3 * libm::sin(at_s), 0.6 * libm::sin(0.7 * at_s)];
    let person = (robot * Pose2::new(ahead, aside, 0.0)).position();
    let seen = from.inverse().transform(person);
    let (distance_m, bearing_rad) = (seen.coords.norm(), libm::atan2(seen.y, seen.x).abs());
    let width_rad = libm::asin((0.2 / distance_m).min(1.0));
    if bearing_rad < half_rad + width_rad { (distance_m - 0.2).max(0.0) } else { f64::INFINITY }
}

fn greatest_sigma(cov: &Matrix3<f64>) -> f64 {
    let (mean, half) = (0.5 * (cov[(0, 0)] + cov[(1, 1)]), 0.5 * (cov[(0, 0)] - cov[(1, 1)]));
    (mean + libm::hypot(half, cov[(0, 1)])).sqrt()
}

impl Outcome {
    /// What came of a session with true poses.
    pub fn of(config: &Config, records: impl Iterator<Item = Record>) -> Self {
        let mut driver = Driver::new(slamd_paper::pipeline(config, slamd_core::Start::Fresh).unwrap());
        let (mut pairing, mut pairs, mut outcome) = (Pairing::<Estimate>::default(), Vec::new(), Self::default());
        for record in records {
            driver.feed(&record, |_, update| match update {
                Update::Event(Event::Estimate(estimate)) => pairing.estimate(estimate.at, *estimate),
                Update::Event(event) => outcome.tell(event.clone()),
                _ => {}
            });
            if let Record::Truth { at, pose } = record {
                pairing.truth(at, pose);
            }
            pairs.extend(std::iter::from_fn(|| pairing.next_pair()));
        }
        outcome.compare(&pairs);
        outcome
    }

    fn tell(&mut self, event: Event) {
        match event {
            Event::Fault(fault) => self.faults.push(fault),
            Event::Localization(lock) => self.locks.push(lock),
            Event::Model(model) => self.models.push(model),
            _ => {}
        }
    }

    fn compare(&mut self, pairs: &[Pair<Estimate>]) {
        let Some(first) = pairs.first() else { return };
        let map = building_frame(first);
        let (from_first, from_odom) =
            (first.truth * first.estimate.pose.inverse(), first.truth * first.estimate.odometry.inverse());
        for Pair { at, estimate, truth } in pairs {
            let off_m = |frame: Pose2, pose: Pose2| ((frame * pose).position() - truth.position()).norm();
            let Estimate { pose, covariance, odometry, .. } = estimate;
            let mine = map.inverse() * *truth;
            let turned_rad = wrap_angle(pose.theta_rad - mine.theta_rad);
            let error = Vector3::new(pose.x_m - mine.x_m, pose.y_m - mine.y_m, turned_rad);
            self.sweeps.push(Told {
                at_s: at.seconds(),
                error_m: off_m(map, *pose),
                moved_m: off_m(from_first, *pose),
                wheels_m: off_m(from_odom, *odometry),
                sigma_m: greatest_sigma(covariance),
                heading_sigmas: turned_rad / covariance[(2, 2)].sqrt(),
                nees: covariance.try_inverse().map_or(f64::NAN, |p| error.dot(&(p * error)) / 3.0),
                is_uncertain: self.is_uncertain(*at),
            });
        }
    }

    /// Whether the events call the pose of that time uncertain.
    fn is_uncertain(&self, at: Timestamp) -> bool {
        let mut until = self.locks.iter().filter(|lock| !lock.is_lost());
        let ended = until.any(|lock| (lock.since..=lock.at).contains(&at));
        let open = self.locks.last().filter(|lock| lock.is_lost());
        ended || open.is_some_and(|lock| at >= lock.since)
    }

    fn rms(&self, of: impl Fn(&Told) -> f64) -> f64 {
        (self.sweeps.iter().map(|told| of(told).powi(2)).sum::<f64>() / self.sweeps.len() as f64).sqrt()
    }

    /// Root mean square error of the position, metres.
    pub fn rms_m(&self) -> f64 {
        self.rms(|told| told.error_m)
    }

    /// The same with the map's frame turned so that the first pose is right.
    pub fn moved_rms_m(&self) -> f64 {
        self.rms(|told| told.moved_m)
    }

    /// The same of the encoders alone.
    pub fn wheels_rms_m(&self) -> f64 {
        self.rms(|told| told.wheels_m)
    }

    /// The greatest error of the position, metres.
    pub fn worst_m(&self) -> f64 {
        self.sweeps.iter().map(|told| told.error_m).fold(0.0, f64::max)
    }

    /// The median of the normalized estimation errors squared.
    pub fn median_nees(&self) -> f64 {
        let mut nees: Vec<f64> = self.sweeps.iter().map(|told| told.nees).filter(|nees| nees.is_finite()).collect();
        nees.sort_by(f64::total_cmp);
        nees.get(nees.len() / 2).copied().unwrap_or(f64::NAN)
    }

    /// Seconds in silent error: a pose farther off than 0.3 m and three of its standard deviations, not called uncertain, for longer
    /// than 5 s at a stretch.
    pub fn silent_s(&self) -> f64 {
        let (mut total_s, mut since_s, mut last_s) = (0.0, None, 0.0);
        let mut end = |since_s: &mut Option<f64>, at_s: f64| {
            if let Some(since) = since_s.take().filter(|since| at_s - since > 5.0) {
                total_s += at_s - since;
            }
        };
        for told in &self.sweeps {
            last_s = told.at_s;
            if told.error_m > 0.3 && told.error_m > 3.0 * told.sigma_m && !told.is_uncertain {
                since_s.get_or_insert(told.at_s);
            } else {
                end(&mut since_s, told.at_s);
            }
        }
        end(&mut since_s, last_s);
        total_s
    }
}
