//! Principal components of three instants: what of each sensor's motion the common motion does not explain.
//!
//! Rows are the elements of V = [x_1..x_n, y_1..y_n, X, Y, theta] (equation 1), length l = 2n + 3; columns are three
//! instants, M = [V\[k\] V\[k+1\] V\[k+2\]] (equations 2, 3). With the mean over the instants subtracted, C = M − mean, the first
//! principal component u is the first eigenvector of the l × l covariance C Cᵀ, M is rebuilt as M^ = mean + u uᵀ C, and what is
//! lost is MSPE = Σ (m_ij − m^_ij)² / (l · 3) (equation 4).
//!
//! **Why 3 × 3 is enough.** Let v be the first eigenvector of the Gram matrix G = Cᵀ C, G v = λ v. Then
//! C Cᵀ (C v) = C (G v) = λ (C v): u = C v / √λ, with the same eigenvalue; the other l − 3 eigenvalues are 0. Therefore
//! u uᵀ C = C v vᵀ Cᵀ C / λ = C v vᵀ, and one row c of C loses |c|² − (c · v)². Neither the covariance nor u is ever formed.
//!
//! **Elements without a number.** V has no holes in the paper, so a missing measurement (NaN, and "too close", −∞) puts the
//! endpoint at the sensor itself, range 0, and "nothing in range" (+∞) puts it at the farthest range. A sensor that is
//! always missing, always saturated or stuck is therefore a *constant* row: the mean takes all of it and its residual is 0.
//! Only the change shows. Such sensors need other evidence.

use crate::sweep::Sweep;
use nalgebra::{Matrix3, Vector3};

/// Instants in one block: the paper's t.
pub const INSTANTS: usize = 3;

/// One row of M: an element of V at three instants.
type Row = [f64; INSTANTS];

/// The last three instants and what their first component leaves over.
#[derive(Clone, Debug)]
pub struct PcaBlock {
    max_range_m: f64,
    /// x_1..x_n, y_1..y_n, X, Y, theta.
    rows: Vec<Row>,
    residuals_m2: Vec<f64>,
    instants: usize,
}

impl PcaBlock {
    /// An empty block for `sensors` sensors that saturate at `max_range_m`.
    #[must_use]
    pub fn new(sensors: usize, max_range_m: f64) -> Self {
        Self {
            max_range_m,
            rows: vec![[0.0; INSTANTS]; 2 * sensors + 3],
            residuals_m2: vec![0.0; sensors],
            instants: 0,
        }
    }

    /// Replaces the oldest instant by V\[k\]. True once three instants are there and [`PcaBlock::analyse`] means
    /// something. Beams beyond the ring are ignored, beams the sweep lacks count as missing.
    pub fn push(&mut self, sweep: &Sweep) -> bool {
        let column = self.instants % INSTANTS;
        let sensors = self.residuals_m2.len();
        for sensor in 0..sensors {
            let (x, y) = sweep.beams.get(sensor).map_or((0.0, 0.0), |beam| {
                let end = beam.robot_from_sensor.ahead(drawn_range(beam.range_m, self.max_range_m));
                (end.x, end.y)
            });
            self.rows[sensor][column] = x;
            self.rows[sensors + sensor][column] = y;
        }
        self.rows[2 * sensors][column] = sweep.odometry.x_m;
        self.rows[2 * sensors + 1][column] = sweep.odometry.y_m;
        self.rows[2 * sensors + 2][column] = sweep.odometry.theta_rad;
        self.instants += 1;
        self.instants >= INSTANTS
    }

    /// Forgets all instants.
    pub fn clear(&mut self) {
        self.instants = 0;
    }

    /// Rebuilds the block from its first component and returns the MSPE (equation 4), every row counting alike.
    ///
    /// `weight` gives each sensor's say, from 0 to 1, in what the first component *is*, from its number and its variation in this
    /// block (the mean square of its centred rows, square metres); it does not change how its residual is measured. With weight 1
    /// everywhere this is the paper, and a single wild sensor *is* the first component, residual 0. `cauchy_weight` of the
    /// variation keeps it from that; a weight by the last residual does not, for that residual was 0.
    pub fn analyse(&mut self, weight: impl Fn(usize, f64) -> f64) -> f64 {
        let sensors = self.residuals_m2.len();
        let mut gram = Matrix3::zeros();
        for sensor in 0..sensors {
            let [x, y] = [sensor, sensors + sensor].map(|row| self.centred(row));
            let variation_m2 = (x.norm_squared() + y.norm_squared()) / (2 * INSTANTS) as f64;
            gram += weight(sensor, variation_m2) * (x * x.transpose() + y * y.transpose());
        }
        for odometry in 2 * sensors..self.rows.len() {
            let c = self.centred(odometry);
            gram += c * c.transpose();
        }
        let v = first_eigenvector(gram);

        self.residuals_m2.fill(0.0);
        let mut total = 0.0;
        for index in 0..self.rows.len() {
            let c = self.centred(index);
            let lost = (c - c.dot(&v) * v).norm_squared();
            total += lost;
            if index < 2 * sensors {
                self.residuals_m2[index % sensors] += lost / (2 * INSTANTS) as f64;
            }
        }
        total / (self.rows.len() * INSTANTS) as f64
    }

    /// q_i of the last [`PcaBlock::analyse`]: the mean square of the rows x_i and y_i outside the first component, square
    /// metres, by sensor.
    #[must_use]
    pub fn residuals_m2(&self) -> &[f64] {
        &self.residuals_m2
    }

    /// One row less its mean; the heading is unwrapped first.
    fn centred(&self, index: usize) -> Vector3<f64> {
        let row = &self.rows[index];
        let mut c = Vector3::from(*row);
        if index + 1 == self.rows.len() {
            c = c.map(|theta| crate::geometry::wrap_angle(theta - row[0]));
        }
        c.add_scalar(-c.mean())
    }
}

/// A sensor's say, 1 / (1 + m / tau) for its mean square m: 1 for a calm sensor, towards 0 for a wild one.
#[must_use]
pub(crate) fn cauchy_weight(mean_square_m2: f64, tau_m2: f64) -> f64 {
    1.0 / (1.0 + mean_square_m2 / tau_m2)
}

/// Where the endpoint is drawn for a range of REP-117: see the module's text.
fn drawn_range(range_m: f64, max_range_m: f64) -> f64 {
    if range_m.is_nan() { 0.0 } else { range_m.clamp(0.0, max_range_m) }
}

/// The unit eigenvector of the largest eigenvalue of a symmetric matrix, by Jacobi rotations (square roots only, so that
/// every machine finds the same bits). A zero matrix gives a unit vector, too.
fn first_eigenvector(mut a: Matrix3<f64>) -> Vector3<f64> {
    const TURNS: usize = 6;
    let mut v = Matrix3::identity();
    for _ in 0..TURNS {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if a[(p, q)] == 0.0 {
                continue;
            }
            let ratio = (a[(q, q)] - a[(p, p)]) / (2.0 * a[(p, q)]);
            let t = ratio.signum() / (ratio.abs() + (ratio * ratio + 1.0).sqrt());
            let c = 1.0 / (t * t + 1.0).sqrt();
            let mut rotation = Matrix3::identity();
            rotation[(p, p)] = c;
            rotation[(q, q)] = c;
            rotation[(p, q)] = t * c;
            rotation[(q, p)] = -t * c;
            a = rotation.transpose() * a * rotation;
            v *= rotation;
        }
    }
    let mut first = 0;
    for column in 1..3 {
        if a[(column, column)] > a[(first, first)] {
            first = column;
        }
    }
    v.column(first).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Pose2, Ring};
    use crate::sweep::Beam;
    use nalgebra::DMatrix;
    use proptest::prelude::*;

    const MAX_RANGE_M: f64 = 3.0;

    fn sweep(ranges: &[f64], odometry: Pose2) -> Sweep {
        let ring = Ring::circle(u8::try_from(ranges.len()).unwrap(), 0.15, 0.0, 1);
        let beam = |(mounting, &range_m): (&crate::geometry::Mounting, &f64)| Beam {
            range_m,
            no_measurement: None,
            age_s: 0.0,
            robot_from_sensor: mounting.robot_from_sensor,
            half_angle_rad: 0.0,
        };
        Sweep { beams: ring.mountings.iter().zip(ranges).map(beam).collect(), odometry, ..Sweep::default() }
    }

    fn block(sweeps: &[Sweep]) -> PcaBlock {
        let mut block = PcaBlock::new(sweeps[0].beams.len(), MAX_RANGE_M);
        for sweep in sweeps {
            block.push(sweep);
        }
        block
    }

    fn three_sweeps(sensors: usize) -> impl Strategy<Value = Vec<Sweep>> {
        let one = (prop::collection::vec(0.1..2.9f64, sensors), -1.0..1.0f64, -1.0..1.0f64, -1.0..1.0f64);
        prop::collection::vec(one.prop_map(|(ranges, x, y, theta)| sweep(&ranges, Pose2::new(x, y, theta))), 3)
    }

    proptest! {
        #[test]
        fn motion_along_one_direction_leaves_nothing(
            start in prop::collection::vec(1.0..2.0f64, 8),
            rate in prop::collection::vec(-0.2..0.2f64, 8),
        ) {
            let at = |t: f64| {
                let ranges: Vec<f64> = start.iter().zip(&rate).map(|(s, r)| s + t * r).collect();
                sweep(&ranges, Pose2::new(0.3 * t, 0.1 * t, 0.05 * t))
            };
            let mut block = block(&[at(0.0), at(1.0), at(2.5)]);
            prop_assert!(block.analyse(|_, _| 1.0) < 1e-20);
            prop_assert!(block.residuals_m2().iter().all(|q| *q < 1e-20));
        }

        #[test]
        fn the_gram_matrix_finds_what_the_whole_covariance_finds(sweeps in three_sweeps(6)) {
            let mut block = block(&sweeps);
            let mspe = block.analyse(|_, _| 1.0);

            let m = DMatrix::from_fn(15, 3, |i, j| block.rows[i][j]);
            let c = DMatrix::from_fn(15, 3, |i, j| m[(i, j)] - m.row(i).mean());
            let eigen = (&c * c.transpose()).symmetric_eigen();
            let first = eigen.eigenvalues.imax();
            prop_assume!(eigen.eigenvalues.iter().filter(|v| 1.05 * **v > eigen.eigenvalues[first]).count() == 1);
            let u = eigen.eigenvectors.column(first);
            let lost = &c - u * (u.transpose() * &c);
            prop_assert!((mspe - lost.norm_squared() / 45.0).abs() < 1e-9);
            for sensor in 0..6 {
                let q = (lost.row(sensor).norm_squared() + lost.row(6 + sensor).norm_squared()) / 6.0;
                prop_assert!((block.residuals_m2()[sensor] - q).abs() < 1e-9);
            }
        }

        #[test]
        fn the_order_of_the_sensors_does_not_matter(sweeps in three_sweeps(7)) {
            let mut reversed = sweeps.clone();
            for sweep in &mut reversed {
                sweep.beams.reverse();
            }
            let (mut block, mut mirror) = (block(&sweeps), block(&reversed));
            prop_assert!((block.analyse(|_, _| 1.0) - mirror.analyse(|_, _| 1.0)).abs() < 1e-9);
            for (q, r) in block.residuals_m2().iter().zip(mirror.residuals_m2().iter().rev()) {
                prop_assert!((q - r).abs() < 1e-7);
            }
        }
    }

    #[test]
    fn elements_without_a_number_are_drawn_at_both_ends() {
        let odd = sweep(&[f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1.0], Pose2::default());
        let mut block = block(&[odd.clone(), odd.clone(), odd]);
        assert!(block.analyse(|_, _| 1.0) < 1e-20);
        assert!((block.rows[0][0] - 0.15).abs() < 1e-12, "missing: at the sensor");
        assert!((block.rows[5][0] - 3.15).abs() < 1e-12, "saturated: at the farthest range");
    }

    #[test]
    fn a_sweep_that_lacks_beams_is_no_danger() {
        let mut block = PcaBlock::new(4, MAX_RANGE_M);
        assert!(!block.push(&Sweep::default()) && !block.push(&Sweep::default()) && block.push(&Sweep::default()));
        assert!(block.analyse(|_, _| 1.0) < 1e-20);
    }

    #[test]
    fn a_heading_that_wraps_is_no_motion() {
        let at = |theta| sweep(&[1.0, 1.0], Pose2::new(0.0, 0.0, theta));
        let mut block = block(&[at(3.13), at(3.15), at(3.17)]);
        assert!(block.analyse(|_, _| 1.0) < 1e-20);
    }

    #[test]
    fn a_single_wild_sensor_hides_in_the_component_unless_its_variation_is_held_against_it() {
        let at = |t: f64, wild: f64| sweep(&[1.0 + t, 1.5 - t, 2.0 + t, wild], Pose2::new(t, 0.0, 0.0));
        let mut block = block(&[at(0.0, 1.0), at(0.1, 2.8), at(0.2, 0.4)]);
        block.analyse(|_, _| 1.0);
        let plain = block.residuals_m2().to_vec();
        block.analyse(|_, variation_m2| cauchy_weight(variation_m2, 0.001));
        let fair = block.residuals_m2();
        assert!(plain[3] < 0.01 && fair[3] > 0.1, "{plain:?} {fair:?}");
        assert!(fair[0] < 0.1 * plain[0], "{plain:?} {fair:?}");
    }
}
