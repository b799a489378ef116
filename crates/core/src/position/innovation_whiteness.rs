//! Whiteness of innovations: a repeated error must not count as many independent measurements.
//!
//! The innovations of a consistent filter are white (Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and
//! Navigation, 5.4). Their leaky mean `m += g (nu − m)` then has the variance `g / (2 − g)`. A mean far outside shows one error
//! that repeats, such as a piece of furniture that is taken for the wall behind it; the measurement's variance grows accordingly.

use super::params::WhitenessParams;
use nalgebra::{Matrix3, Vector3};

/// The leaky mean of normalised innovations.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct InnovationWhiteness {
    mean: f64,
    params: WhitenessParams,
}

impl InnovationWhiteness {
    pub(super) fn new(params: WhitenessParams) -> Self {
        Self { mean: 0.0, params }
    }

    /// Adds an innovation over its standard deviation. Returns the factor by which to inflate its variance: 1 for white ones.
    pub(super) fn variance_factor(&mut self, normalised: f64) -> f64 {
        let WhitenessParams { gain, white_sigma, max_sigma, .. } = self.params;
        self.mean += gain * (normalised.clamp(-max_sigma, max_sigma) - self.mean);
        let white_variance = gain / (2.0 - gain);
        (self.mean * self.mean / (white_variance * white_sigma * white_sigma)).max(1.0)
    }
}

/// How far the filter's covariance is from what its innovations show, per direction: x, y and heading.
///
/// Repeated innovations and innovations above their own variance both mean that the errors are greater than the filter knows. The
/// published covariance grows by the greater factor; the filter's own stays, because its gain rests on ratios.
#[derive(Clone, Copy, Debug)]
pub(super) struct StatedErrors {
    whiteness: [InnovationWhiteness; 3],
    mean_nis: [f64; 3],
    factors: [f64; 3],
    params: WhitenessParams,
}

impl StatedErrors {
    pub(super) fn new(params: WhitenessParams) -> Self {
        Self { whiteness: [InnovationWhiteness::new(params); 3], mean_nis: [1.0; 3], factors: [1.0; 3], params }
    }

    /// Adds an innovation over its standard deviation: 0 for x, 1 for y, 2 for the heading.
    pub(super) fn add(&mut self, direction: usize, normalised: f64) {
        let WhitenessParams { nis_gain, max_sigma, .. } = self.params;
        let (Some(whiteness), Some(nis), Some(factor)) =
            (self.whiteness.get_mut(direction), self.mean_nis.get_mut(direction), self.factors.get_mut(direction))
        else {
            return;
        };
        let coloured = whiteness.variance_factor(normalised);
        *nis += nis_gain * (normalised.clamp(-max_sigma, max_sigma).powi(2) - *nis);
        // A factor is forgotten as slowly as the mean.
        *factor = coloured.max(*nis).max(*factor - nis_gain * (*factor - 1.0)).max(1.0);
    }

    /// A covariance of x, y and heading with the errors that the innovations show.
    pub(super) fn inflate(&self, covariance: &Matrix3<f64>) -> Matrix3<f64> {
        let scale = Matrix3::from_diagonal(&Vector3::from(self.factors.map(f64::sqrt)));
        scale * covariance * scale
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_innovations_keep_their_variance_and_repeated_ones_do_not() {
        let mut white = InnovationWhiteness::default();
        assert!((0..200).all(|k| white.variance_factor(if k % 2 == 0 { 1.0 } else { -1.0 }) <= 1.0));
        let mut same = InnovationWhiteness::default();
        let factor = (0..50).map(|_| same.variance_factor(1.0)).last().unwrap_or_default();
        assert!(factor > 4.0, "{factor}");
        let mut wild = InnovationWhiteness::default();
        assert!((0..100).all(|_| wild.variance_factor(1e9) <= 45.0));
    }

    #[test]
    fn repeated_and_large_innovations_inflate_their_direction_only() {
        let mut errors = StatedErrors::new(WhitenessParams::default());
        for k in 0..400 {
            errors.add(0, if k % 2 == 0 { 1.0 } else { -1.0 });
            errors.add(1, 0.8);
            errors.add(2, if k % 2 == 0 { 2.0 } else { -2.0 });
        }
        let stated = errors.inflate(&Matrix3::identity());
        assert!((stated[(0, 0)] - 1.0).abs() < 1e-9, "{stated}");
        assert!(stated[(1, 1)] > 2.0 && (3.0..5.0).contains(&stated[(2, 2)]), "{stated}");
    }
}
