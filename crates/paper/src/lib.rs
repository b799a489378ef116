//! The paper's method, literal: PCA fault detection, Hough heading, EKF position, 1 cm binary grid.
//!
//! [`Paper::update`] is the whole method in order. The map frame is the robot's first pose. For the first
//! [`Params::first_map_sweeps`] the pose is the encoders': nine sweeps until the first verdict on the sensors, and nine more whose reliable
//! endpoints become the first map; from then on the heading comes from walls alone. What the paper leaves open is said where it is filled
//! in: the measurement model in `ekf`, free space in
//! `binary_grid`, two more faults in `detector`.

pub mod binary_grid;
pub mod detector;
pub mod ekf;
pub mod heading;
pub mod hough;
pub mod params;

use crate::binary_grid::BinaryGrid;
use crate::detector::PaperDetector;
use crate::ekf::PaperEkf;
use crate::heading::Heading;
use crate::params::Params;
use nalgebra::Matrix3;
use nalgebra::Vector2;
use slamd_core::{
    Config, Estimate, Estimator, Event, InvalidState, MapChange, Method, Pipeline, Point, Pose2, Raster, Ring, Segment,
    SensorState, Start, Sweep, Verdict, built_in, stages,
};

/// Both methods: this one where the configuration asks for it, else those of the core. `params` are the constants of the core's; this one has
/// [`Params`] of its own.
///
/// # Errors
/// Where the saved state is invalid, or the configured method cannot use it.
pub fn methods(
    config: &Config,
    ring: &Ring,
    start: &Start,
    params: &stages::Params,
) -> Result<Box<dyn Estimator>, InvalidState> {
    match (config.method, start) {
        (Method::Paper, Start::Fresh) => Ok(Box::new(Paper::new(config, ring))),
        (Method::Paper, _) => Err(InvalidState("the paper's method cannot begin with a known map")),
        _ => built_in(config, ring, start, params),
    }
}

/// A pipeline that knows both methods.
///
/// # Errors
/// As [`methods`].
pub fn pipeline(config: &Config, start: Start) -> Result<Pipeline, InvalidState> {
    Pipeline::with_methods(config, start, methods)
}

/// The method's state.
#[derive(Clone, Debug)]
pub struct Paper {
    params: Params,
    max_speed_m_s: f64,
    max_turn_rate_rad_s: f64,
    /// alpha: from the robot's middle to the farthest endpoint, metres.
    reach_m: f64,
    detector: PaperDetector,
    heading: Heading,
    ekf: PaperEkf,
    grid: BinaryGrid,
    sweeps: u64,
    odometry: Option<Pose2>,
    /// Sensors of the reliable beams, and their endpoints, robot frame.
    sensors: Vec<Point>,
    endpoints: Vec<Point>,
    local_map: Vec<Point>,
}

impl Paper {
    /// The method for a ring of sensors; the robot stands at the origin of the map frame.
    #[must_use]
    pub fn new(config: &Config, ring: &Ring) -> Self {
        Self::with_params(config, ring, Params::default())
    }

    /// The same with other constants.
    #[must_use]
    pub fn with_params(config: &Config, ring: &Ring, params: Params) -> Self {
        let off_centre_m = |m: &slamd_core::Mounting| m.robot_from_sensor.position().coords.norm();
        let reach_m = config.ring.max_range_m + ring.mountings.iter().map(off_centre_m).fold(0.0, f64::max);
        Self {
            params,
            max_speed_m_s: config.robot.max_speed_m_s,
            max_turn_rate_rad_s: config.robot.max_turn_rate_rad_s,
            reach_m,
            detector: PaperDetector::new(ring.len(), config.ring.max_range_m, params),
            heading: Heading::new(reach_m + config.robot.max_speed_m_s * params.longest_step_s, params),
            ekf: PaperEkf::new(Point::origin(), params),
            grid: BinaryGrid::default(),
            sweeps: 0,
            odometry: None,
            sensors: Vec::new(),
            endpoints: Vec::new(),
            local_map: Vec::new(),
        }
    }
}

impl Estimator for Paper {
    fn update(&mut self, sweep: &Sweep, events: &mut Vec<Event>) {
        self.detector.inspect(sweep, events); // (1)-(4)
        self.keep_reliable(sweep);
        let step = self.odometry.map_or_else(Pose2::default, |before| before.inverse() * sweep.odometry);
        let elapsed_s = sweep.elapsed_s.clamp(0.0, self.params.longest_step_s);

        self.ekf.predict(self.heading.theta_rad(), step.position().coords);
        if self.sweeps < self.params.first_map_sweeps() {
            self.heading.set(self.heading.theta_rad() + step.theta_rad);
        } else {
            let about = self.ekf.position();
            self.local_map.clear();
            self.grid.local_map(about, self.max_speed_m_s * elapsed_s + self.reach_m, &mut self.local_map); // (10)
            self.heading.update(&self.local_map, &self.endpoints, self.max_turn_rate_rad_s * elapsed_s); // (7)-(9)
            self.correct_position(about);
        }
        if self.sweeps >= self.params.first_verdict_sweeps {
            for (sensor, endpoint) in self.sensors.iter().zip(&self.endpoints) {
                self.grid.mark(self.pose(), *sensor, *endpoint); // (5)(6)
            }
        }
        self.sweeps += 1;
        self.odometry = Some(sweep.odometry);
        events.push(Event::Estimate(self.estimate(sweep)));
    }

    fn raster(&self) -> Raster {
        self.grid.raster()
    }

    fn map_since(&self, revision: u64) -> Option<(MapChange, u64)> {
        // The map grows with every sweep.
        (self.sweeps >= revision).then(|| (MapChange::Whole(self.raster()), self.sweeps))
    }

    fn states(&self) -> &[SensorState] {
        self.detector.states()
    }

    fn verdict(&self, sensor: usize) -> Verdict {
        match self.detector.states().get(sensor) {
            Some(SensorState::Healthy) => Verdict::Used,
            Some(SensorState::Faulty(_)) => Verdict::Ignored,
            None => Verdict::Silent,
        }
    }

    fn fault_evidence(&self, sensor: usize) -> (f64, f64) {
        (f64::NAN, self.detector.residual_m(sensor))
    }

    fn segments(&self) -> Vec<Segment> {
        let about = self.ekf.position();
        let lines = self.heading.map_lines().iter().map(|line| {
            let normal = line.normal();
            let along = Vector2::new(-normal.y, normal.x);
            let half_m = (self.reach_m * self.reach_m - line.rho_m * line.rho_m).max(0.0).sqrt();
            let foot: Point = about + line.rho_m * normal;
            Segment { from: foot - half_m * along, to: foot + half_m * along, sigma_m: 0.0 }
        });
        lines.collect()
    }
}

impl Paper {
    fn pose(&self) -> Pose2 {
        let position = self.ekf.position();
        Pose2::new(position.x, position.y, self.heading.theta_rad())
    }

    /// The endpoints of healthy sensors that measured a distance.
    fn keep_reliable(&mut self, sweep: &Sweep) {
        self.sensors.clear();
        self.endpoints.clear();
        for (beam, state) in sweep.beams.iter().zip(self.detector.states()) {
            if let (SensorState::Healthy, Some(endpoint)) = (state, beam.endpoint()) {
                self.sensors.push(beam.robot_from_sensor.position());
                self.endpoints.push(endpoint);
            }
        }
    }

    /// The local map's lines, which are relative to `about`, correct x and y.
    fn correct_position(&mut self, about: Point) {
        let heading_rad = self.heading.theta_rad();
        for line in self.heading.map_lines() {
            let rho_m = line.rho_m + line.normal().dot(&about.coords);
            self.ekf.update(heading_rad, &self.endpoints, line.theta_rad, rho_m);
        }
    }

    fn estimate(&self, sweep: &Sweep) -> Estimate {
        let mut covariance = Matrix3::zeros();
        covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&self.ekf.covariance());
        covariance[(2, 2)] = self.heading.variance_rad2();
        Estimate {
            at: sweep.at,
            sweep: sweep.index,
            pose: self.pose(),
            covariance,
            odometry: sweep.odometry,
            nis: f64::NAN,
        }
    }
}
