//! Whiteness of innovations: a repeated error must not count as many independent measurements.
//!
//! The innovations of a consistent filter are white (Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and
//! Navigation, 5.4). Their leaky mean `m += g (nu − m)` then has the variance `g / (2 − g)`. A mean far outside shows one error
//! that repeats, such as a piece of furniture that is taken for the wall behind it; the measurement's variance grows accordingly.

use super::params::WhitenessParams;

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
        let WhitenessParams { gain, white_sigma, max_sigma } = self.params;
        self.mean += gain * (normalised.clamp(-max_sigma, max_sigma) - self.mean);
        let white_variance = gain / (2.0 - gain);
        (self.mean * self.mean / (white_variance * white_sigma * white_sigma)).max(1.0)
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
}
