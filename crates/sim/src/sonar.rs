//! The ultrasonic sensors: each measures the nearest surface in its cone that returns the sound.
//!
//! Walls reflect ultrasound specularly: a wall returns sound only at incidences up to 30 degrees from
//! its normal. So a cone of ±12.5 degrees gets a return, at its edge, from a wall whose normal is up
//! to 42.5 degrees off the axis. Corners and ends of walls return sound to its source (Leonard and
//! Durrant-Whyte, 1992: planes, corners and edges).

use super::random::Random;
use super::world::{Segment, World, cast};
use nalgebra::Vector2;
use slamd_core::{Point, Pose2};

/// Maximum range, metres. Beyond it there is no echo.
pub const MAX_RANGE_M: f64 = 3.0;
/// Minimum range, metres.
pub const MIN_RANGE_M: f64 = 0.03;
/// Standard deviation of a reading, metres.
pub const NOISE_M: f64 = 0.02;
/// Half the opening angle of a cone beam, radians.
pub const CONE_HALF_ANGLE_RAD: f64 = 12.5 / 180.0 * std::f64::consts::PI;
/// Cosine of the maximum incidence at which a wall returns sound: 30 degrees.
pub(crate) const COS_MAX_INCIDENCE: f64 = 0.866_025_403_784_438_6;
/// Number of rays on each side of the cone's axis.
pub(crate) const FAN: i32 = 5;

/// The shape of the beams.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BeamShape {
    /// A cone, as real sensors have.
    #[default]
    Cone,
    /// One ray that every surface returns, as in the paper.
    Point,
}

impl BeamShape {
    /// The word used on the command line.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Cone => "cone",
            Self::Point => "point",
        }
    }

    /// Half the opening angle, radians.
    #[must_use]
    pub const fn half_angle_rad(self) -> f64 {
        match self {
            Self::Cone => CONE_HALF_ANGLE_RAD,
            Self::Point => 0.0,
        }
    }

    /// The true distance that a sensor at `world_from_sensor` measures, metres; `None` if nothing
    /// within [`MAX_RANGE_M`] returns the sound.
    #[must_use]
    pub fn distance(self, world: &World, world_from_sensor: Pose2) -> Option<f64> {
        let distance_m = match self {
            Self::Cone => cone_distance(world, world_from_sensor),
            Self::Point => {
                let direction = heading(world_from_sensor.theta_rad);
                cast(&world.segments, world_from_sensor.position(), direction)?.distance_m
            }
        };
        (distance_m <= MAX_RANGE_M).then_some(distance_m)
    }
}

impl std::str::FromStr for BeamShape {
    type Err = String;

    fn from_str(word: &str) -> Result<Self, String> {
        match word {
            "cone" => Ok(Self::Cone),
            "point" => Ok(Self::Point),
            _ => Err(format!("unknown beam \"{word}\": it is cone or point")),
        }
    }
}

/// A healthy sensor's reading of a surface at `distance_m`, metres; `None`: no echo. Every call draws
/// the same number of random numbers, so later readings do not depend on the distance.
pub fn reading(distance_m: Option<f64>, random: &mut Random) -> Option<f64> {
    let noise_m = NOISE_M * random.normal();
    let read_m = (distance_m? + noise_m).max(MIN_RANGE_M);
    (read_m <= MAX_RANGE_M).then_some(read_m)
}

pub(crate) fn heading(angle_rad: f64) -> Vector2<f64> {
    let (sin, cos) = libm::sincos(angle_rad);
    Vector2::new(cos, sin)
}

/// The distance of the nearest return in the cone; ∞ if there is none within [`MAX_RANGE_M`].
fn cone_distance(world: &World, world_from_sensor: Pose2) -> f64 {
    let origin = world_from_sensor.position();
    let axis = heading(world_from_sensor.theta_rad);
    let ahead = |point: Point| (point - origin).dot(&axis) > 0.0;
    let near: Vec<&Segment> = world
        .segments
        .iter()
        .filter(|segment| (ahead(segment.from) || ahead(segment.to)) && segment.distance(origin) <= MAX_RANGE_M)
        .collect();
    let cone = Cone { near, origin, axis };

    let mut nearest_m = f64::INFINITY;
    for &corner in &world.corners {
        nearest_m = cone.point_distance(corner, nearest_m);
    }
    for segment in &cone.near {
        // The foot of the perpendicular returns the sound. If it lies beyond the segment's end,
        // the nearest point is that end, a corner.
        nearest_m = cone.point_distance(segment.nearest(origin), nearest_m);
    }
    for ray in -FAN..=FAN {
        let offset_rad = CONE_HALF_ANGLE_RAD * f64::from(ray) / f64::from(FAN);
        let direction = heading(world_from_sensor.theta_rad + offset_rad);
        if let Some(hit) = cast(cone.near.iter().copied(), origin, direction)
            && hit.segment.normal().dot(&direction).abs() >= COS_MAX_INCIDENCE
        {
            nearest_m = nearest_m.min(hit.distance_m);
        }
    }
    nearest_m
}

/// A cone and the surfaces near it, which may return the sound or hide other surfaces.
struct Cone<'a> {
    near: Vec<&'a Segment>,
    origin: Point,
    axis: Vector2<f64>,
}

impl Cone<'_> {
    /// The distance of `point` if it is nearer than `nearest_m`, in the cone and in line of sight;
    /// otherwise `nearest_m`.
    fn point_distance(&self, point: Point, nearest_m: f64) -> f64 {
        let offset = point - self.origin;
        let distance_m = offset.norm();
        let cos_half_angle = 0.976_296_007_119_933_4;
        if distance_m >= nearest_m || distance_m < 1e-9 || offset.dot(&self.axis) < distance_m * cos_half_angle {
            return nearest_m;
        }
        let first = cast(self.near.iter().copied(), self.origin, offset / distance_m);
        let hidden = first.is_some_and(|hit| hit.distance_m < distance_m - 1e-6);
        if hidden { nearest_m } else { distance_m }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    fn world(walls: &[[f64; 4]]) -> World {
        let segments =
            walls.iter().map(|w| Segment { from: Point::new(w[0], w[1]), to: Point::new(w[2], w[3]) }).collect();
        World::new("test", segments, Point::origin(), None)
    }

    fn measured(world: &World, heading_deg: f64) -> Option<f64> {
        BeamShape::Cone.distance(world, Pose2::new(0.0, 0.0, heading_deg.to_radians()))
    }

    #[test]
    fn the_cosines_agree_with_their_angles() {
        assert!((libm::cos(30_f64.to_radians()) - COS_MAX_INCIDENCE).abs() < 1e-15);
        assert!((libm::cos(CONE_HALF_ANGLE_RAD) - 0.976_296_007_119_933_4).abs() < 1e-15);
    }

    #[test]
    fn a_wall_returns_its_perpendicular_distance_within_the_cone() {
        let wall = world(&[[2.0, -9.0, 2.0, 9.0]]);
        for heading_deg in [0.0, 5.0, -12.0] {
            assert!((measured(&wall, heading_deg).unwrap() - 2.0).abs() < 1e-9, "{heading_deg}");
        }
    }

    #[test]
    fn an_oblique_wall_returns_sound_at_the_cones_edge_up_to_the_maximum_incidence() {
        let wall = world(&[[2.0, -9.0, 2.0, 9.0]]);
        let edge = 2.0 / libm::cos(27.5_f64.to_radians());
        assert!((measured(&wall, 40.0).unwrap() - edge).abs() < 1e-9);
        assert_eq!(measured(&wall, 43.0), None);
    }

    #[test]
    fn corners_and_ends_always_return_sound() {
        let end = world(&[[1.0, 1.0, 9.0, 1.0]]);
        assert!((measured(&end, 45.0).unwrap() - 2_f64.sqrt()).abs() < 1e-9);
        let corner = world(&[[1.5, -9.0, 1.5, 1.5], [1.5, 1.5, -9.0, 1.5]]);
        assert!((measured(&corner, 45.0).unwrap() - 1.5 * 2_f64.sqrt()).abs() < 1e-9);
    }

    #[test]
    fn a_wall_hides_what_is_behind_it() {
        // The near wall reflects the sound away from the sensor and hides the far one.
        let hidden = world(&[[0.5, -1.0, 2.5, 1.0], [2.0, -9.0, 2.0, 9.0]]);
        let range = measured(&hidden, 0.0);
        assert!(range.is_none_or(|range| range < 1.5), "{range:?}");
    }

    #[test]
    fn three_metres_is_the_limit() {
        assert_eq!(measured(&world(&[[3.1, -9.0, 3.1, 9.0]]), 0.0), None);
        let point = world(&[[2.9, -9.0, 2.9, 9.0]]);
        let oblique = Pose2::new(0.0, 0.0, 0.2);
        assert!(BeamShape::Point.distance(&point, oblique).unwrap() > 2.9);
        assert_eq!(BeamShape::Point.distance(&point, Pose2::new(0.0, 0.0, 0.9)), None);
    }

    #[test]
    fn readings_stay_within_the_sensors_limits() {
        let mut random = Random::new(1, Stream::Sonar);
        for _ in 0..1000 {
            let near = reading(Some(0.02), &mut random).unwrap();
            assert!((MIN_RANGE_M..0.2).contains(&near));
            assert!(reading(Some(2.99), &mut random).is_none_or(|far| far <= MAX_RANGE_M));
            assert_eq!(reading(None, &mut random), None);
        }
    }
}
