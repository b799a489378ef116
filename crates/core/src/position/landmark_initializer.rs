//! Where walls are born: returns that no known wall explains gather here until they agree on one.
//!
//! A candidate collects sightings of one side whose offsets lie close together. It becomes a wall once enough of them, from
//! enough sweeps and from places far enough apart along the wall, scatter little: a corner, a chair leg or a slanted
//! surface does not keep one offset while the robot moves.

use super::beam_model::{Side, WallObservation};

/// A wall in the making.
#[derive(Clone, Copy, Debug)]
pub struct Candidate {
    /// The side it is seen from.
    pub side: Side,
    /// Mean offset, metres.
    pub offset_m: f64,
    /// Sum of squared differences from the mean.
    scatter_m2: f64,
    /// Where along the wall it has been seen.
    pub lo_m: f64,
    /// The other end.
    pub hi_m: f64,
    hits: u32,
    sweeps: u32,
    last_sweep: u64,
    sensor_lo_m: f64,
    sensor_hi_m: f64,
}

/// The candidates.
#[derive(Clone, Debug)]
pub struct LandmarkInitializer {
    candidates: Vec<Candidate>,
}

impl Default for LandmarkInitializer {
    fn default() -> Self {
        Self { candidates: Vec::with_capacity(CAPACITY) }
    }
}

const CAPACITY: usize = 64;
/// A observation belongs to a candidate this near in offset and along the wall.
const NEAR_M: f64 = 0.06;
const REACH_M: f64 = 0.6;
/// What makes a wall.
const MIN_HITS: u32 = 6;
const MIN_SWEEPS: u32 = 3;
const MIN_EXTENT_M: f64 = 0.25;
const MIN_TRAVEL_M: f64 = 0.06;
const MAX_SCATTER_M: f64 = 0.028;
/// Only sightings nearly within the cone make walls.
const MAX_OBLIQUE_RAD: f64 = 16.0 * std::f64::consts::PI / 180.0;
/// A candidate not seen for this many sweeps is forgotten.
const PATIENCE: u64 = 60;

impl LandmarkInitializer {
    /// Adds a observation that no wall explains; the candidate, once it has become a wall.
    pub fn add(&mut self, observation: &WallObservation, sweep: u64) -> Option<Candidate> {
        if observation.oblique_rad > MAX_OBLIQUE_RAD {
            return None;
        }
        let offset_m = observation.offset_m();
        let sensor_m = observation.sensor_along_m;
        self.candidates.retain(|candidate| candidate.last_sweep + PATIENCE >= sweep);
        let nearest = self
            .candidates
            .iter_mut()
            .enumerate()
            .filter(|(_, c)| c.side == observation.side && c.reaches(observation.along_m))
            .map(|(index, c)| ((c.offset_m - offset_m).abs(), index))
            .filter(|(gap_m, _)| *gap_m < NEAR_M)
            .min_by(|a, b| a.0.total_cmp(&b.0));
        let Some((_, index)) = nearest else {
            if self.candidates.len() == CAPACITY {
                let oldest = self.candidates.iter().enumerate().min_by_key(|(_, c)| c.last_sweep).map_or(0, |(i, _)| i);
                self.candidates.swap_remove(oldest);
            }
            self.candidates.push(Candidate {
                side: observation.side,
                offset_m,
                scatter_m2: 0.0,
                lo_m: observation.along_m,
                hi_m: observation.along_m,
                hits: 1,
                sweeps: 1,
                last_sweep: sweep,
                sensor_lo_m: sensor_m,
                sensor_hi_m: sensor_m,
            });
            return None;
        };
        let candidate = &mut self.candidates[index];
        candidate.extend(offset_m, observation.along_m, sensor_m, sweep);
        candidate.is_wall().then(|| self.candidates.swap_remove(index))
    }

    /// Forgets all candidates.
    pub fn clear(&mut self) {
        self.candidates.clear();
    }
}

impl Candidate {
    fn reaches(&self, along_m: f64) -> bool {
        along_m > self.lo_m - REACH_M && along_m < self.hi_m + REACH_M
    }

    fn extend(&mut self, offset_m: f64, along_m: f64, sensor_m: f64, sweep: u64) {
        self.hits += 1;
        self.sweeps += u32::from(sweep != self.last_sweep);
        self.last_sweep = sweep;
        let before = offset_m - self.offset_m;
        self.offset_m += before / f64::from(self.hits);
        self.scatter_m2 += before * (offset_m - self.offset_m);
        self.lo_m = self.lo_m.min(along_m);
        self.hi_m = self.hi_m.max(along_m);
        self.sensor_lo_m = self.sensor_lo_m.min(sensor_m);
        self.sensor_hi_m = self.sensor_hi_m.max(sensor_m);
    }

    fn is_wall(&self) -> bool {
        self.hits >= MIN_HITS
            && self.sweeps >= MIN_SWEEPS
            && self.hi_m - self.lo_m >= MIN_EXTENT_M
            && self.sensor_hi_m - self.sensor_lo_m >= MIN_TRAVEL_M
            && self.scatter_m2 / f64::from(self.hits) <= MAX_SCATTER_M * MAX_SCATTER_M
    }
}
