//! What a person may want to see of the paper's method beside its results.

use super::Paper;
use crate::event::{SensorState, Verdict};
use crate::geometry::{Point, Segment};
use nalgebra::Vector2;

impl Paper {
    /// What became of a sensor's beam in the last sweep.
    #[must_use]
    pub fn verdict(&self, sensor: usize) -> Verdict {
        match self.detector.states().get(sensor) {
            Some(SensorState::Healthy) => Verdict::Used,
            Some(SensorState::Faulty(_)) => Verdict::Ignored,
            None => Verdict::Silent,
        }
    }

    /// The paper has no score for a sensor; the root of its chained PCA residual, metres.
    #[must_use]
    pub fn suspicion(&self, sensor: usize) -> (f64, f64) {
        (f64::NAN, self.detector.residual_m(sensor))
    }

    /// The local map's lines, as far as the local map reaches; their own uncertainty is not known.
    #[must_use]
    pub fn segments(&self) -> Vec<Segment> {
        let about = self.ekf.position();
        let lines = self.heading.map_lines().iter().map(|line| {
            let normal = line.normal();
            let along = Vector2::new(-normal.y, normal.x);
            let half_m = (self.reach_m * self.reach_m - line.rho_m * line.rho_m).max(0.0).sqrt();
            let foot: Point = about + line.rho_m * normal;
            Segment { from: foot - half_m * along, to: foot + half_m * along, sigma_m: 0.0 }
        });
        lines.collect()
    }

    /// Grows with every sweep that is drawn.
    #[must_use]
    pub fn revision(&self) -> u64 {
        self.sweeps
    }
}
