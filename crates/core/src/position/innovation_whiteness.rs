//! Innovations that keep their sign: errors of one cause, which the filter would take for measurements independent of each other.
//!
//! A filter that knows its errors sees innovations that are white (Bar-Shalom, Li and Kirubarajan, Estimation with Applications to
//! Tracking and Navigation, 5.4). Where their leaky mean is far from zero, what is measured repeats one error, such as a piece of
//! furniture that is taken for the wall behind it, and each repetition counts for less.

/// The leaky mean of normalised innovations.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct InnovationWhiteness {
    mean: f64,
}

/// What one innovation adds to the mean: some twenty are remembered.
const GAIN: f64 = 0.1;
/// The variance of the mean of white innovations.
const WHITE: f64 = GAIN / (2.0 - GAIN);
/// Means within so many standard deviations are taken for white.
const WHITE_SIGMA: f64 = 2.0;
/// A single innovation says no more than this.
const MAX_SIGMA: f64 = 3.0;

impl InnovationWhiteness {
    /// Adds an innovation over its standard deviation, and tells by what factor its variance is larger than believed: 1 for white ones.
    pub(super) fn weigh(&mut self, normalised: f64) -> f64 {
        self.mean += GAIN * (normalised.clamp(-MAX_SIGMA, MAX_SIGMA) - self.mean);
        (self.mean * self.mean / (WHITE * WHITE_SIGMA * WHITE_SIGMA)).max(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_innovations_are_believed_and_insisting_ones_are_not() {
        let mut white = InnovationWhiteness::default();
        assert!((0..200).all(|k| white.weigh(if k % 2 == 0 { 1.0 } else { -1.0 }) <= 1.0));
        let mut same = InnovationWhiteness::default();
        let factor = (0..50).map(|_| same.weigh(1.0)).last().unwrap_or_default();
        assert!(factor > 4.0, "{factor}");
        let mut wild = InnovationWhiteness::default();
        assert!((0..100).all(|_| wild.weigh(1e9) <= 45.0));
    }
}
