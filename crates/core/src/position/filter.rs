//! The extended Kalman filter of the walls method.
//!
//! | symbol | meaning |
//! |---|---|
//! | x | state: x, y (m), theta (rad), `k_r`, `k_b`, `k_s` relative errors of the configured wheel ratio, wheel base and travel, then one offset (m) per wall |
//! | P | covariance of x |
//! | F, Q | motion: how the old state moves the new one, and the noise of the wheels |
//! | H, R | measurement: how the state moves the expected distance, and the noise of the distance |
//! | S, K | innovation covariance, gain |
//! | ds, dtheta | distance and rotation between two sweeps |
//! | `j_a` | Jacobian of the pose by a, one column |
//!
//! The frame is the building's: its axes are the walls' directions, so a wall is one number. A wall's state never changes by itself,
//! so a prediction touches only the robot's five rows; each measurement is a scalar, so an update is one outer product. The
//! equations are EKF-SLAM's with landmarks of one coordinate (Thrun, Burgard and Fox, Probabilistic Robotics, 10).

use super::params::FilterParams;
use super::symmetric::Symmetric;
use crate::event::Calibration;
use crate::geometry::{Pose2, sinc};
use nalgebra::{Matrix3, SMatrix, SVector};

/// The robot's part of the state.
pub(crate) const ROBOT: usize = 6;
/// Walls that the filter holds at most.
pub(crate) const MAX_WALLS: usize = 160;

pub(super) type Robot = SVector<f64, ROBOT>;

/// The filter's state and covariance.
#[derive(Clone, Debug)]
pub struct Filter {
    pub(super) robot: Robot,
    pub(super) offsets: Vec<f64>,
    pub(super) robot_cov: SMatrix<f64, ROBOT, ROBOT>,
    pub(super) cross: Vec<Robot>,
    pub(super) wall_cov: Symmetric,
    pub(super) nominal: Calibration,
    /// The wheels' random error as a multiple of the least variance.
    pub(super) slip: f64,
    pub(super) params: FilterParams,
    pub(super) column: Vec<f64>,
}

/// One scalar measurement: `H` has the robot's part and ±1 at one wall.
#[derive(Clone, Copy, Debug)]
pub struct Measurement {
    /// Measured minus expected.
    pub innovation: f64,
    /// The robot's part of H.
    pub robot: Robot,
    /// The walls' part of H: index and sign.
    pub wall: (usize, f64),
    /// R.
    pub variance: f64,
}

impl Filter {
    /// A filter at a pose whose heading has the standard deviation `heading_sigma_rad`; the position is the origin by
    /// definition. `nominal` is the prior of the wheels.
    #[must_use]
    pub fn new(pose: Pose2, heading_sigma_rad: f64, nominal: Calibration) -> Self {
        Self::with_params(FilterParams::default(), pose, heading_sigma_rad, nominal)
    }

    /// The same with other constants.
    #[must_use]
    pub fn with_params(params: FilterParams, pose: Pose2, heading_sigma_rad: f64, nominal: Calibration) -> Self {
        let start_m = params.start_sigma_m;
        let base_sigma = nominal.wheel_base_sigma_m / nominal.wheel_base_m;
        let sigmas =
            Robot::new(start_m, start_m, heading_sigma_rad, nominal.wheel_ratio_sigma, base_sigma, params.travel_sigma);
        Self {
            robot: Robot::new(pose.x_m, pose.y_m, pose.theta_rad, 0.0, 0.0, 0.0),
            offsets: Vec::with_capacity(MAX_WALLS),
            robot_cov: SMatrix::from_diagonal(&sigmas.component_mul(&sigmas)),
            cross: Vec::with_capacity(MAX_WALLS),
            wall_cov: Symmetric::new(MAX_WALLS),
            nominal,
            slip: 1.0,
            params,
            column: vec![0.0; MAX_WALLS],
        }
    }

    /// The robot in the building frame.
    #[must_use]
    pub fn pose(&self) -> Pose2 {
        Pose2::new(self.robot[0], self.robot[1], self.robot[2])
    }

    /// Covariance of x, y, theta.
    #[must_use]
    pub fn pose_covariance(&self) -> Matrix3<f64> {
        self.robot_cov.fixed_view::<3, 3>(0, 0).into_owned()
    }

    /// The number of walls held.
    #[must_use]
    pub fn walls(&self) -> usize {
        self.offsets.len()
    }

    /// A wall's offset along its axis, metres.
    #[must_use]
    pub fn offset_m(&self, wall: usize) -> f64 {
        self.offsets[wall]
    }

    /// A wall's variance, m².
    #[must_use]
    pub fn wall_variance(&self, wall: usize) -> f64 {
        self.wall_cov.get(wall, wall)
    }

    /// The estimated wheels.
    #[must_use]
    pub fn calibration(&self) -> Calibration {
        Calibration {
            wheel_ratio: self.nominal.wheel_ratio * (1.0 + 0.5 * self.robot[3]) / (1.0 - 0.5 * self.robot[3]),
            wheel_ratio_sigma: self.robot_cov[(3, 3)].sqrt(),
            wheel_base_m: self.nominal.wheel_base_m * (1.0 + self.robot[4]),
            wheel_base_sigma_m: self.nominal.wheel_base_m * self.robot_cov[(4, 4)].sqrt(),
        }
    }

    /// True over reported travel, and its uncertainty.
    #[must_use]
    pub fn travel_scale(&self) -> (f64, f64) {
        (1.0 + self.robot[5], self.robot_cov[(5, 5)].sqrt())
    }

    /// Predicts the pose after the wheels have rolled by `left_m` and `right_m` as the configured wheels would.
    pub fn predict(&mut self, left_m: f64, right_m: f64) {
        let [ratio, base] = [self.robot[3], self.nominal.wheel_base_m * (1.0 + self.robot[4])];
        let left = left_m * (1.0 - 0.5 * ratio);
        let right = right_m * (1.0 + 0.5 * ratio);
        let dtheta = (right - left) / base;
        let reported = 0.5 * (left + right);
        let ds = reported * (1.0 + self.robot[5]);
        let (sin, cos) = libm::sincos(self.robot[2] + 0.5 * dtheta);
        let chord = ds * sinc(0.5 * dtheta);
        self.robot[0] += chord * cos;
        self.robot[1] += chord * sin;
        self.robot[2] = crate::geometry::wrap_angle(self.robot[2] + dtheta);

        // The chain rule gives the Jacobians by the wheels' parameters.
        let j_dtheta = Robot::new(-0.5 * ds * sin, 0.5 * ds * cos, 1.0, 0.0, 0.0, 0.0);
        let j_ds = Robot::new(cos, sin, 0.0, 0.0, 0.0, 0.0);
        let mut f = SMatrix::<f64, ROBOT, ROBOT>::identity();
        f[(0, 2)] = -chord * sin;
        f[(1, 2)] = chord * cos;
        let j_ratio = j_dtheta * (0.5 * (right_m + left_m) / base) + j_ds * (0.25 * (right_m - left_m));
        let j_base = j_dtheta * (-dtheta / (1.0 + self.robot[4]));
        for row in 0..3 {
            f[(row, 3)] = j_ratio[row];
            f[(row, 4)] = j_base[row];
            f[(row, 5)] = j_ds[row] * reported;
        }
        let noise_m = self.slip * self.params.wheel_noise_m;
        let (left_noise, right_noise) = (noise_m * left.abs(), noise_m * right.abs());
        let j_left = j_ds * 0.5 - j_dtheta / base;
        let j_right = j_ds * 0.5 + j_dtheta / base;
        let mut q = j_left * j_left.transpose() * left_noise + j_right * j_right.transpose() * right_noise;
        let drift = self.params.wheel_drift_m * (left.abs() + right.abs());
        q[(3, 3)] += drift;
        q[(4, 4)] += drift;
        q[(5, 5)] += drift;
        self.robot_cov = f * self.robot_cov * f.transpose() + q;
        for cross in &mut self.cross {
            *cross = f * *cross;
        }
    }

    /// S of a measurement.
    #[must_use]
    pub fn innovation_variance(&self, m: &Measurement) -> f64 {
        let (wall, sign) = m.wall;
        (m.robot.transpose() * self.robot_cov * m.robot)[0]
            + 2.0 * sign * m.robot.dot(&self.cross[wall])
            + self.wall_variance(wall)
            + m.variance
    }

    /// Updates the state with a measurement of one wall.
    pub fn update(&mut self, m: &Measurement) {
        let s = self.innovation_variance(m);
        let (wall, sign) = m.wall;
        let robot_column = self.robot_cov * m.robot + self.cross[wall] * sign;
        for i in 0..self.walls() {
            self.column[i] = self.cross[i].dot(&m.robot) + sign * self.wall_cov.get(i, wall);
        }
        self.correct(&robot_column, s, m.innovation);
    }

    /// Updates the state with a heading measured to a variance.
    pub fn update_heading(&mut self, innovation_rad: f64, variance: f64) {
        let s = self.robot_cov[(2, 2)] + variance;
        let robot_column = self.robot_cov.column(2).into_owned();
        for i in 0..self.walls() {
            self.column[i] = self.cross[i][2];
        }
        self.correct(&robot_column, s, innovation_rad);
    }

    /// Adapts the wheels' noise to a normalised innovation squared `nis` of the heading: a mean above 1 shows that the wheels
    /// slip more than the filter assumes.
    pub fn adapt_slip(&mut self, nis: f64) {
        let FilterParams { slip_gain, max_nis, max_slip, .. } = self.params;
        let slip = self.slip * libm::exp(slip_gain * (nis.min(max_nis) - 1.0));
        self.slip = slip.clamp(1.0, max_slip);
    }

    /// Merges two walls: measures that their offsets are equal to within a variance, and removes the second.
    pub fn merge(&mut self, keep: usize, gone: usize, variance: f64) {
        let between = self.difference_variance(keep, gone) + variance;
        for i in 0..self.walls() {
            self.column[i] = self.wall_cov.get(i, keep) - self.wall_cov.get(i, gone);
        }
        let robot_column = self.cross[keep] - self.cross[gone];
        self.correct(&robot_column, between, self.offsets[gone] - self.offsets[keep]);
        self.remove(gone);
    }

    /// Variance of the difference of two walls' offsets.
    #[must_use]
    pub fn difference_variance(&self, a: usize, b: usize) -> f64 {
        self.wall_variance(a) + self.wall_variance(b) - 2.0 * self.wall_cov.get(a, b)
    }

    /// Adds a wall observed at `offset_m`: `h_robot` is the offset's derivative by the robot's state,
    /// `variance` the noise of the observation. Returns its index, or none where the filter is full.
    pub fn add(&mut self, offset_m: f64, h_robot: &Robot, variance: f64) -> Option<usize> {
        let new = self.walls();
        if new == MAX_WALLS {
            return None;
        }
        for i in 0..new {
            self.wall_cov.set(new, i, self.cross[i].dot(h_robot));
        }
        let cross = self.robot_cov * h_robot;
        self.wall_cov.set(new, new, h_robot.dot(&cross) + variance);
        self.cross.push(cross);
        self.offsets.push(offset_m);
        Some(new)
    }

    /// Removes a wall; the last one takes its index.
    pub fn remove(&mut self, wall: usize) {
        let last = self.walls() - 1;
        self.wall_cov.replace(wall, last);
        self.offsets.swap_remove(wall);
        self.cross.swap_remove(wall);
    }

    /// Sets the pose and clears its correlations with wheels and walls.
    pub fn relocate(&mut self, pose: Pose2, position_sigma_m: f64, heading_sigma_rad: f64) {
        let sigmas = [position_sigma_m, position_sigma_m, heading_sigma_rad];
        for (row, value) in [pose.x_m, pose.y_m, pose.theta_rad].into_iter().enumerate() {
            self.robot[row] = value;
            self.robot_cov.row_mut(row).fill(0.0);
            self.robot_cov.column_mut(row).fill(0.0);
            self.robot_cov[(row, row)] = sigmas[row] * sigmas[row];
            self.cross.iter_mut().for_each(|cross| cross[row] = 0.0);
        }
    }

    /// Sets the wheels' ratio and base, as in the state, to what they were with these variances, and clears their correlations.
    pub(super) fn set_wheels(&mut self, wheels: [f64; 2], variances: [f64; 2]) {
        for (row, (value, variance)) in (3..).zip(wheels.into_iter().zip(variances)) {
            self.robot[row] = value;
            self.robot_cov.row_mut(row).fill(0.0);
            self.robot_cov.column_mut(row).fill(0.0);
            self.robot_cov[(row, row)] = variance;
            self.cross.iter_mut().for_each(|cross| cross[row] = 0.0);
        }
        self.slip = 1.0;
    }

    /// x += K ν and P −= K S Kᵀ, where the column is P Hᵀ: symmetric by construction.
    pub(super) fn correct(&mut self, robot_column: &Robot, s: f64, innovation: f64) {
        let walls = self.walls();
        self.robot += robot_column * (innovation / s);
        self.robot[2] = crate::geometry::wrap_angle(self.robot[2]);
        self.robot_cov -= robot_column * robot_column.transpose() / s;
        for i in 0..walls {
            let gain = self.column[i] / s;
            self.offsets[i] += gain * innovation;
            self.cross[i] -= robot_column * gain;
        }
        self.wall_cov.subtract_outer(&self.column[..walls], s.recip());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHEELS: Calibration =
        Calibration { wheel_ratio: 1.0, wheel_ratio_sigma: 0.012, wheel_base_m: 0.26, wheel_base_sigma_m: 0.0065 };

    fn busy_filter() -> Filter {
        let mut filter = Filter::new(Pose2::new(0.0, 0.0, 0.3), 0.05, WHEELS);
        filter.predict(0.10, 0.12);
        for (i, offset) in [2.0, -1.5, 3.0].into_iter().enumerate() {
            let axis = if i % 2 == 0 { 0 } else { 1 };
            let mut h_robot = Robot::zeros();
            h_robot[axis] = 1.0;
            filter.add(offset, &h_robot, 1e-4);
        }
        filter.predict(0.12, 0.10);
        filter
    }

    fn observe_wall(wall: usize, innovation: f64) -> Measurement {
        let robot = Robot::new(-1.0, 0.0, 0.1, 0.0, 0.0, 0.0);
        Measurement { innovation, robot, wall: (wall, 1.0), variance: 4e-4 }
    }

    fn full(filter: &Filter) -> nalgebra::DMatrix<f64> {
        let n = ROBOT + filter.walls();
        nalgebra::DMatrix::from_fn(n, n, |i, j| match (i.checked_sub(ROBOT), j.checked_sub(ROBOT)) {
            (None, None) => filter.robot_cov[(i, j)],
            (Some(a), None) => filter.cross[a][j],
            (None, Some(b)) => filter.cross[b][i],
            (Some(a), Some(b)) => filter.wall_cov.get(a, b),
        })
    }

    #[test]
    fn covariance_stays_symmetric_and_positive() {
        let mut filter = busy_filter();
        for step in 0..200 {
            filter.predict(0.02, 0.021);
            filter.update(&observe_wall(step % 3, 0.01));
            filter.update_heading(0.001, 1e-3);
        }
        let p = full(&filter);
        assert!((&p - p.transpose()).amax() < 1e-12);
        assert!(p.symmetric_eigenvalues().min() > 0.0);
    }

    #[test]
    fn an_update_equals_the_textbook() {
        let mut filter = busy_filter();
        let (p, m) = (full(&filter), observe_wall(2, 0.03));
        let mut h = nalgebra::DVector::zeros(ROBOT + 3);
        h.rows_mut(0, ROBOT).copy_from(&m.robot);
        h[ROBOT + 2] = 1.0;
        let s = (h.transpose() * &p * &h)[0] + m.variance;
        let k = &p * &h / s;
        let expected = &p - &k * s * k.transpose();
        let before = filter.offset_m(0);
        filter.update(&m);
        assert!((full(&filter) - expected).amax() < 1e-12);
        assert!((filter.offset_m(0) - before - k[ROBOT] * m.innovation).abs() < 1e-12);
    }

    #[test]
    fn removing_a_wall_keeps_the_others() {
        let mut filter = busy_filter();
        filter.update(&observe_wall(1, 0.02));
        let p = full(&filter);
        filter.remove(0);
        let left = full(&filter);
        assert!((left[(ROBOT, ROBOT)] - p[(ROBOT + 2, ROBOT + 2)]).abs() < 1e-15);
        assert!((left[(ROBOT + 1, ROBOT)] - p[(ROBOT + 1, ROBOT + 2)]).abs() < 1e-15);
    }

    #[test]
    fn motion_jacobian_equals_finite_differences() {
        let jacobian_column = |index: usize| {
            let run = |delta: f64| {
                let mut filter = Filter::new(Pose2::new(1.0, 2.0, 0.4), 0.05, WHEELS);
                filter.robot[index] += delta;
                filter.predict(0.05, 0.08);
                filter.robot
            };
            (run(1e-6) - run(-1e-6)) / 2e-6
        };
        let mut filter = Filter::new(Pose2::new(1.0, 2.0, 0.4), 0.05, WHEELS);
        filter.robot_cov = SMatrix::identity();
        filter.predict(0.05, 0.08);
        // With P = 1 the prediction gives F Fᵀ + Q; Q is four orders smaller.
        let f = SMatrix::<f64, ROBOT, ROBOT>::from_columns(&[0, 1, 2, 3, 4, 5].map(jacobian_column));
        assert!((filter.robot_cov - f * f.transpose()).amax() < 1e-3);
    }
}
