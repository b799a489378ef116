//! Errors of relative poses: the difference between the estimated and the known motion between two
//! instants.
//!
//! A relation is the robot's pose at one time, relative to its pose at another. The error is the known
//! relative pose, inverted, times the estimated one: its distance and its angle, averaged over the
//! relations (Kümmerle et al., On Measuring the Accuracy of SLAM Algorithms, 2009). No frames have to
//! be aligned, and an error at one location does not count again at all later ones.

use serde::Serialize;
use slamd_core::Pose2;

/// The robot's pose at `to_s`, in its frame at `from_s`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Relation {
    /// Seconds, on the trajectory's clock.
    pub from_s: f64,
    /// Seconds.
    pub to_s: f64,
    /// `robot_at_from_from_robot_at_to`.
    pub moved: Pose2,
}

impl Relation {
    /// Parses `t1 t2 x y z roll pitch yaw`; `None` for anything else.
    #[must_use]
    pub fn parse(line: &str) -> Option<Self> {
        let numbers: Vec<f64> = line.split_whitespace().map(|word| word.parse().ok()).collect::<Option<_>>()?;
        match numbers[..] {
            [from_s, to_s, x, y, _, _, _, yaw] => Some(Self { from_s, to_s, moved: Pose2::new(x, y, yaw) }),
            _ => None,
        }
    }
}

/// The errors over all relations within the trajectory's time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RelationError {
    /// Number of relations compared.
    pub relations: usize,
    /// Mean and median distance, metres.
    pub translation_m: [f64; 2],
    /// Mean and median turn, degrees.
    pub rotation_deg: [f64; 2],
}

/// Compares a trajectory, in the order of time in seconds, with the relations; `None` if it covers none
/// of them.
#[must_use]
pub fn relation_error(trajectory: &[(f64, Pose2)], relations: &[Relation]) -> Option<RelationError> {
    let (mut distances_m, mut turns_deg) = (Vec::new(), Vec::new());
    for relation in relations {
        let (Some(from), Some(to)) = (pose_at(trajectory, relation.from_s), pose_at(trajectory, relation.to_s)) else {
            continue;
        };
        let rest = relation.moved.inverse() * (from.inverse() * to);
        distances_m.push(libm::hypot(rest.x_m, rest.y_m));
        turns_deg.push(rest.theta_rad.abs().to_degrees());
    }
    Some(RelationError {
        relations: distances_m.len(),
        translation_m: mean_and_median(distances_m)?,
        rotation_deg: mean_and_median(turns_deg)?,
    })
}

/// The interpolated pose at a time; `None` before the first and after the last.
fn pose_at(trajectory: &[(f64, Pose2)], at_s: f64) -> Option<Pose2> {
    let after = trajectory.partition_point(|(t_s, _)| *t_s < at_s);
    let (t1_s, next) = *trajectory.get(after)?;
    if t1_s <= at_s {
        return Some(next);
    }
    let (t0_s, last) = *trajectory.get(after.checked_sub(1)?)?;
    let part = (at_s - t0_s) / (t1_s - t0_s);
    let moved = last.inverse() * next;
    Some(last * Pose2::new(part * moved.x_m, part * moved.y_m, part * moved.theta_rad))
}

fn mean_and_median(mut values: Vec<f64>) -> Option<[f64; 2]> {
    values.sort_by(f64::total_cmp);
    let median = *values.get(values.len() / 2)?;
    Some([values.iter().sum::<f64>() / values.len() as f64, median])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_does_not_depend_on_the_frame() {
        let frame = Pose2::new(3.0, -4.0, 2.0);
        let path: Vec<(f64, Pose2)> =
            (0..5).map(|i| (f64::from(i), frame * Pose2::new(f64::from(i), 0.0, 0.1 * f64::from(i)))).collect();
        let known = |from_s: f64, to_s: f64, x: f64| {
            let pose = |t: f64| Pose2::new(t, 0.0, 0.1 * t);
            Relation { from_s, to_s, moved: pose(from_s).inverse() * pose(to_s) * Pose2::new(x, 0.0, 0.0) }
        };
        let right = relation_error(&path, &[known(0.0, 3.0, 0.0), known(4.0, 1.0, 0.0)]).unwrap();
        assert!(right.translation_m[0] < 1e-12 && right.rotation_deg[0] < 1e-9, "{right:?}");
        let off = relation_error(&path, &[known(0.0, 3.0, 0.3), known(1.0, 2.0, 0.0), known(0.0, 9.0, 0.0)]).unwrap();
        assert_eq!(off.relations, 2);
        assert!((off.translation_m[0] - 0.15).abs() < 1e-12 && off.rotation_deg[0] < 1e-9, "{off:?}");
        assert_eq!(relation_error(&path, &[known(7.0, 9.0, 0.0)]), None);
    }

    #[test]
    fn poses_are_interpolated_across_half_a_turn() {
        let path = [(0.0, Pose2::new(0.0, 0.0, 3.1)), (1.0, Pose2::new(1.0, 0.0, -3.1))];
        let middle = pose_at(&path, 0.5).unwrap();
        assert!(middle.theta_rad.abs() > 3.13 && (middle.x_m - 0.5).abs() < 1e-9, "{middle:?}");
    }

    #[test]
    fn relations_are_parsed() {
        let relation = Relation::parse("1216.5 1217.25 0.4 -0.01 0 0 0 -0.07").unwrap();
        assert_eq!(relation, Relation { from_s: 1216.5, to_s: 1217.25, moved: Pose2::new(0.4, -0.01, -0.07) });
        assert_eq!(Relation::parse("1 2 3"), None);
    }
}
