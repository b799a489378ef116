//! The ranges that beams must measure if the robot is where the filter believes it is.

use super::beam_model::Side;
use super::ekf_slam::EkfSlam;
use crate::geometry::{Placement, nearest_quarter};
use crate::sweep::{Beam, Sweep};

impl EkfSlam {
    /// Predicts the range of each beam whose cone squarely holds a well-known wall.
    pub fn predict_ranges(&mut self, sweep: &Sweep) {
        self.expected.clear();
        let pose = Placement::from(self.filter.pose());
        for beam in &sweep.beams {
            self.expected.push(self.predict_range(pose, beam));
        }
    }

    /// The predicted range of one sensor, metres.
    #[must_use]
    pub fn expected_range_m(&self, sensor: usize) -> Option<f64> {
        self.expected(sensor).map(|(range_m, _)| range_m)
    }

    /// The same, with the wall that says so.
    pub(super) fn expected(&self, sensor: usize) -> Option<(f64, usize)> {
        self.expected.get(sensor).copied().flatten()
    }

    fn predict_range(&self, pose: Placement, beam: &Beam) -> Option<(f64, usize)> {
        let params = &self.params.slam;
        let sensor = pose * beam.robot_from_sensor;
        let (quarter, off_rad) = nearest_quarter(sensor.theta_rad);
        if off_rad.abs() > params.expect_cone_share * beam.half_angle_rad.max(params.min_expect_rad) {
            return None;
        }
        let side = Side::ALL[quarter];
        let (across_m, along_m) = side.split(sensor.position());
        let mut nearest: Option<(f64, usize)> = None;
        for (index, wall) in self.walls.iter().enumerate() {
            let is_known = wall.side == side && wall.hits >= params.well_known_hits;
            let inset_m = params.expect_inset_m;
            let faces = is_known && along_m > wall.lo_m + inset_m && along_m < wall.hi_m - inset_m;
            let depth_m = side.sign() * (self.filter.offset_m(index) - across_m);
            if faces && depth_m > params.min_expected_m && nearest.is_none_or(|(least_m, _)| depth_m < least_m) {
                nearest = Some((depth_m, index));
            }
        }
        nearest
    }
}
