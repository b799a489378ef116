//! Relative pose error (RPE): the difference between a step of the estimate and the same step of the
//! truth. Earlier errors do not matter.
//!
//! E_i = (Q_i⁻¹ Q_j)⁻¹ (P_i⁻¹ P_j) for true poses Q and estimates P, j = i + step, and i in steps, so that no two spans overlap
//! (Sturm et al., IROS 2012; as evo does without `--all_pairs`). No alignment is needed, because the
//! frames cancel.

use slamd_core::Pose2;

/// The errors over a whole run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelativeError {
    /// Root mean square of the error of a step's displacement, metres.
    pub translation_rmse_m: f64,
    /// Root mean square of the error of a step's turn, degrees.
    pub rotation_rmse_deg: f64,
}

/// The errors over steps of `step` pairs of (estimated, true) poses of the same instants; `None` if
/// there are too few pairs.
#[must_use]
pub fn relative_error(pairs: &[(Pose2, Pose2)], step: usize) -> Option<RelativeError> {
    let ends: Vec<&(Pose2, Pose2)> = pairs.iter().step_by(step.max(1)).collect();
    let errors = ends.windows(2).map(|ends| {
        let estimated = ends[0].0.inverse() * ends[1].0;
        let truth = ends[0].1.inverse() * ends[1].1;
        truth.inverse() * estimated
    });
    let (mut square_m2, mut square_rad2, mut count) = (0.0, 0.0, 0.0);
    for error in errors {
        square_m2 += error.x_m * error.x_m + error.y_m * error.y_m;
        square_rad2 += error.theta_rad * error.theta_rad;
        count += 1.0;
    }
    (count > 0.0).then(|| RelativeError {
        translation_rmse_m: (square_m2 / count).sqrt(),
        rotation_rmse_deg: (square_rad2 / count).sqrt().to_degrees(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The error of nine poses in another frame, the last four moved by `jump`, in steps of two.
    fn with(jump: Pose2) -> RelativeError {
        let frame = Pose2::new(3.0, 1.0, 0.8);
        let pair = |i: i32| {
            let truth = Pose2::new(f64::from(i), 0.0, 0.0);
            (if i < 5 { frame * truth } else { frame * truth * jump }, truth)
        };
        relative_error(&(0..9).map(pair).collect::<Vec<_>>(), 2).unwrap()
    }

    #[test]
    fn a_jump_counts_in_one_of_four_steps() {
        let moved = with(Pose2::new(0.3, 0.4, 0.0));
        assert!((moved.translation_rmse_m - 0.25).abs() < 1e-9 && moved.rotation_rmse_deg < 1e-9, "{moved:?}");
        let turned = with(Pose2::new(0.0, 0.0, 0.1));
        assert!((turned.rotation_rmse_deg - 0.05_f64.to_degrees()).abs() < 1e-9, "{turned:?}");
        // The last step of 2 m goes 0.1 rad off: a chord of 4 sin 0.05.
        assert!((turned.translation_rmse_m - 2.0 * libm::sin(0.05)).abs() < 1e-9, "{turned:?}");
    }

    #[test]
    fn one_pose_is_no_step() {
        assert_eq!(relative_error(&[(Pose2::default(), Pose2::default())], 1), None);
    }
}
