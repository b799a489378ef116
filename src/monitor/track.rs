//! Where the robot has been, in bounded memory.

use slamd_core::Point;

/// The corners of a path, thinned out evenly where they become many.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Track {
    points: Vec<Point>,
    spacing_m: f64,
}

/// A small map shows no more.
const MAX_POINTS: usize = 1_000;
/// The first distance between two points, metres.
const SPACING_M: f64 = 0.05;

impl Track {
    /// Adds where the robot is now, unless it has hardly moved.
    pub fn push(&mut self, point: Point) {
        let spacing_m = self.spacing_m.max(SPACING_M);
        if self.points.last().is_some_and(|last| (point - last).norm() < spacing_m) {
            return;
        }
        self.points.push(point);
        if self.points.len() >= MAX_POINTS {
            let mut keep = false;
            self.points.retain(|_| {
                keep = !keep;
                keep
            });
            self.spacing_m = 2.0 * spacing_m;
        }
    }

    /// The corners, oldest first.
    pub(super) fn points(&self) -> &[Point] {
        &self.points
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_path_stays_small() {
        let mut track = Track::default();
        (0..100_000u32).for_each(|step| track.push(Point::new(0.02 * f64::from(step), 0.0)));
        let points = track.points();
        assert!(points.len() < MAX_POINTS && points.len() > MAX_POINTS / 4, "{}", points.len());
        assert!(points[0].x < 0.1 && points[points.len() - 1].x > 1_980.0, "{points:?}");
    }
}
