//! A path for a picture: bounded memory however long the run.

use slamd_core::{Point, Timestamp};

/// The corners of a path, thinned out evenly where they become many, and its whole length.
#[derive(Clone, Debug, Default)]
pub(super) struct Track {
    points: Vec<(Timestamp, Point)>,
    /// The newest point, whether it is kept or not.
    last: Option<(Timestamp, Point)>,
    length_m: f64,
    spacing_m: f64,
}

impl Track {
    pub(super) fn push(&mut self, at: Timestamp, point: Point) {
        self.length_m += self.last.map_or(0.0, |(_, last)| (point - last).norm());
        self.last = Some((at, point));
        if self.points.last().is_some_and(|(_, kept)| (point - kept).norm() <= self.spacing_m) {
            return;
        }
        self.points.push((at, point));
        if self.points.len() >= MAX_POINTS {
            let mut keep = false;
            self.points.retain(|_| {
                keep = !keep;
                keep
            });
            self.spacing_m = (2.0 * self.spacing_m).max(0.01);
        }
    }

    /// The kept corners, and the newest point.
    pub(super) fn points(&self) -> Vec<Point> {
        self.timed().map(|(_, point)| point).collect()
    }

    /// The same with their times.
    pub(super) fn timed(&self) -> impl Iterator<Item = (Timestamp, Point)> {
        self.points.iter().chain(&self.last).copied()
    }

    /// The time of the newest point.
    pub(super) fn last_at(&self) -> Option<Timestamp> {
        self.last.map(|(at, _)| at)
    }

    /// The length of the whole path, metres.
    pub(super) const fn length_m(&self) -> f64 {
        self.length_m
    }
}

/// A picture shows no more.
const MAX_POINTS: usize = 20_000;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_path_keeps_its_ends_and_its_length() {
        let mut track = Track::default();
        for i in 0..1_000_000u32 {
            track.push(Timestamp::from_us(u64::from(i)), Point::new(f64::from(i) * 0.01, 0.0));
        }
        let points = track.points();
        assert!(points.len() <= MAX_POINTS && points.len() > MAX_POINTS / 4, "{}", points.len());
        assert!((track.length_m() - 9999.99).abs() < 1e-6);
        assert!(points[0].x.abs() < 1e-12 && (points[points.len() - 1].x - 9999.99).abs() < 1e-9);
    }
}
