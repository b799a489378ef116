//! What the filter says of its own errors and of the readings' noise.

use super::ekf_slam::EkfSlam;
use nalgebra::{Matrix3, Vector3};

impl EkfSlam {
    /// Covariance of x, y, theta as the innovations show it: the filter's or more, and what the walls' own shape adds to the position.
    #[must_use]
    pub fn stated_covariance(&self) -> Matrix3<f64> {
        let shape_m2 = (self.params.noise.shape_sigmas * self.beam.range_sigma_m).powi(2);
        let covariance = self.stated_errors.inflate(&self.filter.pose_covariance());
        covariance + Matrix3::from_diagonal(&Vector3::new(shape_m2, shape_m2, 0.0))
    }

    /// The standard deviation of a reading, metres: configured, or learnt where the readings show more.
    #[must_use]
    pub fn range_sigma_m(&self) -> f64 {
        self.beam.range_sigma_m
    }

    /// The standard deviation of a reading, metres, where the readings show that it is far more than configured.
    #[must_use]
    pub fn far_range_sigma_m(&self) -> Option<f64> {
        self.noise.contradiction_m()
    }

    /// Continues with the noise that another filter has learnt of the same readings.
    pub(crate) fn adopt_noise(&mut self, other: &Self) {
        self.noise.clone_from(&other.noise);
        self.beam.range_sigma_m = self.noise.sigma_m();
    }
}
