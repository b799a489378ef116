//! EKF-SLAM with walls as landmarks: data association, then heading, then one update per wall.
//!
//! 1. Association: nearest neighbour within a gate, `nu² / S < gate²`, where S holds a beam's noise and the walls' roughness.
//! 2. Heading: on each wall the misfits z of its beams, regressed on their derivative h by the heading with weights 1/R, give
//!    the slope `sum w (h − h_mean) z / sum w (h − h_mean)²`. All walls are pooled. A plain mean would lose this: left and
//!    right edge of a cone depend on the heading with opposite signs.
//! 3. Position: all beams on one wall are one scalar measurement at the corrected pose.
//!
//! Gate and update are the textbook's (Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and Navigation).

use super::beam_model::{Side, WallObservation, observe_wall};
use super::filter::{Filter, MAX_WALLS, Measurement, ROBOT};
use super::inactive_landmarks::InactiveLandmarks;
use super::innovation_whiteness::{InnovationWhiteness, StatedErrors};
use super::landmark_initializer::LandmarkInitializer;
use super::localization_monitor::LocalizationMonitor;
use super::params::{BeamParams, Params};
use super::range_noise::RangeNoise;
use super::wheel_agreement::WheelAgreement;
use crate::event::Calibration;
use crate::geometry::{Placement, Pose2};
use crate::sweep::Sweep;
use nalgebra::SVector;

/// One wall; its offset is in the filter under the same index.
#[derive(Clone, Copy, Debug)]
pub struct WallLandmark {
    /// The side it is observed from.
    pub side: Side,
    /// The range along the wall where it has been observed, metres: its lower end.
    pub lo_m: f64,
    /// Its upper end.
    pub hi_m: f64,
    /// Sweeps that have observed it.
    pub hits: u32,
    pub(super) last_sweep: u64,
    /// The sweep that initialized it; none where it comes from a saved state.
    pub(super) first_sweep: Option<u64>,
    /// Readings that contradict it, less those that confirm it, since the localization monitor began.
    pub(super) against: i32,
}

/// The data association of a beam.
#[derive(Clone, Copy, Debug)]
pub enum Association {
    /// A known wall.
    Wall(WallObservation),
    /// Something that is no known wall.
    Unexplained,
    /// None: not trusted, or no echo.
    Unused,
}

/// Pose and walls of an orthogonal building.
#[derive(Clone, Debug)]
pub struct EkfSlam {
    /// The filter over pose, wheels and walls.
    pub filter: Filter,
    pub(super) walls: Vec<WallLandmark>,
    pub(super) inactive: InactiveLandmarks,
    /// True where the walls are known and do not change.
    pub(super) is_frozen: bool,
    pub(super) initializer: LandmarkInitializer,
    pub(super) associations: Vec<Association>,
    /// The wall of each beam.
    pub(super) wall_of_beam: Vec<Option<usize>>,
    /// The walls that this sweep observes, each once.
    pub(super) observed: Vec<usize>,
    /// The range that each beam must measure, metres, and the wall that says so.
    pub(super) expected: Vec<Option<(f64, usize)>>,
    pub(super) monitor: LocalizationMonitor,
    pub(super) whiteness: InnovationWhiteness,
    pub(super) stated_errors: StatedErrors,
    pub(super) noise: RangeNoise,
    /// The measurement model with the noise that was learnt.
    pub(super) beam: BeamParams,
    pub(super) agreement: WheelAgreement,
    nis: f64,
    pub(super) params: Params,
}

impl EkfSlam {
    /// A robot at `pose` in the building frame, without walls.
    #[must_use]
    pub fn new(pose: Pose2, heading_sigma_rad: f64, nominal: Calibration) -> Self {
        Self::with_params(&Params::default(), pose, heading_sigma_rad, nominal)
    }

    /// The same with other constants.
    #[must_use]
    pub fn with_params(params: &Params, pose: Pose2, heading_sigma_rad: f64, nominal: Calibration) -> Self {
        Self {
            filter: Filter::with_params(params.filter, pose, heading_sigma_rad, nominal),
            walls: Vec::with_capacity(MAX_WALLS),
            inactive: InactiveLandmarks::new(params.inactive, Vec::new()),
            is_frozen: false,
            initializer: LandmarkInitializer::new(params.initializer, params.noise),
            associations: Vec::new(),
            wall_of_beam: Vec::new(),
            observed: Vec::new(),
            expected: Vec::new(),
            monitor: LocalizationMonitor::new(params.monitor),
            whiteness: InnovationWhiteness::new(params.whiteness),
            stated_errors: StatedErrors::new(params.whiteness),
            noise: RangeNoise::new(params.noise, params.beam.range_sigma_m),
            beam: params.beam,
            agreement: WheelAgreement::new(params.agreement),
            nis: f64::NAN,
            params: *params,
        }
    }

    /// The constants in use.
    #[must_use]
    pub fn params(&self) -> &Params {
        &self.params
    }

    /// The walls in the filter.
    #[must_use]
    pub fn walls(&self) -> &[WallLandmark] {
        &self.walls
    }

    /// The data association of each beam of the last sweep.
    #[must_use]
    pub fn associations(&self) -> &[Association] {
        &self.associations
    }

    /// Normalised innovation squared of the last sweep, per update; NaN where no wall was observed.
    #[must_use]
    pub fn nis(&self) -> f64 {
        self.nis
    }

    /// Predicts the pose from the distances that the configured wheels would have rolled, metres.
    pub fn predict(&mut self, left_m: f64, right_m: f64) {
        self.filter.predict(left_m, right_m);
        self.agreement.roll(&self.filter.nominal, left_m, right_m);
    }

    /// Corrects the pose with the beams that `is_trusted`. Adds walls from the unexplained ones where `may_add_walls`.
    pub fn correct(&mut self, sweep: &Sweep, may_add_walls: bool, is_trusted: impl Fn(usize) -> bool) {
        let predicted = self.filter.pose();
        self.associate_beams(sweep, is_trusted);
        let (mut nis_sum, mut updates) = (0.0, 0.0);
        if let Some(nis) = self.update_heading() {
            nis_sum += nis;
            updates += 1.0;
        }
        for observed in 0..self.observed.len() {
            let index = self.observed[observed];
            if let Some(measurement) = self.fuse(sweep, index) {
                let variance = self.filter.innovation_variance(&measurement);
                nis_sum += measurement.innovation.powi(2) / variance;
                let side = self.walls[index].side;
                self.stated_errors.add(side.axis(), side.sign() * measurement.innovation / variance.sqrt());
                updates += 1.0;
                self.filter.update(&measurement);
                self.walls[index].hits = self.walls[index].hits.saturating_add(1);
                self.walls[index].last_sweep = sweep.index;
            }
        }
        self.nis = nis_sum / updates;
        let pose = self.filter.pose();
        self.noise.correct([pose.x_m - predicted.x_m, pose.y_m - predicted.y_m]);
        self.beam.range_sigma_m = self.noise.sigma_m();
        if !self.is_frozen {
            if may_add_walls && !self.monitor.is_doubtful() {
                self.initialize_landmarks(sweep);
            }
            self.merge(sweep.index);
        }
        if !self.is_frozen {
            let returns = self.associations.iter().fold([0.0, 0.0], |[walls, all], association| match association {
                Association::Wall(_) => [walls + 1.0, all + 1.0],
                Association::Unexplained => [walls, all + 1.0],
                Association::Unused => [walls, all],
            });
            self.compare_with_wheels(sweep.index, predicted, returns);
        }
        self.swap_landmarks();
    }

    /// Data association of all beams.
    fn associate_beams(&mut self, sweep: &Sweep, is_trusted: impl Fn(usize) -> bool) {
        self.associations.clear();
        self.wall_of_beam.clear();
        self.noise.begin(sweep.index, sweep.beams.len());
        let pose = Placement::from(self.filter.pose());
        for (sensor, beam) in sweep.beams.iter().enumerate() {
            let observation = if is_trusted(sensor) { observe_wall(&self.beam, pose, beam) } else { None };
            self.noise.add(sensor, observation.as_ref());
            let wall = observation.and_then(|observation| self.associate(&observation));
            self.wall_of_beam.push(wall);
            if observation.is_some() {
                let is_known = wall.is_some_and(|wall| self.walls[wall].hits >= self.params.slam.well_known_hits);
                let noise_m = self.params.noise.error_sigmas * self.beam.range_sigma_m;
                let is_off = |expected_m: &f64| (beam.range_m - expected_m).abs() > noise_m;
                let expected = self.expected(sensor).filter(|(expected_m, _)| is_off(expected_m));
                let contradicts = self.monitor.add(is_known, expected.map(|(expected_m, _)| expected_m), beam.range_m);
                if let Some(wall) = wall {
                    self.walls[wall].against -= 1;
                } else if let Some((_, wall)) = expected.filter(|_| contradicts) {
                    self.walls[wall].against += 1;
                }
            }
            self.associations.push(match (observation, wall) {
                (Some(observation), Some(_)) => Association::Wall(observation),
                _ if is_trusted(sensor) && beam.has_range() => Association::Unexplained,
                _ => Association::Unused,
            });
        }
        self.observed.clear();
        self.observed.extend(self.wall_of_beam.iter().flatten());
        self.observed.sort_unstable();
        self.observed.dedup();
    }

    /// Floor of the variance of one wall's fused measurement, m².
    fn model_variance(&self) -> f64 {
        let params = &self.params.slam;
        let shared_m = self.params.noise.shared_sigmas * self.beam.range_sigma_m;
        let sigma_m = if self.is_frozen { params.frozen_sigma_m } else { params.model_sigma_m }.max(shared_m);
        sigma_m * sigma_m
    }

    /// Data association: the wall with the least Mahalanobis distance within the gate.
    fn associate(&self, observation: &WallObservation) -> Option<usize> {
        let params = &self.params.slam;
        if !observation.is_sharp && observation.oblique_rad > params.max_oblique_rad {
            return None;
        }
        let mut best: Option<(f64, usize)> = None;
        for (index, wall) in self.walls.iter().enumerate() {
            let (along_m, margin_m) = (observation.along_m, params.margin_m);
            let reaches = along_m > wall.lo_m - margin_m && along_m < wall.hi_m + margin_m;
            if wall.side != observation.side || !reaches {
                continue;
            }
            let measurement = self.measure(observation, index);
            let variance = self.filter.innovation_variance(&measurement) + self.model_variance();
            let distance = measurement.innovation * measurement.innovation / variance;
            if distance < params.gate_sigma * params.gate_sigma && best.is_none_or(|(least, _)| distance < least) {
                best = Some((distance, index));
            }
        }
        best.map(|(_, index)| index)
    }

    pub(super) fn measure(&self, observation: &WallObservation, wall: usize) -> Measurement {
        let sign = observation.side.sign();
        let expected_m = sign * (self.filter.offset_m(wall) - observation.sensor_across_m);
        Measurement {
            innovation: observation.depth_m - expected_m,
            robot: observation.h_robot,
            wall: (wall, sign),
            variance: observation.variance,
        }
    }

    /// All beams on one wall as one measurement at the current pose.
    fn fuse(&mut self, sweep: &Sweep, wall: usize) -> Option<Measurement> {
        let (mut weight, mut innovation, mut edge) = (0.0, 0.0, 0.0);
        let mut robot = SVector::<f64, ROBOT>::zeros();
        let pose = Placement::from(self.filter.pose());
        for sensor in 0..self.wall_of_beam.len() {
            if self.wall_of_beam[sensor] != Some(wall) {
                continue;
            }
            let Some(observation) = observe_wall(&self.beam, pose, &sweep.beams[sensor]) else { continue };
            let measurement = self.measure(&observation, wall);
            weight += 1.0 / measurement.variance;
            innovation += measurement.innovation / measurement.variance;
            edge += observation.edge_m / measurement.variance;
            robot += measurement.robot / measurement.variance;
            if observation.oblique_rad < self.params.slam.max_extension_rad && !self.is_frozen {
                let extent = &mut self.walls[wall];
                extent.lo_m = extent.lo_m.min(observation.along_m);
                extent.hi_m = extent.hi_m.max(observation.along_m);
            }
        }
        (weight > 0.0).then(|| Measurement {
            innovation: innovation / weight,
            robot: robot / weight,
            wall: (wall, self.walls[wall].side.sign()),
            variance: 1.0 / weight + self.model_variance() + self.params.slam.edge_sweeps * (edge / weight).powi(2),
        })
    }

    /// Adds walls from the unexplained beams.
    fn initialize_landmarks(&mut self, sweep: &Sweep) {
        let pose = Placement::from(self.filter.pose());
        for sensor in 0..self.associations.len() {
            if !matches!(self.associations[sensor], Association::Unexplained) {
                continue;
            }
            let Some(observation) = observe_wall(&self.beam, pose, &sweep.beams[sensor]) else { continue };
            let sigma_m = self.beam.range_sigma_m;
            if self.is_stray(&observation) {
                continue;
            }
            let Some(new) = self.initializer.add(&observation, sweep.index, sigma_m) else { continue };
            let h_robot = observation.h_robot * -observation.side.sign();
            let variance = self.params.slam.same_noise_m2() + new.mean_variance(sigma_m, self.params.noise.usual_m);
            if self.filter.add(new.offset_m, &h_robot, variance).is_some() {
                let (lo_m, hi_m, now) = (new.lo_m, new.hi_m, sweep.index);
                let (last_sweep, first_sweep) = (now, Some(now));
                self.walls.push(WallLandmark {
                    side: new.side,
                    lo_m,
                    hi_m,
                    hits: 1,
                    last_sweep,
                    first_sweep,
                    against: 0,
                });
            }
        }
    }

    /// True for a return that fails the gate of a known wall, but only by as much as noisy readings do: several of these together would
    /// be taken for a second wall beside it.
    fn is_stray(&self, observation: &WallObservation) -> bool {
        let noise = &self.params.noise;
        let unusual_m2 = self.beam.range_sigma_m.powi(2) - noise.usual_m.powi(2);
        if unusual_m2 <= 0.0 {
            return false;
        }
        let (stray_m, along_m, margin_m) =
            (noise.stray_sigmas * unusual_m2.sqrt(), observation.along_m, self.params.slam.margin_m);
        self.walls.iter().enumerate().any(|(index, wall)| {
            let reaches = along_m > wall.lo_m - margin_m && along_m < wall.hi_m + margin_m;
            let off_m = (self.filter.offset_m(index) - observation.offset_m()).abs();
            wall.side == observation.side && reaches && off_m < stray_m
        })
    }

    /// Merges two walls that are the same. Only walls that this sweep observed have moved.
    fn merge(&mut self, sweep: u64) {
        for a in 0..self.walls.len() {
            if self.walls[a].last_sweep != sweep {
                continue;
            }
            let other = |&b: &usize| a != b && self.is_same(a, b);
            if let Some((a, b)) = (0..self.walls.len()).find(other).map(|b| (a.min(b), a.max(b))) {
                let (one, other) = (self.walls[a], self.walls[b]);
                self.filter.merge(a, b, self.params.slam.same_noise_m2());
                self.walls[a].lo_m = one.lo_m.min(other.lo_m);
                self.walls[a].hi_m = one.hi_m.max(other.hi_m);
                self.walls[a].hits = one.hits.saturating_add(other.hits);
                self.walls[a].first_sweep = one.first_sweep.min(other.first_sweep);
                self.walls[a].against = one.against.saturating_add(other.against);
                self.walls.swap_remove(b);
                return;
            }
        }
    }

    /// Whether two walls are one.
    fn is_same(&self, a: usize, b: usize) -> bool {
        let params = &self.params.slam;
        let (one, other) = (&self.walls[a], &self.walls[b]);
        if one.side != other.side {
            return false;
        }
        let gap_m = (one.lo_m - other.hi_m).max(other.lo_m - one.hi_m);
        let apart_m = (self.filter.offset_m(a) - self.filter.offset_m(b)).abs();
        gap_m <= params.same_gap_m
            && apart_m <= params.same_wall_m.max(self.params.noise.same_sigmas * self.beam.range_sigma_m)
            && apart_m.powi(2) <= params.same_gate * (self.filter.difference_variance(a, b) + params.same_noise_m2())
    }
}
