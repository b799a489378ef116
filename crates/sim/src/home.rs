//! A random home: what `--world random` adds to hard, flat, fixed walls.
//!
//! The seed determines the home and everything that moves in it. Rooms and furniture come from
//! `plan` and `furniture`; doors and people move in `life`; `echo` holds the acoustics of round and
//! soft surfaces. Other worlds use none of this.

mod echo;
mod furniture;
mod life;
mod make;
mod noise;
mod plan;

pub(super) use echo::echo;
pub(super) use life::Life;
pub(super) use noise::Noise;

use super::floor_plan::Rectangle;
use super::world::Segment;
use nalgebra::Vector2;
use slamd_core::Point;

/// Radius of a person seen from above, metres.
pub const PERSON_RADIUS_M: f64 = 0.2;

/// What a home has beyond hard, flat, fixed surfaces.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Home {
    /// The rooms, without furniture.
    pub rooms: Vec<Rectangle>,
    /// Faces of sofas, beds and curtains: they return little sound.
    pub soft: Vec<Segment>,
    /// Round things and thin legs.
    pub discs: Vec<Disc>,
    /// Doors that open and close.
    pub doors: Vec<Door>,
    /// Where people stand now.
    pub people: Vec<Point>,
    /// Floors on which wheels slip.
    pub carpets: Vec<Carpet>,
    /// Times at which wheels spin in place.
    pub spins: Vec<Spin>,
    /// Probability that a ping reads a distance at which there is nothing.
    pub ghosts: f64,
    /// Probability that a ping hears another sensor of its group.
    pub crosstalk: f64,
}

/// A vertical cylinder seen from above.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disc {
    /// Its axis, metres in the world frame.
    pub centre: Point,
    /// Its radius, metres.
    pub radius_m: f64,
    /// Maximum distance at which it returns enough sound, metres.
    pub reach_m: f64,
}

impl Disc {
    /// Metres from `point` to the surface; negative inside.
    #[must_use]
    pub fn distance(&self, point: Point) -> f64 {
        (self.centre - point).norm() - self.radius_m
    }

    /// Eight chords around the disc.
    #[must_use]
    pub fn octagon(&self) -> [Segment; 8] {
        let corner = |index: usize| {
            let (sin, cos) = libm::sincos(std::f64::consts::FRAC_PI_4 * index as f64);
            self.centre + self.radius_m * Vector2::new(cos, sin)
        };
        std::array::from_fn(|index| Segment { from: corner(index), to: corner(index + 1) })
    }

    /// Metres from `origin` along the unit vector `direction` to the surface, if the ray meets it.
    #[must_use]
    pub fn hit(&self, origin: Point, direction: Vector2<f64>) -> Option<f64> {
        let offset = self.centre - origin;
        let (along, across) = (offset.dot(&direction), offset.perp(&direction));
        let half = self.radius_m * self.radius_m - across * across;
        (half >= 0.0).then(|| along - half.sqrt()).filter(|distance_m| *distance_m > 0.0)
    }
}

/// A door leaf that opens and closes by a timetable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Door {
    /// The hinge.
    pub hinge: Point,
    /// Direction from the hinge to the leaf's end when the door is closed, radians.
    pub closed_rad: f64,
    /// Rotation from closed to open, radians; negative: clockwise.
    pub opening_rad: f64,
    /// Width of the leaf, metres.
    pub width_m: f64,
    /// Length of the timetable, seconds. Then it repeats.
    pub period_s: f64,
    /// Seconds of each period for which the door stays closed.
    pub closed_s: f64,
    /// Time of the first closing, seconds from the session's start.
    pub first_s: f64,
    /// How far open the door is now: 0 closed, 1 open.
    pub openness: f64,
}

impl Door {
    /// The leaf now.
    #[must_use]
    pub fn leaf(&self) -> Segment {
        let (sin, cos) = libm::sincos(self.closed_rad + self.openness * self.opening_rad);
        Segment { from: self.hinge, to: self.hinge + self.width_m * Vector2::new(cos, sin) }
    }

    /// The middle of the door opening.
    #[must_use]
    pub fn middle(&self) -> Point {
        let (sin, cos) = libm::sincos(self.closed_rad);
        self.hinge + 0.5 * self.width_m * Vector2::new(cos, sin)
    }

    /// True while the timetable wants the door closed.
    #[must_use]
    pub fn is_to_close(&self, now_s: f64) -> bool {
        let since_s = now_s - self.first_s;
        since_s >= 0.0 && libm::fmod(since_s, self.period_s) < self.closed_s
    }
}

/// A carpet: the robot gets less far than its wheels turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Carpet {
    /// Where it lies.
    pub area: Rectangle,
    /// Share of the forward motion that is lost.
    pub forward_loss: f64,
    /// Share of the rotation that is lost.
    pub turn_loss: f64,
}

/// Wheels that spin in place: they turn, the robot does not move with them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spin {
    /// Start, seconds from the session's start.
    pub from_s: f64,
    /// End, seconds from the session's start.
    pub until_s: f64,
    /// Which wheels spin: left and right.
    pub wheels: [bool; 2],
}

/// How well the wheels grip the floor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grip {
    /// True forward motion as a share of what the wheels roll.
    pub forward: f64,
    /// True rotation as a share of what the wheels roll.
    pub turn: f64,
    /// Which wheels spin in place: left and right.
    pub spins: [bool; 2],
}

impl Grip {
    /// The wheels roll as they turn.
    pub const FULL: Self = Self { forward: 1.0, turn: 1.0, spins: [false; 2] };
}

impl Home {
    /// The grip of the floor at `point` at `now_s` seconds.
    #[must_use]
    pub fn grip(&self, point: Point, now_s: f64) -> Grip {
        let lies_at = |carpet: &&Carpet| {
            let [left, lower, right, upper] = carpet.area;
            (left..right).contains(&point.x) && (lower..upper).contains(&point.y)
        };
        let carpet = self.carpets.iter().find(lies_at);
        let spin = self.spins.iter().find(|spin| (spin.from_s..spin.until_s).contains(&now_s));
        Grip {
            forward: carpet.map_or(1.0, |carpet| 1.0 - carpet.forward_loss),
            turn: carpet.map_or(1.0, |carpet| 1.0 - carpet.turn_loss),
            spins: spin.map_or([false; 2], |spin| spin.wheels),
        }
    }

    /// Metres from `point` to the nearest soft or round surface that does not move; ∞ if there is none.
    #[must_use]
    pub fn fixed_clearance(&self, point: Point) -> f64 {
        let soft = self.soft.iter().map(|segment| segment.distance(point));
        soft.chain(self.discs.iter().map(|disc| disc.distance(point))).fold(f64::INFINITY, f64::min)
    }

    /// Metres from `point` to the nearest door leaf or person; ∞ if there is none.
    #[must_use]
    pub fn moving_clearance(&self, point: Point) -> f64 {
        let doors = self.doors.iter().map(|door| door.leaf().distance(point));
        let people = self.people.iter().map(|person| (person - point).norm() - PERSON_RADIUS_M);
        doors.chain(people).fold(f64::INFINITY, f64::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use crate::robot::BODY_RADIUS_M;
    use crate::simulation::{SimConfig, Simulation, session};

    use crate::world::World;
    use slamd_capture::Record;
    use slamd_core::Pose2;

    fn door() -> Door {
        Door {
            hinge: Point::origin(),
            closed_rad: 0.0,
            opening_rad: std::f64::consts::FRAC_PI_2,
            width_m: 0.8,
            period_s: 60.0,
            closed_s: 20.0,
            first_s: 30.0,
            openness: 1.0,
        }
    }

    #[test]
    fn a_door_closes_by_its_timetable() {
        let closed: Vec<bool> = [0.0, 29.0, 31.0, 49.0, 51.0, 91.0].map(|s| door().is_to_close(s)).into();
        assert_eq!(closed, [false, false, true, true, false, true]);
        assert!((door().leaf().to - Point::new(0.0, 0.8)).norm() < 1e-12);
        assert!((Door { openness: 0.0, ..door() }.leaf().to - Point::new(0.8, 0.0)).norm() < 1e-12);
    }

    #[test]
    fn a_carpet_and_a_spin_take_grip_where_and_when_they_are() {
        let home = Home {
            carpets: vec![Carpet { area: [0.0, 0.0, 1.0, 1.0], forward_loss: 0.03, turn_loss: 0.1 }],
            spins: vec![Spin { from_s: 5.0, until_s: 6.0, wheels: [true, false] }],
            ..Home::default()
        };
        assert_eq!(home.grip(Point::new(2.0, 0.5), 1.0), Grip::FULL);
        let grip = home.grip(Point::new(0.5, 0.5), 5.5);
        assert!((grip.forward - 0.97).abs() < 1e-12 && (grip.turn - 0.9).abs() < 1e-12);
        assert_eq!(grip.spins, [true, false]);
    }

    #[test]
    fn a_ray_meets_the_near_side_of_a_disc() {
        let disc = Disc { centre: Point::new(2.0, 0.1), radius_m: 0.3, reach_m: 3.0 };
        let near_m = disc.hit(Point::origin(), Vector2::x()).unwrap();
        assert!((near_m - (2.0 - (0.09_f64 - 0.01).sqrt())).abs() < 1e-12);
        assert_eq!(disc.hit(Point::origin(), Vector2::y()), None);
        assert_eq!(disc.hit(Point::origin(), -Vector2::x()), None);
    }

    #[test]
    fn the_robot_drives_through_random_homes_and_touches_nothing() {
        for seed in 1..=4 {
            let world = World::random(seed);
            let simulation = Simulation::new(SimConfig::usual(world.clone(), seed, 120.0, 1));
            let truths: Vec<Pose2> = session(simulation)
                .filter_map(|record| if let Record::Truth { pose, .. } = record { Some(pose) } else { None })
                .collect();
            let nearest_m =
                truths.iter().map(|pose| world.fixed_clearance(pose.position())).fold(f64::INFINITY, f64::min);
            assert!(nearest_m > BODY_RADIUS_M, "seed {seed}: {nearest_m} m");
            let way_m: f64 = truths.windows(2).map(|pair| (pair[1].position() - pair[0].position()).norm()).sum();
            assert!(way_m > 12.0, "seed {seed}: {way_m} m");
        }
    }
}
