//! Makes a random home: plan, furniture, doors, people, carpets, and what disturbs readings and wheels.

use super::furniture::{Piece, furnish};
use super::plan::{Opening, Plan, sides};
use super::{Carpet, Door, Home, Spin};
use crate::floor_plan::Rectangle;
use crate::random::{Random, Stream};
use crate::route::{MIN_CLEARANCE_M, RouteGrid};
use crate::world::World;
use slamd_core::Point;
use std::f64::consts::{FRAC_PI_2, PI};

/// Minimum distance between the start and everything, metres.
const START_CLEARANCE_M: f64 = 0.4;
/// Probability that an opening has a leaf, and that the leaf moves.
const LEAF: f64 = 0.7;
const LEAF_MOVES: f64 = 0.5;
/// Probability that people walk about; that there are two of them.
const PEOPLE: f64 = 0.5;
const SECOND_PERSON: f64 = 0.4;
/// Probability that wheels spin in place now and then, and the mean time between two spins, seconds.
const SPINS: f64 = 0.35;
const SPIN_PERIOD_S: (f64, f64) = (60.0, 180.0);
/// Spins are drawn up to this time, seconds.
const SPIN_UNTIL_S: f64 = 3600.0;

impl World {
    /// The name of the world that is another home for each seed.
    pub const RANDOM: &'static str = "random";

    /// The built-in world of that name for a drive of that seed: `random` or one of [`World::BUILT_IN`].
    #[must_use]
    pub fn for_seed(name: &str, seed: u64) -> Option<Self> {
        if name == Self::RANDOM { Some(Self::random(seed)) } else { Self::named(name) }
    }

    /// The random home of a seed.
    #[must_use]
    pub fn random(seed: u64) -> Self {
        let mut random = Random::new(seed, Stream::Home);
        loop {
            if let Some(world) = Self::try_random(&mut random) {
                return world;
            }
        }
    }

    /// A home; none if the robot cannot reach every room even without furniture.
    fn try_random(random: &mut Random) -> Option<Self> {
        let plan = Plan::draw(random);
        let mut pieces = furnish(&plan, random);
        let (home, leaves) = fittings(&plan, random);
        let shares: Vec<[f64; 3]> = (0..60).map(|_| [(); 3].map(|()| random.uniform(0.0, 1.0))).collect();
        // The last pieces go until the robot can reach every door.
        let mut world = assemble(&plan, &leaves, &pieces, &home, &shares);
        while !is_passable(&world, &plan) {
            pieces.pop()?;
            world = assemble(&plan, &leaves, &pieces, &home, &shares);
        }
        let people = people(&world, random);
        world.home = world.home.map(|home| Box::new(Home { people, ..*home }));
        Some(world)
    }
}

/// Doors, carpets and disturbances; and the leaves that do not move.
fn fittings(plan: &Plan, random: &mut Random) -> (Home, Vec<Door>) {
    let mut home = Home { rooms: plan.rooms.clone(), ..Home::default() };
    let mut leaves = Vec::new();
    for opening in &plan.openings {
        let door = door(opening, random);
        let (has_leaf, moves) = (random.chance(LEAF), random.chance(LEAF_MOVES));
        match (has_leaf, moves) {
            (true, true) => home.doors.push(door),
            (true, false) => leaves.push(door),
            (false, _) => {}
        }
    }
    for _ in 0..random.below(3) {
        let room = plan.rooms[random.below(plan.rooms.len())];
        home.carpets.push(Carpet {
            area: patch(room, random),
            forward_loss: random.uniform(0.01, 0.04),
            turn_loss: random.uniform(0.03, 0.1),
        });
    }
    home.ghosts = random.uniform(0.0, 0.004);
    home.crosstalk = random.uniform(0.0, 0.008);
    if random.chance(SPINS) {
        let mut at_s = random.uniform(20.0, SPIN_PERIOD_S.1);
        while at_s < SPIN_UNTIL_S {
            let wheels = [[true, true], [true, false], [false, true]][random.below(3)];
            home.spins.push(Spin { from_s: at_s, until_s: at_s + random.uniform(0.5, 1.2), wheels });
            at_s += random.uniform(SPIN_PERIOD_S.0, SPIN_PERIOD_S.1);
        }
    }
    (home, leaves)
}

/// A door in an opening, hinged on either jamb and opening to either side.
fn door(opening: &Opening, random: &mut Random) -> Door {
    let [left, lower, right, upper] = opening.area;
    let (is_far, is_back) = (random.chance(0.5), random.chance(0.5));
    let middle = opening.middle();
    let (hinge, closed_rad) = match (opening.is_along_y, is_far) {
        (true, false) => (Point::new(middle.x, lower), FRAC_PI_2),
        (true, true) => (Point::new(middle.x, upper), -FRAC_PI_2),
        (false, false) => (Point::new(left, middle.y), 0.0),
        (false, true) => (Point::new(right, middle.y), PI),
    };
    let opening_rad = random.uniform(1.45, 1.75) * if is_back { -1.0 } else { 1.0 };
    let period_s = random.uniform(50.0, 140.0);
    Door {
        hinge,
        closed_rad,
        opening_rad,
        width_m: opening.width_m() - 0.02,
        period_s,
        closed_s: random.uniform(10.0, 0.4 * period_s),
        first_s: random.uniform(10.0, 80.0),
        openness: 1.0,
    }
}

/// A rectangle in a room.
fn patch(room: Rectangle, random: &mut Random) -> Rectangle {
    let [width, height] = sides(room);
    let size = [random.uniform(0.4, 0.8) * width, random.uniform(0.4, 0.8) * height];
    let left = room[0] + random.uniform(0.0, 1.0) * (width - size[0]);
    let lower = room[1] + random.uniform(0.0, 1.0) * (height - size[1]);
    [left, lower, left + size[0], lower + size[1]]
}

fn assemble(plan: &Plan, leaves: &[Door], pieces: &[Piece], home: &Home, start_shares: &[[f64; 3]]) -> World {
    let mut faces = plan.faces();
    faces.extend(leaves.iter().map(Door::leaf));
    faces.extend(pieces.iter().flat_map(|piece| &piece.hard));
    let mut home = home.clone();
    home.soft = pieces.iter().flat_map(|piece| piece.soft.iter().copied()).collect();
    home.discs = pieces.iter().flat_map(|piece| piece.discs.iter().copied()).collect();
    let mut world = World::new(World::RANDOM, faces, Point::origin(), None);
    world.home = Some(Box::new(home));
    world.start = start(&world, plan, start_shares);
    world
}

/// A point with room around it; the widest one if there is none.
fn start(world: &World, plan: &Plan, shares: &[[f64; 3]]) -> Point {
    let points = shares.iter().map(|&[of_rooms, x, y]| {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a room's number")]
        let index = ((of_rooms * plan.rooms.len() as f64) as usize).min(plan.rooms.len() - 1);
        let [left, lower, right, upper] = plan.rooms[index];
        Point::new(left + x * (right - left), lower + y * (upper - lower))
    });
    let is_behind = |point: Point| plan.slanted.iter().any(|wall| wall.distance(point) < 1.0);
    let rated =
        points.filter(|&point| !is_behind(point)).map(|point| (world.clearance(point).min(START_CLEARANCE_M), point));
    // The first of the equally wide ones.
    let best = rated.fold(None, |best: Option<(f64, Point)>, next| match best {
        Some(known) if known.0 >= next.0 => Some(known),
        _ => Some(next),
    });
    best.map_or_else(|| super::plan::middle(plan.rooms[0]), |(_, point)| point)
}

/// True if the robot can get from its start to both sides of every opening, doors open or not.
fn is_passable(world: &World, plan: &Plan) -> bool {
    let grid = RouteGrid::new(world);
    let routes = grid.routes(world.start);
    let can_reach = |point: Point| routes.cost(grid.cell(point)).is_some();
    world.clearance(world.start) > MIN_CLEARANCE_M
        && plan
            .openings
            .iter()
            .all(|opening| [0.35, 0.55].iter().all(|&m| opening.sides(m).iter().all(|&point| can_reach(point))))
}

/// Where people stand at first: none, one or two, away from the robot.
fn people(world: &World, random: &mut Random) -> Vec<Point> {
    let count = if random.chance(PEOPLE) { 1 + usize::from(random.chance(SECOND_PERSON)) } else { 0 };
    let grid = RouteGrid::new(world);
    let routes = grid.routes(world.start);
    let cells = std::iter::repeat_with(|| random.below(grid.len())).take(400);
    let free = cells.filter(|&cell| routes.cost(cell).is_some()).map(|cell| grid.middle(cell));
    free.filter(|point| (point - world.start).norm() > 1.5).take(count).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_is_one_home_and_another_seed_another() {
        assert_eq!(World::random(7), World::random(7));
        assert_ne!(World::random(7), World::random(8));
        assert_eq!(World::for_seed("random", 7), Some(World::random(7)));
        assert_eq!(World::for_seed("flat", 7), World::named("flat"));
        assert_eq!(World::for_seed("moon", 7), None);
    }

    #[test]
    fn homes_hold_everything_and_every_room_can_be_reached() {
        let (mut doors, mut people, mut carpets, mut spins) = (0, 0, 0, 0);
        for seed in 1..=16 {
            let world = World::random(seed);
            let home = world.home.as_ref().unwrap();
            let grid = RouteGrid::new(&world);
            let routes = grid.routes(world.start);
            for &room in &home.rooms {
                let [left, lower, right, upper] = room;
                let cells = (0..grid.len()).filter(|&cell| {
                    let point = grid.middle(cell);
                    (left..right).contains(&point.x) && (lower..upper).contains(&point.y)
                });
                let free = cells.filter(|&cell| routes.cost(cell).is_some()).count();
                assert!(free > 10, "seed {seed}: {free} free cells in {room:?}");
            }
            assert!(world.clearance(world.start) > MIN_CLEARANCE_M, "seed {seed}");
            doors += home.doors.len();
            people += usize::from(!home.people.is_empty());
            carpets += home.carpets.len();
            spins += usize::from(!home.spins.is_empty());
        }
        assert!(doors > 10 && (3..14).contains(&people) && carpets > 5 && (1..13).contains(&spins));
    }
}
