//! The rooms of a random home, the openings between them and its slanted walls.

use crate::floor_plan::{FloorPlan, Rectangle};
use crate::random::Random;
use crate::world::Segment;
use slamd_core::Point;

/// Thickness of the walls, metres.
const WALL_M: f64 = 0.1;
/// Minimum and maximum area of a home, square metres.
const AREA_M2: (f64, f64) = (30.0, 120.0);
/// Minimum and maximum mean area of its rooms, square metres.
const ROOM_M2: (f64, f64) = (10.0, 19.0);
/// Minimum side of a room, metres.
const MIN_SIDE_M: f64 = 1.9;
/// Width of a hallway, metres.
const HALL_M: (f64, f64) = (1.1, 1.6);
/// Width of a door opening, metres.
const DOOR_M: (f64, f64) = (0.8, 0.9);
/// Minimum distance between an opening and the end of its wall, metres.
const DOOR_MARGIN_M: f64 = 0.12;
/// Free floor on both sides of an opening, from its middle, metres.
pub(super) const DOOR_SPACE_M: f64 = 0.85;
/// One home in six has slanted walls.
const SLANTED: f64 = 1.0 / 6.0;

/// An opening between two rooms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Opening {
    pub(super) area: Rectangle,
    /// The wall runs along y.
    pub(super) is_along_y: bool,
}

impl Opening {
    pub(super) fn middle(&self) -> Point {
        middle(self.area)
    }

    pub(super) fn width_m(&self) -> f64 {
        if self.is_along_y { self.area[3] - self.area[1] } else { self.area[2] - self.area[0] }
    }

    /// Points of the floor on both sides, `distance_m` from the middle.
    pub(super) fn sides(&self, distance_m: f64) -> [Point; 2] {
        let Point { coords } = self.middle();
        let [dx, dy] = if self.is_along_y { [distance_m, 0.0] } else { [0.0, distance_m] };
        [Point::new(coords.x - dx, coords.y - dy), Point::new(coords.x + dx, coords.y + dy)]
    }
}

/// A home without furniture.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Plan {
    pub(super) rooms: Vec<Rectangle>,
    pub(super) openings: Vec<Opening>,
    pub(super) slanted: Vec<Segment>,
}

pub(super) fn middle(area: Rectangle) -> Point {
    Point::new(0.5 * (area[0] + area[2]), 0.5 * (area[1] + area[3]))
}

/// Sides along x and y, metres.
pub(super) fn sides(area: Rectangle) -> [f64; 2] {
    [area[2] - area[0], area[3] - area[1]]
}

impl Plan {
    /// Draws plans until one has rooms of sensible sizes that are all connected.
    pub(super) fn draw(random: &mut Random) -> Self {
        loop {
            if let Some(plan) = Self::try_draw(random) {
                return plan;
            }
        }
    }

    fn try_draw(random: &mut Random) -> Option<Self> {
        let count = 3 + random.below(5);
        let area_m2 = (random.uniform(ROOM_M2.0, ROOM_M2.1) * count as f64).clamp(AREA_M2.0, AREA_M2.1);
        let aspect = random.uniform(1.0, 1.7);
        let (width, height) = ((area_m2 * aspect).sqrt(), (area_m2 / aspect).sqrt());
        let whole = [0.0, 0.0, width, height];
        let has_hall = count >= 4 && random.chance(0.5);
        let mut rooms = if has_hall { with_hall(whole, count, random) } else { split(whole, count, random) };
        if !has_hall && count >= 4 && random.chance(0.3) {
            // Without one of its corners the home has the shape of an L.
            rooms.pop();
        }
        let is_sensible = |room: &Rectangle| {
            let [x, y] = sides(*room);
            x.min(y) >= MIN_SIDE_M && x.max(y) <= 8.0
        };
        let rest = if has_hall { &rooms[1..] } else { &rooms[..] };
        if !rest.iter().all(is_sensible) {
            return None;
        }
        let openings = openings(&rooms, random)?;
        let slanted = if random.chance(SLANTED) { slanted(&rooms, &openings, random) } else { Vec::new() };
        Some(Self { rooms, openings, slanted })
    }

    /// The faces of all walls.
    pub(super) fn faces(&self) -> Vec<Segment> {
        let free: Vec<Rectangle> = self.rooms.iter().copied().chain(self.openings.iter().map(|o| o.area)).collect();
        let mut faces = FloorPlan { free: &free, blocks: &[] }.faces();
        faces.extend(&self.slanted);
        faces
    }
}

/// Splits `area` into `count` rooms, the longer side first.
fn split(area: Rectangle, count: usize, random: &mut Random) -> Vec<Rectangle> {
    if count < 2 {
        return vec![area];
    }
    let first = count / 2 + if count % 2 == 1 { random.below(2) } else { 0 };
    let share = first as f64 / count as f64 * random.uniform(0.8, 1.2);
    let [x, y] = sides(area);
    let (low, high) = cut(area, x > y, share);
    let mut rooms = split(low, first, random);
    rooms.extend(split(high, count - first, random));
    rooms
}

/// Both parts of `area` beside a wall at `share` of the side along x or y.
fn cut(area: Rectangle, is_x: bool, share: f64) -> (Rectangle, Rectangle) {
    let [left, lower, right, upper] = area;
    if is_x {
        let wall = left + share * (right - left);
        ([left, lower, wall - 0.5 * WALL_M, upper], [wall + 0.5 * WALL_M, lower, right, upper])
    } else {
        let wall = lower + share * (upper - lower);
        ([left, lower, right, wall - 0.5 * WALL_M], [left, wall + 0.5 * WALL_M, right, upper])
    }
}

/// A hallway with rooms on both sides; the hallway is the first.
fn with_hall(area: Rectangle, count: usize, random: &mut Random) -> Vec<Rectangle> {
    let [left, lower, right, upper] = area;
    let hall_m = random.uniform(HALL_M.0, HALL_M.1);
    let from = lower + random.uniform(0.35, 0.6) * (upper - lower - hall_m);
    let mut rooms = vec![[left, from, right, from + hall_m]];
    let below = (count - 1) / 2;
    for (row, rooms_of_row) in [
        ([left, lower, right, from - WALL_M], below),
        ([left, from + hall_m + WALL_M, right, upper], count - 1 - below),
    ] {
        let mut rest = row;
        for left_over in (2..=rooms_of_row).rev() {
            let (room, others) = cut(rest, true, random.uniform(0.8, 1.2) / left_over as f64);
            rooms.push(room);
            rest = others;
        }
        rooms.push(rest);
    }
    rooms
}

/// Openings that connect all rooms, and some more; none if the rooms cannot be connected.
fn openings(rooms: &[Rectangle], random: &mut Random) -> Option<Vec<Opening>> {
    let mut pairs: Vec<[usize; 2]> = Vec::new();
    for second in 0..rooms.len() {
        pairs.extend((0..second).map(|first| [first, second]));
    }
    for last in (1..pairs.len()).rev() {
        pairs.swap(last, random.below(last + 1));
    }
    // The first room, where there is one a hallway, has doors to all its neighbours.
    pairs.sort_by_key(|pair| pair[0] != 0);
    let mut group: Vec<usize> = (0..rooms.len()).collect();
    let mut found = Vec::new();
    for [first, second] in pairs {
        let is_joined = group[first] == group[second];
        if is_joined && !random.chance(0.2) {
            continue;
        }
        if let Some(opening) = opening(rooms[first], rooms[second], random) {
            found.push(opening);
            let (from, to) = (group[second], group[first]);
            group.iter_mut().filter(|of| **of == from).for_each(|of| *of = to);
        }
    }
    group.iter().all(|of| *of == group[0]).then_some(found)
}

/// An opening between two rooms with a common wall that is long enough.
fn opening(first: Rectangle, second: Rectangle, random: &mut Random) -> Option<Opening> {
    let width_m = random.uniform(DOOR_M.0, DOOR_M.1);
    let share = random.uniform(0.0, 1.0);
    for (along, across) in [(1, 0), (0, 1)] {
        for (low, high) in [(first, second), (second, first)] {
            if (low[across + 2] + WALL_M - high[across]).abs() > 1e-6 {
                continue;
            }
            let from = low[along].max(high[along]) + DOOR_MARGIN_M;
            let room_m = low[along + 2].min(high[along + 2]) - DOOR_MARGIN_M - from - width_m;
            if room_m >= 0.0 {
                let mut area = [0.0; 4];
                (area[across], area[across + 2]) = (low[across + 2], high[across]);
                (area[along], area[along + 2]) = (from + share * room_m, from + share * room_m + width_m);
                return Some(Opening { area, is_along_y: along == 1 });
            }
        }
    }
    None
}

/// Walls across the corners of some rooms, and walls that lean against a long side.
fn slanted(rooms: &[Rectangle], openings: &[Opening], random: &mut Random) -> Vec<Segment> {
    let mut found = Vec::new();
    for &[left, lower, right, upper] in rooms {
        for _ in 0..4 {
            let x = if random.chance(0.5) { [left, right] } else { [right, left] };
            let y = if random.chance(0.5) { [lower, upper] } else { [upper, lower] };
            let [width, height] = [x[1] - x[0], y[1] - y[0]];
            let (along, across) = if random.chance(0.5) {
                (1.0, random.uniform(0.08, 0.2))
            } else {
                (random.uniform(0.2, 0.5), random.uniform(0.2, 0.5))
            };
            let wall =
                Segment { from: Point::new(x[0] + along * width, y[0]), to: Point::new(x[0], y[0] + across * height) };
            let is_free = openings.iter().all(|opening| {
                let spaces = opening.sides(0.45);
                spaces.iter().chain([&opening.middle()]).all(|&point| wall.distance(point) > 0.5)
                    && !cuts_off(&wall, [x[0], y[0]], opening)
            });
            if is_free {
                found.push(wall);
                break;
            }
        }
    }
    found
}

/// True if the opening lies behind the wall, on the side of the corner that it cuts off.
fn cuts_off(wall: &Segment, corner: [f64; 2], opening: &Opening) -> bool {
    let along = wall.to - wall.from;
    let side = |point: Point| along.perp(&(point - wall.from));
    let bound = |axis: usize| (wall.from[axis].min(wall.to[axis]) - 0.2, wall.from[axis].max(wall.to[axis]) + 0.2);
    let is_near = |point: Point| {
        let ((left, right), (lower, upper)) = (bound(0), bound(1));
        (left..right).contains(&point.x) && (lower..upper).contains(&point.y)
    };
    let middle = opening.middle();
    is_near(middle) && side(middle) * side(Point::new(corner[0], corner[1])) > 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    #[test]
    fn plans_have_the_stated_sizes() {
        let (mut halls, mut slanted, mut counts) = (0, 0, [0; 8]);
        for seed in 0..300 {
            let plan = Plan::draw(&mut Random::new(seed, Stream::Home));
            let area_m2: f64 = plan.rooms.iter().map(|&room| sides(room)).map(|[x, y]| x * y).sum();
            assert!((20.0..=120.0).contains(&area_m2), "seed {seed}: {area_m2} m2");
            assert!((3..=7).contains(&plan.rooms.len()), "seed {seed}");
            assert!(plan.openings.len() >= plan.rooms.len() - 1, "seed {seed}");
            for opening in &plan.openings {
                assert!((0.8..=0.9).contains(&opening.width_m()), "seed {seed}");
            }
            counts[plan.rooms.len()] += 1;
            halls += usize::from(plan.rooms.iter().any(|&room| sides(room)[1] < HALL_M.1));
            slanted += usize::from(!plan.slanted.is_empty());
        }
        assert!(counts[3..].iter().all(|&count| count > 10), "{counts:?}");
        assert!((30..200).contains(&halls) && (25..75).contains(&slanted), "{halls} {slanted}");
    }
}
