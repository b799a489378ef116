//! Furniture: boxes along walls and at any angle, tables and chairs on legs, round and soft things.

use super::Disc;
use super::plan::{DOOR_SPACE_M, Plan, middle, sides};
use crate::floor_plan::{Rectangle, box_faces};
use crate::random::Random;
use crate::sonar::MAX_RANGE_M;
use crate::world::Segment;
use slamd_core::{Point, Pose2};
use std::f64::consts::{FRAC_PI_2, PI};

/// Radius of a leg, metres, and how far off it is heard.
const LEG_RADIUS_M: f64 = 0.02;
const LEG_REACH_M: f64 = 1.2;
/// Maximum share of a room's floor that furniture takes.
const MAX_SHARE: f64 = 0.3;
/// Distance between the points of a footprint that are compared with other things, metres.
const SPACING_M: f64 = 0.15;

/// What a piece is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// Hard faces: wardrobes, shelves, boxes.
    Hard,
    /// Soft faces: sofas, beds.
    Soft,
    /// Four legs: tables, chairs.
    Legs,
    /// One cylinder: plant pots, stools, bins.
    Round,
}

/// Kind, and minimum and maximum size along and away from the wall, metres.
const PIECES: [(Kind, [f64; 2], [f64; 2]); 9] = [
    (Kind::Hard, [0.8, 2.0], [0.4, 0.65]),
    (Kind::Hard, [0.6, 1.2], [0.3, 0.4]),
    (Kind::Hard, [0.3, 0.6], [0.3, 0.6]),
    (Kind::Soft, [1.5, 2.2], [0.8, 1.0]),
    (Kind::Soft, [0.9, 1.6], [1.9, 2.1]),
    (Kind::Legs, [0.9, 1.6], [0.7, 0.9]),
    (Kind::Legs, [0.4, 0.45], [0.4, 0.45]),
    (Kind::Legs, [0.4, 0.45], [0.4, 0.45]),
    (Kind::Round, [0.25, 0.7], [0.25, 0.7]),
];

/// One piece of furniture.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Piece {
    pub(super) hard: Vec<Segment>,
    pub(super) soft: Vec<Segment>,
    pub(super) discs: Vec<Disc>,
}

/// The floor that a piece takes.
#[derive(Clone, Copy, Debug)]
struct Footprint {
    world_from_piece: Pose2,
    size_m: [f64; 2],
}

impl Footprint {
    /// Points all over the footprint.
    fn points(&self) -> impl Iterator<Item = Point> + '_ {
        let count = self.size_m.map(|size_m| (1..40).find(|n| f64::from(*n) * SPACING_M >= size_m).unwrap_or(40));
        let at = move |step: i32, axis: usize| self.size_m[axis] * (f64::from(step) / f64::from(count[axis]) - 0.5);
        let rows = (0..=count[0]).flat_map(move |x| (0..=count[1]).map(move |y| (x, y)));
        rows.map(move |(x, y)| self.world_from_piece.transform(Point::new(at(x, 0), at(y, 1))))
    }

    fn distance(&self, point: Point) -> f64 {
        let local = self.world_from_piece.inverse().transform(point);
        let over = [local.x.abs() - 0.5 * self.size_m[0], local.y.abs() - 0.5 * self.size_m[1]].map(|m| m.max(0.0));
        libm::hypot(over[0], over[1])
    }

    fn area_m2(&self) -> f64 {
        self.size_m[0] * self.size_m[1]
    }
}

/// Furnishes every room of `plan`.
pub(super) fn furnish(plan: &Plan, random: &mut Random) -> Vec<Piece> {
    let mut pieces = Vec::new();
    for &room in &plan.rooms {
        let [width, height] = sides(room);
        if width.min(height) < 1.8 {
            // A hallway has at most a cupboard, which the robot could not pass.
            continue;
        }
        let mut taken: Vec<Footprint> = Vec::new();
        let mut wanted_m2 = width * height * random.uniform(0.3, 1.0) * MAX_SHARE;
        for _ in 0..40 {
            let (kind, footprint) = propose(room, random);
            if footprint.area_m2() > wanted_m2 || !fits(&footprint, room, plan, &taken) {
                continue;
            }
            wanted_m2 -= footprint.area_m2();
            taken.push(footprint);
            pieces.push(build(kind, &footprint));
        }
        if random.chance(0.35) {
            pieces.extend(curtain(room, plan, &taken, random));
        }
    }
    pieces
}

/// A piece somewhere in the room: mostly along a wall, sometimes turned.
fn propose(room: Rectangle, random: &mut Random) -> (Kind, Footprint) {
    let (kind, length, depth) = PIECES[random.below(PIECES.len())];
    let mut size_m = [length, depth].map(|[from, to]| random.uniform(from, to));
    if kind == Kind::Round {
        size_m[1] = size_m[0];
    }
    let is_free_standing = match kind {
        Kind::Legs => random.chance(0.8),
        Kind::Hard => random.chance(0.15),
        _ => random.chance(0.25),
    };
    let angle_rad = random.uniform(-PI, PI);
    let (x, y) = (random.uniform(room[0], room[2]), random.uniform(room[1], room[3]));
    if is_free_standing {
        let angle_rad = if random.chance(0.5) { angle_rad } else { 0.0 };
        return (kind, Footprint { world_from_piece: Pose2::new(x, y, angle_rad), size_m });
    }
    let gap_m = random.uniform(0.0, 0.04);
    let tilt_rad = if random.chance(0.12) { 0.15 * angle_rad } else { 0.0 };
    let room_m = 0.5 * (size_m[1] + size_m[0] * libm::sin(tilt_rad.abs())) + gap_m;
    let (point, wall_rad) = match random.below(4) {
        0 => (Point::new(x, room[1] + room_m), 0.0),
        1 => (Point::new(room[2] - room_m, y), FRAC_PI_2),
        2 => (Point::new(x, room[3] - room_m), PI),
        _ => (Point::new(room[0] + room_m, y), -FRAC_PI_2),
    };
    (kind, Footprint { world_from_piece: Pose2::new(point.x, point.y, wall_rad + tilt_rad), size_m })
}

/// True if the footprint lies in the room, away from openings, slanted walls and other pieces.
fn fits(footprint: &Footprint, room: Rectangle, plan: &Plan, taken: &[Footprint]) -> bool {
    let is_inside = |point: &Point| {
        (room[0] - 1e-9..=room[2] + 1e-9).contains(&point.x) && (room[1] - 1e-9..=room[3] + 1e-9).contains(&point.y)
    };
    let is_clear = |point: Point| {
        plan.slanted.iter().all(|wall| wall.distance(point) > 0.1)
            && taken.iter().all(|other| other.distance(point) > 0.03)
    };
    footprint.points().all(|point| is_inside(&point) && is_clear(point))
        && taken.iter().all(|other| footprint.distance(other.world_from_piece.position()) > 0.1)
        && plan.openings.iter().all(|opening| footprint.distance(opening.middle()) > DOOR_SPACE_M)
}

fn build(kind: Kind, footprint: &Footprint) -> Piece {
    let Footprint { world_from_piece, size_m } = *footprint;
    let faces = || box_faces(world_from_piece.position(), size_m, world_from_piece.theta_rad).to_vec();
    let leg = |x: f64, y: f64| Disc {
        centre: world_from_piece.transform(Point::new(x * (size_m[0] - 0.06), y * (size_m[1] - 0.06))),
        radius_m: LEG_RADIUS_M,
        reach_m: LEG_REACH_M,
    };
    match kind {
        Kind::Hard => Piece { hard: faces(), ..Piece::default() },
        Kind::Soft => Piece { soft: faces(), ..Piece::default() },
        Kind::Legs => {
            let discs = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)].map(|(x, y)| leg(x, y)).to_vec();
            Piece { discs, ..Piece::default() }
        }
        Kind::Round => {
            let centre = world_from_piece.position();
            let disc = Disc { centre, radius_m: 0.5 * size_m[0], reach_m: MAX_RANGE_M };
            Piece { discs: vec![disc], ..Piece::default() }
        }
    }
}

/// A curtain before a part of a wall.
fn curtain(room: Rectangle, plan: &Plan, taken: &[Footprint], random: &mut Random) -> Option<Piece> {
    let length_m = random.uniform(1.0, 2.2);
    let middle = middle(room);
    let (centre, angle_rad) = match random.below(4) {
        0 => (Point::new(middle.x, room[1] + 0.06), 0.0),
        1 => (Point::new(room[2] - 0.06, middle.y), FRAC_PI_2),
        2 => (Point::new(middle.x, room[3] - 0.06), 0.0),
        _ => (Point::new(room[0] + 0.06, middle.y), FRAC_PI_2),
    };
    let footprint = Footprint { world_from_piece: Pose2::new(centre.x, centre.y, angle_rad), size_m: [length_m, 0.02] };
    let end = |x: f64| footprint.world_from_piece.transform(Point::new(x, 0.0));
    let soft = vec![Segment { from: end(-0.5 * length_m), to: end(0.5 * length_m) }];
    fits(&footprint, room, plan, taken).then(|| Piece { soft, ..Piece::default() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    #[test]
    fn every_kind_occurs_and_stays_in_its_room() {
        let (mut hard, mut soft, mut legs, mut round, mut turned) = (0, 0, 0, 0, 0);
        for seed in 0..40 {
            let mut random = Random::new(seed, Stream::Home);
            let plan = Plan::draw(&mut random);
            let pieces = furnish(&plan, &mut random);
            for piece in &pieces {
                (hard, soft) = (hard + piece.hard.len(), soft + piece.soft.len());
                legs += piece.discs.iter().filter(|disc| disc.radius_m < 0.05).count();
                round += piece.discs.iter().filter(|disc| disc.radius_m > 0.05).count();
                let is_turned = |face: &Segment| face.normal().x.abs().min(face.normal().y.abs()) > 0.01;
                turned += usize::from(piece.hard.iter().any(is_turned));
                for face in piece.hard.iter().chain(&piece.soft) {
                    let is_in = |room: &Rectangle| {
                        let inside = |at: f64, from: f64, to: f64| (from - 1e-6..=to + 1e-6).contains(&at);
                        [face.from, face.to]
                            .iter()
                            .all(|end| inside(end.x, room[0], room[2]) && inside(end.y, room[1], room[3]))
                    };
                    assert!(plan.rooms.iter().any(is_in), "seed {seed}: {face:?}");
                }
            }
            assert!(pieces.len() > 2, "seed {seed}: {}", pieces.len());
        }
        assert!(
            [hard, soft, legs, round, turned].iter().all(|&count| count > 20),
            "{hard} {soft} {legs} {round} {turned}"
        );
    }
}
