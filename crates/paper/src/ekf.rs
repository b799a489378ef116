//! The paper's position filter: an EKF on x and y.
//!
//! | Symbol | Meaning | Here |
//! | --- | --- | --- |
//! | x | state | position in the map frame, metres |
//! | P | covariance of x | square metres |
//! | F | ∂(predicted x)/∂x | identity: the step does not depend on the position |
//! | Q | covariance of one step | grows with the distance rolled |
//! | z, h | measurement and its prediction | rho of a wall; mean of n · (x + R(theta) e) over the endpoints e on it |
//! | H | ∂h/∂x | nᵀ, the wall's unit normal |
//! | R | variance of z | of the mean of the endpoints, and of the wall |
//! | S, K | innovation variance H P Hᵀ + R, gain P Hᵀ / S | |
//!
//! Prediction: the encoders' step, turned by the heading from the walls. **The paper does not state its measurement model.**
//! slamd uses the minimum that the paper's parts allow: each line that the Hough transform finds in the local map
//! (10) is compared with the endpoints that fall near it, and only the offset along the line's normal is used. Offsets on one line
//! are fused before the update, for they share the line's error.
//!
//! Failure cases: fewer than [`Params::min_endpoints`] near a line, or an innovation outside the gate, change nothing; without any line the
//! covariance only grows. The heading's error is not in the state, so P is too small while the heading is wrong.

use crate::params::Params;
use nalgebra::{Matrix2, RowVector2, Vector2};
use slamd_core::Point;

/// The filter.
#[derive(Clone, Debug, PartialEq)]
pub struct PaperEkf {
    params: Params,
    x: Vector2<f64>,
    p: Matrix2<f64>,
}

impl PaperEkf {
    /// Knows its position, `start` in the map frame, to a millimetre.
    #[must_use]
    pub fn new(start: Point, params: Params) -> Self {
        Self { params, x: start.coords, p: Matrix2::identity() * 1e-6 }
    }

    /// The position in the map frame.
    #[must_use]
    pub fn position(&self) -> Point {
        Point::from(self.x)
    }

    /// P, square metres.
    #[must_use]
    pub fn covariance(&self) -> Matrix2<f64> {
        self.p
    }

    /// Moves by the encoders' step `step_m` (metres, robot frame before the step), turned by the heading before the step.
    pub fn predict(&mut self, heading_rad: f64, step_m: Vector2<f64>) {
        self.x += turned(heading_rad, step_m);
        self.p += Matrix2::identity() * (self.params.q_per_m * step_m.norm());
    }

    /// Compares the endpoints (metres, robot frame) near one line n · p = `rho_m` of the map frame, n at `normal_rad`, with the line.
    /// Returns the normalised innovation squared, or none where the line was not used.
    pub fn update(&mut self, heading_rad: f64, endpoints: &[Point], normal_rad: f64, rho_m: f64) -> Option<f64> {
        let n = turned(normal_rad, Vector2::x());
        let (count, offset) = self.offset(heading_rad, endpoints, n, rho_m)?;
        let Params { endpoint_sigma_m, line_sigma_m, gate, .. } = self.params;
        let r = endpoint_sigma_m * endpoint_sigma_m / count + line_sigma_m * line_sigma_m;

        let h: RowVector2<f64> = n.transpose();
        let innovation = -offset;
        let s = (h * self.p * h.transpose()).x + r;
        let nis = innovation * innovation / s;
        if nis > gate * gate {
            return None;
        }
        let k = self.p * h.transpose() / s;
        self.x += k * innovation;
        // Joseph form: symmetric and positive whatever the rounding.
        let i_kh = Matrix2::identity() - k * h;
        self.p = i_kh * self.p * i_kh.transpose() + k * r * k.transpose();
        self.p = 0.5 * (self.p + self.p.transpose());
        Some(nis)
    }

    /// h(x) − rho for the endpoints near the line: how many, and their mean offset along the normal, metres.
    fn offset(&self, heading_rad: f64, endpoints: &[Point], n: Vector2<f64>, rho_m: f64) -> Option<(f64, f64)> {
        let offsets = || {
            let offset = |e: &Point| n.dot(&(self.x + turned(heading_rad, e.coords))) - rho_m;
            endpoints.iter().map(offset).filter(|offset| offset.abs() < self.params.near_m)
        };
        let count = offsets().count();
        (count >= self.params.min_endpoints).then(|| (count as f64, offsets().sum::<f64>() / count as f64))
    }
}

/// A vector turned counter-clockwise.
fn turned(angle_rad: f64, v: Vector2<f64>) -> Vector2<f64> {
    let (sin, cos) = libm::sincos(angle_rad);
    Vector2::new(cos * v.x - sin * v.y, sin * v.x + cos * v.y)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Endpoints on the line n · p = rho as seen from `robot` under `heading`.
    fn seen(robot: Vector2<f64>, heading: f64, normal: f64, rho: f64) -> Vec<Point> {
        let (n, along) = (turned(normal, Vector2::x()), turned(normal, Vector2::y()));
        let in_map = (-3..=3).map(|t| n * rho + along * (0.4 * f64::from(t) + along.dot(&robot)));
        in_map.map(|p| Point::from(turned(-heading, p - robot))).collect()
    }

    proptest! {
        #[test]
        fn p_stays_symmetric_and_positive(steps in prop::collection::vec((-0.3..0.3f64, -3.1..3.1f64, -3.1..3.1f64), 1..60)) {
            let mut ekf = PaperEkf::new(Point::origin(), Params::default());
            for (step, heading, normal) in steps {
                ekf.predict(heading, Vector2::new(step, 0.1 * step));
                ekf.update(heading, &seen(ekf.x, heading, normal, 1.0 + 0.1 * step), normal, 1.0);
                let p = ekf.covariance();
                prop_assert_eq!(p, p.transpose());
                prop_assert!(p[(0, 0)] > 0.0 && p.determinant() > 0.0, "{p}");
            }
        }

        #[test]
        fn jacobians_equal_finite_differences(x in -2.0..2.0f64, y in -2.0..2.0f64, heading in -3.0..3.0f64, normal in 0.0..3.1f64) {
            let ends = seen(Vector2::new(x, y), heading, normal, 1.5);
            let n = turned(normal, Vector2::x());
            let h = |dx: f64, dy: f64| {
                PaperEkf::new(Point::new(x + dx, y + dy), Params::default()).offset(heading, &ends, n, 1.5).unwrap().1
            };
            let step = |dx: f64, dy: f64| {
                let mut ekf = PaperEkf::new(Point::new(x + dx, y + dy), Params::default());
                ekf.predict(heading, Vector2::new(0.2, -0.1));
                ekf.x
            };
            let d = 1e-5;
            prop_assert!(((h(d, 0.0) - h(-d, 0.0)) / (2.0 * d) - n.x).abs() < 1e-6);
            prop_assert!(((h(0.0, d) - h(0.0, -d)) / (2.0 * d) - n.y).abs() < 1e-6);
            prop_assert!(((step(d, 0.0) - step(-d, 0.0)) / (2.0 * d) - Vector2::x()).norm() < 1e-6);
            prop_assert!(((step(0.0, d) - step(0.0, -d)) / (2.0 * d) - Vector2::y()).norm() < 1e-6);
        }
    }

    #[test]
    fn two_walls_pull_a_wrong_position_home() {
        let truth = Vector2::new(0.4, -0.2);
        let mut ekf =
            PaperEkf { params: Params::default(), x: truth + Vector2::new(0.05, -0.04), p: Matrix2::identity() * 0.01 };
        for normal in [0.0, 1.5] {
            assert!(ekf.update(0.7, &seen(truth, 0.7, normal, 2.0), normal, 2.0).is_some());
        }
        assert!((ekf.x - truth).norm() < 0.01, "{}", ekf.x);
    }

    #[test]
    fn a_wall_beyond_the_gate_or_without_endpoints_changes_nothing() {
        let ekf = PaperEkf::new(Point::origin(), Params::default());
        let mut same = ekf.clone();
        assert_eq!(same.update(0.0, &seen(Vector2::zeros(), 0.0, 0.0, 2.0), 0.0, 2.15), None);
        assert_eq!(same.update(0.0, &[], 0.0, 2.0), None);
        assert_eq!(same, ekf);
    }
}
