//! Landmark initialization: returns that no known wall explains are clustered until a cluster is a wall.
//!
//! A candidate collects observations of one side whose offsets lie close together. It becomes a wall once it has enough of them,
//! from enough sweeps and from sensor positions far enough apart along the wall, and they scatter little. A corner, a chair leg or a
//! slanted surface does not keep one offset while the robot moves. Mean and scatter are Welford's (Technometrics 4, 1962):
//! `mean += (x − mean) / n`, `S += (x − mean_before)(x − mean)`.

use super::beam_model::{Side, WallObservation};
use super::params::{InitializerParams, NoiseParams};

/// A cluster that may become a wall.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate {
    /// The side it is observed from.
    pub side: Side,
    /// Mean offset, metres.
    pub offset_m: f64,
    /// Sum of squared differences from the mean.
    scatter_m2: f64,
    /// The range along the wall where it has been observed, metres: its lower end.
    pub lo_m: f64,
    /// Its upper end.
    pub hi_m: f64,
    hits: u32,
    sweeps: u32,
    last_sweep: u64,
    sensor_lo_m: f64,
    sensor_hi_m: f64,
}

/// The candidates.
#[derive(Clone, Debug)]
pub(crate) struct LandmarkInitializer {
    candidates: Vec<Candidate>,
    params: InitializerParams,
    noise: NoiseParams,
}

/// Candidates held at most; the oldest gives way.
const MAX_CANDIDATES: usize = 64;

impl LandmarkInitializer {
    /// No candidates yet.
    #[must_use]
    pub(crate) fn new(params: InitializerParams, noise: NoiseParams) -> Self {
        Self { candidates: Vec::with_capacity(MAX_CANDIDATES), params, noise }
    }

    /// Adds an observation that no wall explains, of a reading with the standard deviation `sigma_m`. Returns the candidate once it
    /// is a wall.
    pub(crate) fn add(&mut self, observation: &WallObservation, sweep: u64, sigma_m: f64) -> Option<Candidate> {
        let (params, noise) = (&self.params, &self.noise);
        let near_m = params.near_m.max(noise.near_sigmas * sigma_m);
        let max_scatter_m = params.max_scatter_m.max(noise.scatter_sigmas * sigma_m);
        if observation.oblique_rad > params.max_oblique_rad {
            return None;
        }
        let offset_m = observation.offset_m();
        let sensor_m = observation.sensor_along_m;
        self.candidates.retain(|candidate| candidate.last_sweep + params.max_idle_sweeps >= sweep);
        let nearest = self
            .candidates
            .iter_mut()
            .enumerate()
            .filter(|(_, c)| c.side == observation.side && c.reaches(observation.along_m, params.reach_m))
            .map(|(index, c)| ((c.offset_m - offset_m).abs(), index))
            .filter(|(gap_m, _)| *gap_m < near_m)
            .min_by(|a, b| a.0.total_cmp(&b.0));
        let Some((_, index)) = nearest else {
            if self.candidates.len() == MAX_CANDIDATES {
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
        candidate.is_wall(params, max_scatter_m).then(|| self.candidates.swap_remove(index))
    }

    /// Forgets all candidates.
    pub(crate) fn clear(&mut self) {
        self.candidates.clear();
    }
}

impl Candidate {
    /// How much less sure the mean offset is than that of usual readings, m², for readings with the standard deviation `sigma_m`.
    pub(crate) fn mean_variance(&self, sigma_m: f64, usual_m: f64) -> f64 {
        (sigma_m * sigma_m - usual_m * usual_m).max(0.0) / f64::from(self.hits)
    }

    fn reaches(&self, along_m: f64, reach_m: f64) -> bool {
        along_m > self.lo_m - reach_m && along_m < self.hi_m + reach_m
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

    fn is_wall(&self, params: &InitializerParams, max_scatter_m: f64) -> bool {
        self.hits >= params.min_hits
            && self.sweeps >= params.min_sweeps
            && self.hi_m - self.lo_m >= params.min_extent_m
            && self.sensor_hi_m - self.sensor_lo_m >= params.min_travel_m
            && self.scatter_m2 / f64::from(self.hits) <= max_scatter_m * max_scatter_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pose2;
    use crate::position::beam_model::observe_wall;
    use crate::position::params::BeamParams;
    use crate::sweep::Beam;

    /// Drives along y at 5 cm a sweep; each sweep's beam toward +x measures `range_m` of the position along y.
    fn drive(range_m: impl Fn(f64) -> f64) -> Option<Candidate> {
        let mut initializer = LandmarkInitializer::new(InitializerParams::default(), NoiseParams::default());
        (0u32..20).find_map(|sweep| {
            let y_m = 0.05 * f64::from(sweep);
            let beam = Beam {
                range_m: range_m(y_m),
                no_measurement: None,
                age_s: 0.0,
                robot_from_sensor: Pose2::default(),
                half_angle_rad: 0.2,
            };
            let observation = observe_wall(&BeamParams::default(), Pose2::new(0.0, y_m, 0.0), &beam)?;
            initializer.add(&observation, u64::from(sweep), 0.02)
        })
    }

    #[test]
    fn a_wall_keeps_its_offset_and_becomes_a_landmark() {
        let wall = drive(|_| 1.5).unwrap();
        assert!((wall.offset_m - 1.5).abs() < 1e-12 && wall.lo_m.abs() < 1e-12, "{wall:?}");
        assert!(wall.hi_m >= InitializerParams::default().min_extent_m, "{wall:?}");
    }

    #[test]
    fn a_slanted_surface_becomes_none() {
        assert!(drive(|y_m| 1.5 + 0.6 * y_m).is_none());
    }
}
