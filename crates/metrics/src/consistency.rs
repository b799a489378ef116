//! Normalized estimation error squared (NEES): compares the filter's errors with its covariance.
//!
//! NEES = eᵀ P⁻¹ e with e = (x, y, theta) estimated minus true, in the map frame, and P the covariance of the estimate
//! (Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and Navigation, 5.4). Divided by the three degrees
//! of freedom its mean is 1 for a consistent filter and larger for an overconfident one.

use super::pairing::Pair;
use nalgebra::Vector3;
use slamd_core::{Estimate, Pose2, wrap_angle};
use std::f64::consts::FRAC_PI_2;

/// The map frame by its definition, `world_from_map`: the origin is the robot's start, and the axes
/// are along the walls of an axis-aligned world. The first pair selects one of the four rotations.
#[must_use]
pub fn building_frame(first: &Pair<Estimate>) -> Pose2 {
    let turn_rad = wrap_angle(first.truth.theta_rad - first.estimate.pose.theta_rad);
    Pose2::new(first.truth.x_m, first.truth.y_m, FRAC_PI_2 * (turn_rad / FRAC_PI_2).round())
}

/// Mean NEES per degree of freedom, given the true map frame `world_from_map`; `None` if no covariance
/// can be inverted.
#[must_use]
pub fn mean_nees(pairs: &[Pair<Estimate>], world_from_map: Pose2) -> Option<f64> {
    let map_from_world = world_from_map.inverse();
    let (mut sum, mut count) = (0.0, 0.0);
    for pair in pairs {
        let (pose, truth) = (pair.estimate.pose, map_from_world * pair.truth);
        let error =
            Vector3::new(pose.x_m - truth.x_m, pose.y_m - truth.y_m, wrap_angle(pose.theta_rad - truth.theta_rad));
        if let Some(information) = pair.estimate.covariance.try_inverse() {
            sum += (error.transpose() * information * error)[0] / 3.0;
            count += 1.0;
        }
    }
    (count > 0.0).then(|| sum / count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;
    use slamd_core::Timestamp;

    fn pair(error: [f64; 3], sigma: f64) -> Pair<Estimate> {
        let world_from_map = Pose2::new(2.0, 1.0, FRAC_PI_2);
        let truth_in_map = Pose2::new(1.0, 2.0, 0.3);
        let pose = Pose2::new(1.0 + error[0], 2.0 + error[1], 0.3 + error[2]);
        let covariance = Matrix3::identity() * (sigma * sigma);
        let (at, odometry) = (Timestamp::default(), Pose2::default());
        let estimate = Estimate { at, sweep: 0, pose, covariance, odometry, nis: f64::NAN };
        Pair { at, estimate, truth: world_from_map * truth_in_map }
    }

    #[test]
    fn errors_of_one_standard_deviation_have_a_nees_of_one() {
        let pairs = [pair([0.1, 0.1, 0.1], 0.1), pair([-0.1, 0.1, -0.1], 0.1)];
        let nees = mean_nees(&pairs, Pose2::new(2.0, 1.0, FRAC_PI_2)).unwrap();
        assert!((nees - 1.0).abs() < 1e-9, "{nees}");
        let overconfident = [pair([0.1, 0.1, 0.1], 0.05)];
        assert!((mean_nees(&overconfident, Pose2::new(2.0, 1.0, FRAC_PI_2)).unwrap() - 4.0).abs() < 1e-9);
    }

    #[test]
    fn the_building_frame_keeps_the_error_of_the_first_heading() {
        let frame = building_frame(&pair([0.0, 0.0, 0.04], 0.1));
        assert!((frame.theta_rad - FRAC_PI_2).abs() < 1e-12);
    }

    #[test]
    fn without_estimates_there_is_none() {
        assert_eq!(mean_nees(&[], Pose2::default()), None);
        assert_eq!(mean_nees(&[pair([0.0; 3], 0.0)], Pose2::default()), None);
    }
}
