//! Absolute trajectory error (ATE): the distance between the estimated and the true position at each estimate.
//!
//! The estimate is aligned with the truth at the FIRST pose only, position and heading: `world_from_map` =
//! `truth_0 * estimate_0⁻¹`. This is stricter than the usual least-squares alignment over the whole path, because an early
//! heading error is not averaged away.

use super::pairing::Pairing;
use serde::Serialize;
use slamd_core::{Pose2, Timestamp, wrap_angle};

/// The errors over a whole run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Accuracy {
    /// Root mean square of the position error, metres.
    pub ate_m: f64,
    /// Greatest position error, metres.
    pub ate_max_m: f64,
    /// Root mean square of the heading error, degrees.
    pub heading_rmse_deg: f64,
}

/// Compares estimates with the truth as both arrive, each in the order of time.
#[derive(Clone, Debug, Default)]
pub struct AccuracyMeter {
    pairing: Pairing<Pose2>,
    world_from_map: Option<Pose2>,
    compared: u64,
    last_m: f64,
    square_sum_m2: f64,
    square_max_m2: f64,
    heading_square_sum_rad2: f64,
}

impl AccuracyMeter {
    /// Adds an estimated pose, `map_from_robot`.
    pub fn estimate(&mut self, at: Timestamp, pose: Pose2) {
        self.pairing.estimate(at, pose);
        self.compare();
    }

    /// Adds a true pose, `world_from_robot`.
    pub fn truth(&mut self, at: Timestamp, pose: Pose2) {
        self.pairing.truth(at, pose);
        self.compare();
    }

    /// Adds an estimate, `map_from_robot`, and the true pose of the same instant, `world_from_robot`.
    pub fn add(&mut self, estimate: Pose2, truth: Pose2) {
        let world_from_map = *self.world_from_map.get_or_insert_with(|| truth * estimate.inverse());
        let aligned = world_from_map * estimate;
        let square = (aligned.position() - truth.position()).norm_squared();
        let turn = wrap_angle(aligned.theta_rad - truth.theta_rad);
        self.compared += 1;
        self.last_m = square.sqrt();
        self.square_sum_m2 += square;
        self.square_max_m2 = self.square_max_m2.max(square);
        self.heading_square_sum_rad2 += turn * turn;
    }

    /// The alignment at the first pose; `None` before it.
    #[must_use]
    pub const fn world_from_map(&self) -> Option<Pose2> {
        self.world_from_map
    }

    /// Position error of the last compared estimate, metres; 0 before the first.
    #[must_use]
    pub const fn last_m(&self) -> f64 {
        self.last_m
    }

    /// The errors so far; `None` before the first comparison.
    #[must_use]
    pub fn accuracy(&self) -> Option<Accuracy> {
        let n = self.compared as f64;
        (self.compared > 0).then(|| Accuracy {
            ate_m: (self.square_sum_m2 / n).sqrt(),
            ate_max_m: self.square_max_m2.sqrt(),
            heading_rmse_deg: (self.heading_square_sum_rad2 / n).sqrt().to_degrees(),
        })
    }

    fn compare(&mut self) {
        while let Some(pair) = self.pairing.next_pair() {
            self.add(pair.estimate, pair.truth);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(ms: u64) -> Timestamp {
        Timestamp::from_us(ms * 1000)
    }

    #[test]
    fn a_perfect_path_in_another_frame_has_no_error() {
        let mut meter = AccuracyMeter::default();
        let world_from_map = Pose2::new(3.0, -2.0, 1.1);
        for i in 0..100u64 {
            let pose = Pose2::new(0.1 * i as f64, 0.0, 0.0);
            meter.truth(ms(100 * i), world_from_map * pose);
            if i > 0 {
                meter.estimate(ms(100 * i - 50), Pose2::new(0.1 * i as f64 - 0.05, 0.0, 0.0));
            }
        }
        let accuracy = meter.accuracy().unwrap();
        assert!(accuracy.ate_max_m < 1e-9 && accuracy.heading_rmse_deg < 1e-6, "{accuracy:?}");
        assert!((meter.world_from_map().unwrap().x_m - 3.0).abs() < 1e-9);
    }

    #[test]
    fn errors_are_root_mean_squares_after_the_first_pose() {
        let mut meter = AccuracyMeter::default();
        for i in 0..4u64 {
            meter.estimate(ms(i), Pose2::new(if i == 2 { 1.0 } else { 0.0 }, 0.0, if i == 3 { 0.2 } else { 0.0 }));
            meter.truth(ms(i), Pose2::default());
        }
        let accuracy = meter.accuracy().unwrap();
        assert!((accuracy.ate_m - 0.5).abs() < 1e-12 && (accuracy.ate_max_m - 1.0).abs() < 1e-12);
        assert!((accuracy.heading_rmse_deg - 0.1f64.to_degrees()).abs() < 1e-9);
    }

    #[test]
    fn estimates_before_the_first_truth_are_left_out() {
        let mut meter = AccuracyMeter::default();
        meter.estimate(ms(1), Pose2::new(5.0, 0.0, 0.0));
        meter.truth(ms(2), Pose2::default());
        assert_eq!(meter.accuracy(), None);
        meter.estimate(ms(2), Pose2::new(7.0, 0.0, 0.0));
        assert!(meter.accuracy().unwrap().ate_max_m < 1e-12);
    }
}
