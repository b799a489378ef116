//! Echoes in a home: as `sonar` for walls, and from round, soft and moving surfaces.
//!
//! Soft and thin things return sound only from near by. They still hide what is behind them, apart
//! from legs, around which the sound bends.

use super::{Disc, Home, PERSON_RADIUS_M};
use crate::sonar::{BeamShape, CONE_HALF_ANGLE_RAD, COS_MAX_INCIDENCE, FAN, MAX_RANGE_M, heading};
use crate::world::{Segment, World};
use nalgebra::Vector2;
use slamd_core::{Point, Pose2};

/// Maximum distance at which a soft surface returns enough sound, metres.
const SOFT_REACH_M: f64 = 1.3;
/// Maximum distance at which a clothed person returns enough sound, metres.
const PERSON_REACH_M: f64 = 2.0;
/// A disc of a smaller radius hides nothing, metres.
const THIN_M: f64 = 0.05;

/// One return.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Echo {
    /// Distance of the surface, metres.
    pub(crate) distance_m: f64,
    /// The surface returns little sound.
    pub(crate) is_weak: bool,
}

/// A surface near the sensor.
#[derive(Clone, Copy)]
enum Surface {
    Flat(Segment, f64),
    Round(Disc),
}

impl Surface {
    fn reach_m(&self) -> f64 {
        match self {
            Self::Flat(_, reach_m) => *reach_m,
            Self::Round(disc) => disc.reach_m,
        }
    }

    fn distance(&self, point: Point) -> f64 {
        match self {
            Self::Flat(segment, _) => segment.distance(point),
            Self::Round(disc) => disc.distance(point),
        }
    }

    fn nearest(&self, point: Point) -> Point {
        match self {
            Self::Flat(segment, _) => segment.nearest(point),
            Self::Round(disc) => disc.centre - (disc.centre - point).normalize() * disc.radius_m,
        }
    }

    fn hit(&self, origin: Point, direction: Vector2<f64>) -> Option<f64> {
        match self {
            Self::Flat(segment, _) => segment.hit(origin, direction),
            Self::Round(disc) => disc.hit(origin, direction),
        }
    }

    fn normal(&self, at: Point) -> Vector2<f64> {
        match self {
            Self::Flat(segment, _) => segment.normal(),
            Self::Round(disc) => (at - disc.centre).normalize(),
        }
    }

    fn is_thin(&self) -> bool {
        matches!(self, Self::Round(disc) if disc.radius_m < THIN_M)
    }
}

/// The surfaces within range of a sensor.
struct Scene {
    near: Vec<Surface>,
    origin: Point,
    axis: Vector2<f64>,
}

/// The echo that a sensor at `world_from_sensor` hears; `None` if nothing returns enough sound.
pub(crate) fn echo(beam: BeamShape, world: &World, home: &Home, world_from_sensor: Pose2) -> Option<Echo> {
    let origin = world_from_sensor.position();
    let leaves: Vec<Segment> = home.doors.iter().map(super::Door::leaf).collect();
    let hard = world.segments.iter().chain(&leaves).map(|&segment| Surface::Flat(segment, MAX_RANGE_M));
    let soft = home.soft.iter().map(|&segment| Surface::Flat(segment, SOFT_REACH_M));
    let people = home.people.iter().map(|&centre| Disc { centre, radius_m: PERSON_RADIUS_M, reach_m: PERSON_REACH_M });
    let round = home.discs.iter().copied().chain(people).map(Surface::Round);
    let near = hard.chain(soft).chain(round).filter(|surface| surface.distance(origin) <= MAX_RANGE_M).collect();
    let scene = Scene { near, origin, axis: heading(world_from_sensor.theta_rad) };
    let nearest = match beam {
        BeamShape::Point => scene.first(scene.axis).map(|(distance_m, surface)| scene.weigh(distance_m, &surface)),
        BeamShape::Cone => {
            let ends = leaves.iter().flat_map(|leaf| [leaf.from, leaf.to]);
            let corners = world.corners.iter().copied().chain(ends);
            scene.cone(corners, world_from_sensor.theta_rad)
        }
    };
    nearest.filter(|echo| echo.distance_m <= MAX_RANGE_M)
}

impl Scene {
    /// The first surface on a ray that is not thin.
    fn first(&self, direction: Vector2<f64>) -> Option<(f64, Surface)> {
        let hits = self.near.iter().filter(|surface| !surface.is_thin());
        let hits = hits.filter_map(|surface| Some((surface.hit(self.origin, direction)?, *surface)));
        hits.min_by(|a, b| a.0.total_cmp(&b.0))
    }

    fn weigh(&self, distance_m: f64, surface: &Surface) -> Echo {
        Echo { distance_m, is_weak: surface.reach_m() < MAX_RANGE_M }
    }

    /// The nearest return in the cone.
    fn cone(&self, corners: impl Iterator<Item = Point>, axis_rad: f64) -> Option<Echo> {
        let mut nearest: Option<Echo> = None;
        let mut keep = |echo: Option<Echo>| {
            if let Some(echo) = echo
                && nearest.is_none_or(|known| echo.distance_m < known.distance_m)
            {
                nearest = Some(echo);
            }
        };
        for corner in corners {
            let seen_m = self.seen(corner);
            keep(seen_m.map(|distance_m| Echo { distance_m, is_weak: false }));
        }
        for surface in &self.near {
            let seen_m = self.seen(surface.nearest(self.origin)).filter(|&distance_m| distance_m <= surface.reach_m());
            keep(seen_m.map(|distance_m| self.weigh(distance_m, surface)));
        }
        for ray in -FAN..=FAN {
            let direction = heading(axis_rad + CONE_HALF_ANGLE_RAD * f64::from(ray) / f64::from(FAN));
            let Some((distance_m, surface)) = self.first(direction) else { continue };
            let normal = surface.normal(self.origin + direction * distance_m);
            if normal.dot(&direction).abs() >= COS_MAX_INCIDENCE && distance_m <= surface.reach_m() {
                keep(Some(self.weigh(distance_m, &surface)));
            }
        }
        nearest
    }

    /// The distance of a point in the cone and in line of sight.
    fn seen(&self, point: Point) -> Option<f64> {
        let offset = point - self.origin;
        let distance_m = offset.norm();
        let is_in_cone = offset.dot(&self.axis) >= distance_m * libm::cos(CONE_HALF_ANGLE_RAD);
        if !(1e-9..=MAX_RANGE_M).contains(&distance_m) || !is_in_cone {
            return None;
        }
        let direction = offset / distance_m;
        let is_hidden = |surface: &Surface| {
            !surface.is_thin() && surface.hit(self.origin, direction).is_some_and(|first_m| first_m < distance_m - 1e-6)
        };
        (!self.near.iter().any(is_hidden)).then_some(distance_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wall(x: f64) -> Segment {
        Segment { from: Point::new(x, -5.0), to: Point::new(x, 5.0) }
    }

    fn heard(home: &Home, walls: &[Segment]) -> Option<Echo> {
        let world = World::new("test", walls.to_vec(), Point::origin(), None);
        echo(BeamShape::Cone, &world, home, Pose2::default())
    }

    #[test]
    fn a_hard_wall_sounds_as_in_other_worlds() {
        let world = World::new("test", vec![wall(2.0), wall(2.5)], Point::origin(), None);
        for turn_deg in [0.0, 10.0, 35.0, 41.0, 50.0] {
            let sensor = Pose2::new(0.0, 0.3, f64::to_radians(turn_deg));
            let here = echo(BeamShape::Cone, &world, &Home::default(), sensor).map(|echo| echo.distance_m);
            assert_eq!(here, BeamShape::Cone.distance(&world, sensor), "{turn_deg}");
        }
    }

    #[test]
    fn soft_surfaces_answer_from_near_by_and_hide_the_wall() {
        let soft = |x| Home { soft: vec![wall(x)], ..Home::default() };
        assert_eq!(heard(&soft(1.0), &[wall(2.0)]), Some(Echo { distance_m: 1.0, is_weak: true }));
        assert_eq!(heard(&soft(1.5), &[wall(2.0)]), None);
    }

    #[test]
    fn a_leg_answers_and_hides_nothing_and_a_person_hides() {
        let disc = |x, radius_m| Disc { centre: Point::new(x, 0.0), radius_m, reach_m: 1.2 };
        let home = |disc| Home { discs: vec![disc], ..Home::default() };
        let near = heard(&home(disc(1.0, 0.02)), &[wall(2.0)]).unwrap();
        assert!((near.distance_m - 0.98).abs() < 1e-9);
        assert!((heard(&home(disc(1.5, 0.02)), &[wall(2.0)]).unwrap().distance_m - 2.0).abs() < 1e-9);
        let person = Home { people: vec![Point::new(2.3, 0.0)], ..Home::default() };
        assert!(heard(&person, &[wall(2.9)]).is_none_or(|echo| echo.distance_m > 2.9));
    }
}
