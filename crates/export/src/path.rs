//! The way so far, for `/path`: thinned out, and written when it has grown by a share, so that a bag stays small.

use super::message::{MAP, Stamp, pose, stamped, with_header};
use slamd_core::Pose2;

/// Poses nearer to the last than this are left out, metres and radians.
const STEP_M: f64 = 0.05;
const STEP_RAD: f64 = 0.2;
/// The path is written again when it has so many poses more: all messages together are some eleven times as long as the last.
const GROWTH: f64 = 1.1;
const MIN_GROWTH: usize = 10;

/// The poses of the path.
#[derive(Debug, Default)]
pub(super) struct Path {
    poses: Vec<(Stamp, Pose2)>,
    written: usize,
}

impl Path {
    pub(super) fn push(&mut self, at: Stamp, pose: Pose2) {
        let is_near = self.poses.last().is_some_and(|(_, last)| {
            let step = last.inverse() * pose;
            step.position().coords.norm() < STEP_M && step.theta_rad.abs() < STEP_RAD
        });
        if !is_near {
            self.poses.push((at, pose));
        }
    }

    /// True if it has grown enough since it was written.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a number of poses")]
    pub(super) fn is_due(&self) -> bool {
        self.poses.len() >= (self.written + MIN_GROWTH).max((GROWTH * self.written as f64) as usize)
    }

    /// True if it has poses that were not written.
    pub(super) fn has_news(&self) -> bool {
        self.poses.len() > self.written
    }

    /// `nav_msgs/msg/Path`.
    pub(super) fn message(&mut self, at: Stamp) -> Vec<u8> {
        self.written = self.poses.len();
        let mut cdr = with_header(at, MAP);
        cdr.count(self.poses.len());
        for (at, place) in &self.poses {
            stamped(&mut cdr, *at, MAP);
            pose(&mut cdr, *place);
        }
        cdr.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_is_thinned_and_written_rarely() {
        let mut path = Path::default();
        let mut bytes = 0;
        for k in 0..20_000u32 {
            path.push(Stamp(u64::from(k)), Pose2::new(0.01 * f64::from(k), 0.0, 0.0));
            if path.is_due() {
                bytes += path.message(Stamp(u64::from(k))).len();
            }
        }
        let last = path.message(Stamp(20_000)).len();
        assert!(path.poses.len() <= 4_000 && !path.has_news());
        assert!(bytes < 12 * last, "{bytes} for {last}");
    }
}
