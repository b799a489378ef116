//! The noise of a reading, learnt from what a sensor measures of the same wall in two sweeps in a row.
//!
//! The wheels tell how far the sensor has moved from one sweep to the next, and over so short a way they are right. So the offsets
//! z of the wall by the two readings differ by noise alone: `d = z_k − z_(k−1)` has the variance `2 sigma²`, whatever the pose is.
//! Where the two readings are of different surfaces, |d| is large; a quantile q of |d| is robust against these. It is followed
//! by stochastic approximation (Robbins and Monro, Annals of Mathematical Statistics 22, 1951): `ln s += g (1[|d| > s] − (1 − q))`.

use super::beam_model::WallObservation;

/// Constants of `range_noise`, and how the noise of a reading widens what was chosen for the simulator's 0.02 m.
///
/// | name | value | unit | how chosen | what breaks when it is wrong |
/// |---|---|---|---|---|
/// | `quantile` | 0.4 | - | by hand: below the median, so that four of ten readings may be of another surface than the one before | too small: few readings decide; too large: clutter looks like noise |
/// | `quantile_sigmas` | 0.5244 | sigma | the normal distribution: four tenths of it lie within | the noise is off by its ratio |
/// | `gain` | 0.01 | - | by hand: some hundred differences of memory | too small: another floor or sensor is learnt late; too large: the noise wanders |
/// | `first_gain` | 0.3 | - | by hand: falls with the root of the differences, so that the first hundred find a noise of twice or half the prior | too small: the first walls fail the gate; too large: the first clutter decides |
/// | `min_m` | 0.005 | m | by hand: no sonar is better | too small: a robot at rest learns that its readings are exact |
/// | `max_m` | 0.15 | m | by hand: what scatters more measures no wall | too large: everything fits every wall |
/// | `max_oblique_rad` | 0.1 | rad | as `max_extension_rad`: a cone's edge is not sharp | too large: edge errors look like noise |
/// | `clear_ratio` | 1.5 | - | by hand: clutter makes the simulator's readings look up to so much noisier | too small: the walls' weight falls in clutter; too large: noise is noticed late |
/// | `far_ratio` | 2.0 | - | by hand | too small: clutter is told as noise; too large: a wrong key is never told |
/// | `min_differences` | 100 | - | by hand | too small: the first clutter is told as noise |
/// | `near_sigmas` | 3.0 | sigma | as the initializer's `near_m` at 0.02 m | as `near_m` |
/// | `scatter_sigmas` | 1.4 | sigma | as `max_scatter_m` at 0.02 m | as `max_scatter_m` |
/// | `same_sigmas` | 1.5 | sigma | by hand, below `same_wall_m` up to 0.046 m | as `same_wall_m` |
/// | `error_sigmas` | 3.5 | sigma | by hand, below the monitor's `max_error_m` up to 0.042 m | as `max_error_m` |
/// | `stray_sigmas` | 4.0 | sigma | by hand: one reading in 16 000 is farther off | too small: noisy walls double; too large: steps in walls are missed |
/// | `shared_sigmas` | 0.4 | sigma | as `model_sigma_m` at 0.02 m | too small: many noisy beams on one wall are taken for sure, NEES above 20 at 0.05 m; too large: the pose follows the wheels |
/// | `shape_sigmas` | 2.0 | sigma | median NEES of random homes, seeds 1-12: 2.3 with 0.6, 0.7 with 2; of the flat 1.0 with 0.6 | too small: walls that are not straight make the stated position too sure; too large: it says less than is known |
/// | `usual_m` | 0.02 | m | the noise of the simulator's sensors, for which the other constants were chosen | a new wall's offset is taken for too sure or too unsure |
#[expect(missing_docs, reason = "the table describes each field")]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseParams {
    pub quantile: f64,
    pub quantile_sigmas: f64,
    pub gain: f64,
    pub first_gain: f64,
    pub min_m: f64,
    pub max_m: f64,
    pub max_oblique_rad: f64,
    pub clear_ratio: f64,
    pub far_ratio: f64,
    pub min_differences: u32,
    pub near_sigmas: f64,
    pub scatter_sigmas: f64,
    pub same_sigmas: f64,
    pub error_sigmas: f64,
    pub stray_sigmas: f64,
    pub shared_sigmas: f64,
    pub shape_sigmas: f64,
    pub usual_m: f64,
}

impl Default for NoiseParams {
    fn default() -> Self {
        Self {
            quantile: 0.4,
            quantile_sigmas: 0.5244,
            gain: 0.01,
            first_gain: 0.3,
            min_m: 0.005,
            max_m: 0.15,
            max_oblique_rad: 0.1,
            clear_ratio: 1.5,
            far_ratio: 2.0,
            min_differences: 100,
            near_sigmas: 3.0,
            scatter_sigmas: 1.4,
            same_sigmas: 1.5,
            error_sigmas: 3.5,
            stray_sigmas: 4.0,
            shared_sigmas: 0.4,
            shape_sigmas: 2.0,
            usual_m: 0.02,
        }
    }
}

/// Learns the noise of the readings.
#[derive(Clone, Debug)]
pub(super) struct RangeNoise {
    prior_m: f64,
    learnt_m: f64,
    differences: u32,
    /// By sensor: side and offset of the wall that it measured last.
    last: Vec<Option<(u8, f64)>>,
    last_sweep: u64,
    params: NoiseParams,
}

impl RangeNoise {
    /// Nothing is learnt yet: the noise is `prior_m`, metres.
    pub(super) fn new(params: NoiseParams, prior_m: f64) -> Self {
        Self { prior_m, learnt_m: prior_m, differences: 0, last: Vec::new(), last_sweep: 0, params }
    }

    /// The standard deviation of a reading, metres: the prior, or more where the readings show clearly more.
    pub(super) fn sigma_m(&self) -> f64 {
        let clear_m = self.params.clear_ratio * self.prior_m;
        (self.prior_m.powi(2) + (self.learnt_m.powi(2) - clear_m.powi(2)).max(0.0)).sqrt()
    }

    /// What the readings show, once they show that the prior is far too small, metres.
    pub(super) fn contradiction_m(&self) -> Option<f64> {
        let is_far = self.learnt_m > self.params.far_ratio * self.prior_m;
        (is_far && self.differences >= self.params.min_differences).then_some(self.learnt_m)
    }

    /// Begins a sweep. Differences are formed between sweeps in a row only.
    pub(super) fn begin(&mut self, sweep: u64, sensors: usize) {
        if sweep.abs_diff(self.last_sweep) > 1 || self.last.len() != sensors {
            self.last.clear();
            self.last.resize(sensors, None);
        }
        self.last_sweep = sweep;
    }

    /// Adds what a sensor measures in this sweep at the pose that the wheels predict; none where it measures no wall.
    pub(super) fn add(&mut self, sensor: usize, observation: Option<&WallObservation>) {
        let square = observation.filter(|observation| observation.oblique_rad < self.params.max_oblique_rad);
        let now = square.map(|observation| (observation.side.index(), observation.offset_m()));
        let Some(last) = self.last.get_mut(sensor).map(|last| std::mem::replace(last, now)) else { return };
        if let (Some((side, offset_m)), Some((before, before_m))) = (now, last)
            && side == before
        {
            self.learn((offset_m - before_m).abs());
        }
    }

    /// Moves what this sweep measured with the pose, which has been corrected by `moved_m` in x and y.
    pub(super) fn correct(&mut self, moved_m: [f64; 2]) {
        for (side, offset_m) in self.last.iter_mut().flatten() {
            *offset_m += moved_m[usize::from(*side % 2)];
        }
    }

    fn learn(&mut self, difference_m: f64) {
        let NoiseParams { quantile, quantile_sigmas, gain, first_gain, min_m, max_m, .. } = self.params;
        self.differences = self.differences.saturating_add(1);
        let gain = (first_gain / f64::from(self.differences).sqrt()).max(gain);
        let is_more = difference_m > quantile_sigmas * std::f64::consts::SQRT_2 * self.learnt_m;
        let step = if is_more { quantile } else { quantile - 1.0 };
        self.learnt_m = (self.learnt_m * libm::exp(gain * step)).clamp(min_m, max_m);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is learnt of readings that scatter by `sigma_m`, of which `strays` in a hundred meet another surface.
    fn learnt(sigma_m: f64, strays: u32) -> RangeNoise {
        let mut noise = RangeNoise::new(NoiseParams::default(), 0.02);
        let mut state = 1_u32;
        let mut uniform = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / f64::from(1_u32 << 24)
        };
        for _ in 0..4000 {
            let normal = (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
            let stray_m = if uniform() * 100.0 < f64::from(strays) { 0.5 } else { 0.0 };
            noise.learn((std::f64::consts::SQRT_2 * sigma_m * normal).abs() + stray_m);
        }
        noise
    }

    #[test]
    fn the_scatter_is_learnt_in_spite_of_readings_of_other_surfaces() {
        for sigma_m in [0.01, 0.05, 0.08] {
            let ratio = learnt(sigma_m, 0).learnt_m / sigma_m;
            assert!((0.8..1.25).contains(&ratio), "{sigma_m}: {ratio}");
            let ratio = learnt(sigma_m, 20).learnt_m / sigma_m;
            assert!((0.9..1.6).contains(&ratio), "{sigma_m} with strays: {ratio}");
        }
    }

    #[test]
    fn little_more_than_the_prior_is_no_contradiction_and_far_more_is() {
        let usual = learnt(0.02, 10);
        assert!(usual.sigma_m() < 0.021 && usual.contradiction_m().is_none(), "{usual:?}");
        let far = learnt(0.05, 0);
        assert!(far.sigma_m() > 0.04 && far.contradiction_m().is_some(), "{far:?}");
    }
}
