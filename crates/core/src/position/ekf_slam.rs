//! Returns → walls → pose: which wall each beam has seen, and what that says of the pose.

use super::beam_model::{Side, WallObservation, observe_wall};
use super::filter::{Filter, MAX_WALLS, Measurement, ROBOT};
use super::inactive_landmarks::InactiveLandmarks;
use super::innovation_whiteness::InnovationWhiteness;
use super::landmark_initializer::LandmarkInitializer;
use super::localization_monitor::LocalizationMonitor;
use crate::event::Calibration;
use crate::geometry::{Placement, Pose2, nearest_quarter};
use crate::sweep::{Beam, Sweep};
use nalgebra::SVector;

/// One wall; its offset is in the filter under the same index.
#[derive(Clone, Copy, Debug)]
pub struct WallLandmark {
    /// The side it is seen from.
    pub side: Side,
    /// Where along it it has been seen, metres.
    pub lo_m: f64,
    /// The other end.
    pub hi_m: f64,
    /// Sweeps that have seen it.
    pub hits: u32,
    pub(super) last_sweep: u64,
    /// The sweep that it was learnt from; none where an earlier run knew it.
    pub(super) first_sweep: Option<u64>,
}

/// What became of a beam.
#[derive(Clone, Copy, Debug)]
pub enum Association {
    /// It heard this wall.
    Wall(WallObservation),
    /// It heard something else.
    Unexplained,
    /// It was not trusted, or heard nothing.
    Unused,
}

/// Keeps the walls and the pose.
#[derive(Clone, Debug)]
pub struct EkfSlam {
    /// The filter over pose, wheels and walls.
    pub filter: Filter,
    pub(super) walls: Vec<WallLandmark>,
    pub(super) inactive: InactiveLandmarks,
    /// True where the walls are known and none is learnt or changed.
    pub(super) is_frozen: bool,
    pub(super) initializer: LandmarkInitializer,
    pub(super) associations: Vec<Association>,
    matches: Vec<Option<usize>>,
    /// The walls among the matches, each once.
    seen: Vec<usize>,
    expected: Vec<Option<f64>>,
    pub(super) monitor: LocalizationMonitor,
    turns: InnovationWhiteness,
    nis: f64,
}

/// What the walls say of the heading.
struct HeadingObservation {
    innovation_rad: f64,
    variance: f64,
    /// The beams that say it.
    beams: usize,
}

/// Innovations farther out than this many standard deviations belong to something else.
const GATE_SIGMA: f64 = 2.2;
/// A cone hears no wall farther outside its edge than this.
const MAX_OBLIQUE_RAD: f64 = 30.0 * std::f64::consts::PI / 180.0;
/// Walls are not that flat, and sounds not that straight: floor of one wall's fused noise, metres.
const MODEL_SIGMA_M: f64 = 0.008;
/// The same where the walls are those of another drive, which knew them no better.
const FIXED_SIGMA_M: f64 = 0.025;
/// The same for a turn read off the walls, radians, and how far off a reading may be.
const TURN_SIGMA_RAD: f64 = 0.3 * std::f64::consts::PI / 180.0;
const TURN_GATE_SIGMA: f64 = 4.0;
/// A turn that no more beams tell is the error of one of them if they insist on it.
const FEW_BEAMS: usize = 3;
/// What a beam's edge gets wrong it gets wrong for many sweeps: a wall heard only at edges is measured as if by one sweep of so many.
const EDGE_SWEEPS: f64 = 10.0;
/// A wall may be heard this far beyond where it has been seen.
const MARGIN_M: f64 = 0.15;
/// Sweeps that must have seen a wall before anything is expected of it.
pub(super) const WELL_KNOWN: u32 = 15;
/// Two sightings of one side nearer than this, and within the gate, are one wall.
const SAME_WALL_M: f64 = 0.07;
const SAME_GAP_M: f64 = 0.6;
/// Variance of the difference of what one wall's two offsets are, m².
const SAME_NOISE_M2: f64 = 2.0 * MODEL_SIGMA_M * MODEL_SIGMA_M;

impl EkfSlam {
    /// A tracker for a robot at `pose` in the building frame.
    #[must_use]
    pub fn new(pose: Pose2, heading_sigma_rad: f64, nominal: Calibration) -> Self {
        Self {
            filter: Filter::new(pose, heading_sigma_rad, nominal),
            walls: Vec::with_capacity(MAX_WALLS),
            inactive: InactiveLandmarks::default(),
            is_frozen: false,
            initializer: LandmarkInitializer::default(),
            associations: Vec::new(),
            matches: Vec::new(),
            seen: Vec::new(),
            expected: Vec::new(),
            monitor: LocalizationMonitor::default(),
            turns: InnovationWhiteness::default(),
            nis: f64::NAN,
        }
    }

    /// The walls in the filter.
    #[must_use]
    pub fn walls(&self) -> &[WallLandmark] {
        &self.walls
    }

    /// What became of each beam of the last sweep.
    #[must_use]
    pub fn associations(&self) -> &[Association] {
        &self.associations
    }

    /// Normalised innovation squared of the last sweep, per wall seen; NaN where it saw none.
    #[must_use]
    pub fn nis(&self) -> f64 {
        self.nis
    }

    /// Moves the pose with the wheels, which rolled so far as the configured ones would.
    pub fn predict(&mut self, left_m: f64, right_m: f64) {
        self.filter.predict(left_m, right_m);
    }

    /// Works out at which range each beam must hear a wall that is well known and squarely in its cone.
    pub fn predict_ranges(&mut self, sweep: &Sweep) {
        self.expected.clear();
        let place = Placement::from(self.filter.pose());
        for beam in &sweep.beams {
            self.expected.push(self.predict_range(place, beam));
        }
    }

    /// That range, for one sensor of the sweep at hand.
    #[must_use]
    pub fn expected_range_m(&self, sensor: usize) -> Option<f64> {
        self.expected.get(sensor).copied().flatten()
    }

    fn predict_range(&self, place: Placement, beam: &Beam) -> Option<f64> {
        let sensor = place * beam.robot_from_sensor;
        let (quarter, off_rad) = nearest_quarter(sensor.theta_rad);
        if off_rad.abs() > 0.7 * beam.half_angle_rad.max(0.1) {
            return None;
        }
        let side = Side::ALL[quarter];
        let (across_m, along_m) = side.split(sensor.position());
        let mut nearest: Option<f64> = None;
        for (index, wall) in self.walls.iter().enumerate() {
            let faces =
                wall.side == side && wall.hits >= WELL_KNOWN && along_m > wall.lo_m + 0.1 && along_m < wall.hi_m - 0.1;
            let depth_m = side.sign() * (self.filter.offset_m(index) - across_m);
            if faces && depth_m > 0.05 {
                nearest = Some(nearest.map_or(depth_m, |n: f64| n.min(depth_m)));
            }
        }
        nearest
    }

    /// Corrects the pose with the beams that `is_trusted`, and where `may_learn`, learns walls from those that no wall explains.
    pub fn correct(&mut self, sweep: &Sweep, may_learn: bool, is_trusted: impl Fn(usize) -> bool) {
        self.associations.clear();
        self.matches.clear();
        let place = Placement::from(self.filter.pose());
        for (sensor, beam) in sweep.beams.iter().enumerate() {
            let observation = if is_trusted(sensor) { observe_wall(place, beam) } else { None };
            let found = observation.and_then(|observation| self.associate(&observation));
            self.matches.push(found);
            if observation.is_some() {
                let is_known = found.is_some_and(|wall| self.walls[wall].hits >= WELL_KNOWN);
                self.monitor.weigh(is_known, self.expected_range_m(sensor), beam.range_m);
            }
            self.associations.push(match (observation, found) {
                (Some(observation), Some(_)) => Association::Wall(observation),
                _ if is_trusted(sensor) && beam.has_range() => Association::Unexplained,
                _ => Association::Unused,
            });
        }
        self.seen.clear();
        self.seen.extend(self.matches.iter().flatten());
        self.seen.sort_unstable();
        self.seen.dedup();
        let (mut nis_sum, mut seen) = (0.0, 0.0);
        if let Some(turn) = self.observe_heading() {
            let (innovation_rad, heading_variance) = (turn.innovation_rad, self.filter.pose_covariance()[(2, 2)]);
            let factor = self.turns.weigh(innovation_rad / (heading_variance + turn.variance).sqrt());
            let variance = if turn.beams <= FEW_BEAMS { turn.variance * factor } else { turn.variance };
            let distance = innovation_rad.powi(2) / (heading_variance + variance);
            self.filter.learn_slip(distance);
            if distance < TURN_GATE_SIGMA * TURN_GATE_SIGMA {
                nis_sum += distance;
                seen += 1.0;
                self.filter.update_heading(innovation_rad, variance);
            }
        }
        for place in 0..self.seen.len() {
            let index = self.seen[place];
            if let Some(measurement) = self.fuse(sweep, index) {
                nis_sum += measurement.innovation.powi(2) / self.filter.innovation_variance(&measurement);
                seen += 1.0;
                self.filter.update(&measurement);
                self.walls[index].hits = self.walls[index].hits.saturating_add(1);
                self.walls[index].last_sweep = sweep.index;
            }
        }
        self.nis = nis_sum / seen;
        if !self.is_frozen {
            if may_learn && !self.monitor.is_doubtful() {
                self.learn(sweep);
            }
            self.merge(sweep.index);
        }
        self.swap_landmarks();
    }

    /// Variance of a wall's fused noise.
    fn model_variance(&self) -> f64 {
        let sigma_m = if self.is_frozen { FIXED_SIGMA_M } else { MODEL_SIGMA_M };
        sigma_m * sigma_m
    }

    /// The wall that explains a observation best, within the gate.
    fn associate(&self, observation: &WallObservation) -> Option<usize> {
        if !observation.is_sharp && observation.oblique_rad > MAX_OBLIQUE_RAD {
            return None;
        }
        let mut best: Option<(f64, usize)> = None;
        for (index, wall) in self.walls.iter().enumerate() {
            let reaches = observation.along_m > wall.lo_m - MARGIN_M && observation.along_m < wall.hi_m + MARGIN_M;
            if wall.side != observation.side || !reaches {
                continue;
            }
            let measurement = self.measure(observation, index);
            let variance = self.filter.innovation_variance(&measurement) + self.model_variance();
            let distance = measurement.innovation * measurement.innovation / variance;
            if distance < GATE_SIGMA * GATE_SIGMA && best.is_none_or(|(least, _)| distance < least) {
                best = Some((distance, index));
            }
        }
        best.map(|(_, index)| index)
    }

    fn measure(&self, observation: &WallObservation, wall: usize) -> Measurement {
        let sign = observation.side.sign();
        let expected_m = sign * (self.filter.offset_m(wall) - observation.across_m);
        Measurement {
            innovation: observation.depth_m - expected_m,
            robot: observation.h_robot,
            wall: (wall, sign),
            variance: observation.variance,
        }
    }

    /// What the beams say of the heading: on each wall, how their misfits grow with how they feel a turn.
    fn observe_heading(&self) -> Option<HeadingObservation> {
        let (mut information, mut sum, mut beams) = (0.0, 0.0, 0);
        for &wall in &self.seen {
            let (mut w, mut wh, mut whh, mut wz, mut whz, mut count) = (0.0, 0.0, 0.0, 0.0, 0.0, 0);
            for (used, found) in self.associations.iter().zip(&self.matches) {
                let (Association::Wall(observation), true) = (used, *found == Some(wall)) else { continue };
                let m = self.measure(observation, wall);
                let (weight, h) = (1.0 / m.variance, m.robot[2]);
                w += weight;
                wh += weight * h;
                whh += weight * h * h;
                wz += weight * m.innovation;
                whz += weight * h * m.innovation;
                count += 1;
            }
            // One beam says nothing of a turn.
            if count > 1 {
                beams += count;
                information += whh - wh * wh / w;
                sum += whz - wh * wz / w;
            }
        }
        let variance = 1.0 / information + TURN_SIGMA_RAD * TURN_SIGMA_RAD;
        (information > 1.0).then(|| HeadingObservation { innovation_rad: sum / information, variance, beams })
    }

    /// All beams on one wall as one measurement at the pose as it is now.
    fn fuse(&mut self, sweep: &Sweep, wall: usize) -> Option<Measurement> {
        let (mut weight, mut innovation, mut edge) = (0.0, 0.0, 0.0);
        let mut robot = SVector::<f64, ROBOT>::zeros();
        let place = Placement::from(self.filter.pose());
        for sensor in 0..self.matches.len() {
            if self.matches[sensor] != Some(wall) {
                continue;
            }
            let Some(observation) = observe_wall(place, &sweep.beams[sensor]) else { continue };
            let measurement = self.measure(&observation, wall);
            weight += 1.0 / measurement.variance;
            innovation += measurement.innovation / measurement.variance;
            edge += observation.edge_m / measurement.variance;
            robot += measurement.robot / measurement.variance;
            if observation.oblique_rad < 0.1 && !self.is_frozen {
                let extent = &mut self.walls[wall];
                extent.lo_m = extent.lo_m.min(observation.along_m);
                extent.hi_m = extent.hi_m.max(observation.along_m);
            }
        }
        (weight > 0.0).then(|| Measurement {
            innovation: innovation / weight,
            robot: robot / weight,
            wall: (wall, self.walls[wall].side.sign()),
            variance: 1.0 / weight + self.model_variance() + EDGE_SWEEPS * (edge / weight).powi(2),
        })
    }

    /// Gathers what no wall explains, until it is a wall.
    fn learn(&mut self, sweep: &Sweep) {
        let place = Placement::from(self.filter.pose());
        for sensor in 0..self.associations.len() {
            if !matches!(self.associations[sensor], Association::Unexplained) {
                continue;
            }
            let Some(observation) = observe_wall(place, &sweep.beams[sensor]) else { continue };
            let Some(new) = self.initializer.add(&observation, sweep.index) else { continue };
            let h_robot = observation.h_robot * -observation.side.sign();
            if self.filter.add(new.offset_m, &h_robot, SAME_NOISE_M2).is_some() {
                let (lo_m, hi_m, now) = (new.lo_m, new.hi_m, sweep.index);
                let wall =
                    WallLandmark { side: new.side, lo_m, hi_m, hits: 1, last_sweep: now, first_sweep: Some(now) };
                self.walls.push(wall);
            }
        }
    }

    /// Makes one wall of two that are the same; only what this sweep has seen has moved.
    fn merge(&mut self, sweep: u64) {
        for a in 0..self.walls.len() {
            if self.walls[a].last_sweep != sweep {
                continue;
            }
            let other = |&b: &usize| a != b && self.is_same(a, b);
            if let Some((a, b)) = (0..self.walls.len()).find(other).map(|b| (a.min(b), a.max(b))) {
                let (one, other) = (self.walls[a], self.walls[b]);
                self.filter.merge(a, b, SAME_NOISE_M2);
                self.walls[a].lo_m = one.lo_m.min(other.lo_m);
                self.walls[a].hi_m = one.hi_m.max(other.hi_m);
                self.walls[a].hits = one.hits.saturating_add(other.hits);
                self.walls[a].first_sweep = one.first_sweep.min(other.first_sweep);
                self.walls.swap_remove(b);
                return;
            }
        }
    }

    /// Whether two walls are one.
    fn is_same(&self, a: usize, b: usize) -> bool {
        let (one, other) = (&self.walls[a], &self.walls[b]);
        if one.side != other.side {
            return false;
        }
        let gap_m = (one.lo_m - other.hi_m).max(other.lo_m - one.hi_m);
        let apart_m = (self.filter.offset_m(a) - self.filter.offset_m(b)).abs();
        gap_m <= SAME_GAP_M
            && apart_m <= SAME_WALL_M
            && apart_m.powi(2) <= 9.0 * (self.filter.difference_variance(a, b) + SAME_NOISE_M2)
    }
}
