//! The filter's heading, corrected with the building's axis.

use super::filter::{Filter, Robot};

impl Filter {
    /// Updates the state with a heading measured in the middle of a window that ended `lag` ago: metres ahead and radians, which the
    /// wheels have added since. `variance` is that of the measurement.
    pub fn update_lagging_heading(&mut self, innovation_rad: f64, variance: f64, lag: [f64; 2]) {
        let base_m = self.nominal.wheel_base_m * (1.0 + self.robot[4]);
        let h = Robot::new(0.0, 0.0, 1.0, -lag[0] / base_m, lag[1] / (1.0 + self.robot[4]), 0.0);
        let robot_column = self.robot_cov * h;
        for i in 0..self.walls() {
            self.column[i] = self.cross[i].dot(&h);
        }
        let s = h.dot(&robot_column) + variance;
        self.correct(&robot_column, s, innovation_rad);
    }

    /// Adds a variance to the heading, rad².
    pub fn doubt_heading(&mut self, variance: f64) {
        self.robot_cov[(2, 2)] += variance;
    }

    /// Variance of a heading that the wheels have added on a way, rad².
    #[must_use]
    pub fn wheel_heading_variance(&self, way_m: f64) -> f64 {
        let base_m = self.nominal.wheel_base_m * (1.0 + self.robot[4]);
        2.0 * self.slip * self.params.wheel_noise_m * way_m.abs() / (base_m * base_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::Calibration;
    use crate::geometry::Pose2;

    /// The axis of the last metre and a half is that of its middle; what the wheels have added since is theirs.
    #[test]
    fn a_lagging_heading_teaches_the_wheels() {
        let wheels =
            Calibration { wheel_ratio: 1.0, wheel_ratio_sigma: 0.012, wheel_base_m: 0.26, wheel_base_sigma_m: 0.0065 };
        let mut filter = Filter::new(Pose2::default(), 0.01, wheels);
        let (ratio, lag_m) = (0.01, 0.75);
        let heading_rad = |way_m: f64| ratio * way_m / 0.26;
        for reading in 1..=60 {
            (0..5).for_each(|_| filter.predict(0.02, 0.02));
            let way_m = 0.1 * f64::from(reading);
            let measured_rad = heading_rad(way_m - lag_m) + filter.robot[3] * lag_m / 0.26;
            filter.update_lagging_heading(measured_rad - filter.pose().theta_rad, 1e-5, [lag_m, 0.0]);
        }
        assert!((filter.robot[3] - ratio).abs() < 0.1 * ratio, "{}", filter.robot[3]);
        let error_rad = filter.pose().theta_rad - heading_rad(6.0);
        assert!(error_rad.abs() < 0.01, "{error_rad}");
    }

    #[test]
    fn a_doubted_heading_takes_more_of_the_next_measurement() {
        let wheels =
            Calibration { wheel_ratio: 1.0, wheel_ratio_sigma: 0.0, wheel_base_m: 0.26, wheel_base_sigma_m: 0.0 };
        let taken_rad = |doubt: f64| {
            let mut filter = Filter::new(Pose2::default(), 0.01, wheels);
            filter.doubt_heading(doubt);
            filter.update_lagging_heading(0.1, 1e-4, [0.0; 2]);
            filter.pose().theta_rad
        };
        assert!((taken_rad(0.0) - 0.05).abs() < 1e-9 && (taken_rad(3e-4) - 0.08).abs() < 1e-9);
    }
}
