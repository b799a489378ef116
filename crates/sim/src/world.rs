//! The true world: surfaces as line segments, and ray casting.

use super::home::{Disc, Home};
use nalgebra::Vector2;
use slamd_core::Point;

/// A flat, vertical surface seen from above.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// One end, metres in the world frame.
    pub from: Point,
    /// The other end.
    pub to: Point,
}

impl Segment {
    /// The point of the segment that is nearest to `point`.
    #[must_use]
    pub fn nearest(&self, point: Point) -> Point {
        let along = self.to - self.from;
        let share = (point - self.from).dot(&along) / along.norm_squared();
        self.from + along * share.clamp(0.0, 1.0)
    }

    /// Metres from `point` to the segment.
    #[must_use]
    pub fn distance(&self, point: Point) -> f64 {
        (self.nearest(point) - point).norm()
    }

    /// A unit vector across the segment.
    #[must_use]
    pub fn normal(&self) -> Vector2<f64> {
        let along = (self.to - self.from).normalize();
        Vector2::new(-along.y, along.x)
    }

    /// Metres from `origin` along the unit vector `direction` to the segment, if the ray meets it.
    #[must_use]
    pub fn hit(&self, origin: Point, direction: Vector2<f64>) -> Option<f64> {
        let along = self.to - self.from;
        let across = direction.perp(&along);
        if across.abs() < 1e-12 {
            return None;
        }
        let offset = self.from - origin;
        let distance = offset.perp(&along) / across;
        let share = offset.perp(&direction) / across;
        // The tolerance keeps rays from passing between two segments that meet.
        (distance > 0.0 && (-1e-9..=1.0 + 1e-9).contains(&share)).then_some(distance)
    }
}

/// The first surface on a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Metres along the ray.
    pub distance_m: f64,
    /// The surface.
    pub segment: Segment,
}

/// Finds the nearest of `segments` on the ray from `origin` in the unit direction `direction`.
#[must_use]
pub fn cast<'a>(
    segments: impl IntoIterator<Item = &'a Segment>,
    origin: Point,
    direction: Vector2<f64>,
) -> Option<Hit> {
    segments
        .into_iter()
        .filter_map(|&segment| Some(Hit { distance_m: segment.hit(origin, direction)?, segment }))
        .min_by(|a, b| a.distance_m.total_cmp(&b.distance_m))
}

/// A world: its surfaces and the robot's start.
#[derive(Clone, Debug, PartialEq)]
pub struct World {
    /// Its name, as on the command line.
    pub name: String,
    /// Every surface.
    pub segments: Vec<Segment>,
    /// Where surfaces end or meet at an angle.
    pub corners: Vec<Point>,
    /// Where the robot starts.
    pub start: Point,
    /// Start heading, radians; random if absent.
    pub start_heading_rad: Option<f64>,
    /// What a random home has beyond its surfaces; absent in other worlds.
    pub home: Option<Box<Home>>,
}

impl World {
    /// A world of the given surfaces.
    #[must_use]
    pub fn new(name: &str, segments: Vec<Segment>, start: Point, start_heading_rad: Option<f64>) -> Self {
        let corners = corners(&segments);
        Self { name: name.into(), segments, corners, start, start_heading_rad, home: None }
    }

    /// Metres from `point` to the nearest surface; ∞ in a world without any.
    #[must_use]
    pub fn clearance(&self, point: Point) -> f64 {
        self.fixed_clearance(point).min(self.moving_clearance(point))
    }

    /// Metres from `point` to the nearest surface that does not move; ∞ if there is none.
    #[must_use]
    pub fn fixed_clearance(&self, point: Point) -> f64 {
        let walls_m = self.segments.iter().map(|segment| segment.distance(point)).fold(f64::INFINITY, f64::min);
        self.home.as_ref().map_or(walls_m, |home| walls_m.min(home.fixed_clearance(point)))
    }

    /// Metres from `point` to the nearest door leaf or person; ∞ if there is none.
    #[must_use]
    pub fn moving_clearance(&self, point: Point) -> f64 {
        self.home.as_ref().map_or(f64::INFINITY, |home| home.moving_clearance(point))
    }

    /// Every fixed surface as straight pieces; round things as octagons.
    #[must_use]
    pub fn outlines(&self) -> Vec<Segment> {
        let mut pieces = self.segments.clone();
        if let Some(home) = &self.home {
            pieces.extend(&home.soft);
            pieces.extend(home.discs.iter().flat_map(Disc::octagon));
        }
        pieces
    }

    /// The lower left and the upper right corner of the bounding box of all surfaces and the start.
    #[must_use]
    pub fn bounds(&self) -> (Point, Point) {
        let ends = self.segments.iter().flat_map(|segment| [segment.from, segment.to]);
        ends.fold((self.start, self.start), |(low, high), end| {
            (Point::new(low.x.min(end.x), low.y.min(end.y)), Point::new(high.x.max(end.x), high.y.max(end.y)))
        })
    }
}

/// The ends of `segments` without duplicates, and without those where a straight surface continues as
/// another segment.
fn corners(segments: &[Segment]) -> Vec<Point> {
    let mut found: Vec<Point> = Vec::new();
    for segment in segments {
        for end in [segment.from, segment.to] {
            let near = |point: Point| (point - end).norm() < 1e-6;
            let continues = segments.iter().any(|other| {
                other != segment
                    && (near(other.from) || near(other.to))
                    && other.normal().perp(&segment.normal()).abs() < 1e-6
            });
            if !continues && !found.iter().any(|&known| near(known)) {
                found.push(end);
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wall(x0: f64, y0: f64, x1: f64, y1: f64) -> Segment {
        Segment { from: Point::new(x0, y0), to: Point::new(x1, y1) }
    }

    #[test]
    fn a_ray_stops_at_the_first_surface() {
        let walls = [wall(3.0, -1.0, 3.0, 1.0), wall(2.0, -1.0, 2.0, 1.0), wall(1.0, 0.5, 1.0, 1.0)];
        let hit = cast(&walls, Point::origin(), Vector2::x()).unwrap();
        assert!((hit.distance_m - 2.0).abs() < 1e-12 && hit.segment == walls[1]);
        assert_eq!(cast(&walls, Point::origin(), -Vector2::x()), None);
    }

    #[test]
    fn clearance_is_the_distance_to_faces_and_ends() {
        let world = World::new("w", vec![wall(1.0, 0.0, 2.0, 0.0)], Point::origin(), None);
        assert!((world.clearance(Point::new(1.5, 0.3)) - 0.3).abs() < 1e-12);
        assert!((world.clearance(Point::origin()) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_joint_of_collinear_segments_is_no_corner() {
        let walls = vec![wall(0.0, 0.0, 1.0, 0.0), wall(1.0, 0.0, 2.0, 0.0), wall(2.0, 0.0, 2.0, 1.0)];
        let world = World::new("w", walls, Point::origin(), None);
        assert_eq!(world.corners, [Point::origin(), Point::new(2.0, 0.0), Point::new(2.0, 1.0)]);
    }
}
