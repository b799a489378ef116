//! Odometry with its covariance: the prediction of the filter in [`slamd_core::position`], without
//! measurements.

use super::message::Odometry;
use slamd_core::{Calibration, Pose2, Sweep, stages::Filter};

/// Dead reckoning with covariance.
pub(super) struct Wheels {
    nominal: Calibration,
    filter: Filter,
}

/// Initial deviation of the pose. It is nearly zero, because the start defines the frame.
const BEGIN_SIGMA_RAD: f64 = 1e-4;

impl Wheels {
    /// Odometry at the start, with the wheels' sizes and uncertainties of `nominal`.
    pub(super) fn new(nominal: Calibration) -> Self {
        Self { nominal, filter: at_rest(nominal) }
    }

    /// Advances to the next sweep.
    pub(super) fn roll(&mut self, sweep: &Sweep) -> Odometry {
        self.filter.predict(sweep.left_m, sweep.right_m);
        let mut step = at_rest(self.nominal);
        step.predict(sweep.left_m, sweep.right_m);
        // The first sweep has no elapsed time.
        let per_s = if sweep.elapsed_s > 0.0 { sweep.elapsed_s.recip() } else { 0.0 };
        Odometry {
            pose: sweep.odometry,
            covariance: self.filter.pose_covariance(),
            speed_m_s: per_s * 0.5 * (sweep.left_m + sweep.right_m),
            turn_rad_s: per_s * (sweep.right_m - sweep.left_m) / self.nominal.wheel_base_m,
            velocity_covariance: step.pose_covariance() * (per_s * per_s),
        }
    }
}

fn at_rest(nominal: Calibration) -> Filter {
    Filter::new(Pose2::default(), BEGIN_SIGMA_RAD, nominal)
}

#[cfg(test)]
mod tests {
    use super::*;
    use slamd_core::config::RobotConfig;

    /// A tenth of a second ahead at 0.3 m/s, turning at 0.5 rad/s.
    fn arc(base_m: f64) -> Sweep {
        let half_m = 0.5 * 0.05 * base_m;
        Sweep { elapsed_s: 0.1, left_m: 0.03 - half_m, right_m: 0.03 + half_m, ..Sweep::default() }
    }

    #[test]
    fn speeds_agree_with_the_wheels_and_uncertainty_grows_with_distance() {
        let nominal = RobotConfig::default().wheels();
        let mut wheels = Wheels::new(nominal);
        let odometry: Vec<Odometry> = (0..100).map(|_| wheels.roll(&arc(nominal.wheel_base_m))).collect();
        let last = odometry[99];
        assert!((last.speed_m_s - 0.3).abs() < 1e-12 && (last.turn_rad_s - 0.5).abs() < 1e-12, "{last:?}");
        let sigma_rad = |odometry: &Odometry| odometry.covariance[(2, 2)].sqrt();
        assert!(
            sigma_rad(&odometry[99]) > 3.0 * sigma_rad(&odometry[9]),
            "{} {}",
            sigma_rad(&odometry[99]),
            sigma_rad(&odometry[9])
        );
        // The uncertainty of one step does not grow with distance.
        assert!((last.velocity_covariance - odometry[0].velocity_covariance).norm() < 1e-12);
        assert!(last.velocity_covariance[(0, 0)] > 0.0 && last.velocity_covariance[(2, 2)] > 0.0);
    }
}
