//! A map as a floor plan: walls with their lengths, rooms with their areas, and what was only seen from afar.
//!
//! Walls are runs of occupied cells along the axes of the map frame. A gap between two of them that no wall could be seen in, or that is a door,
//! is bridged; the free cells that the bridges enclose are a room if the robot has been in it. So the cones that a sonar clears through a
//! gap, or where a smooth wall returns no echo, are no part of a room.

mod regions;
mod walls;

use crate::map_file::OCCUPIED_PERCENT;
use regions::Regions;
use slamd_core::{Point, Raster};
use walls::{Cell, Lines};

/// A larger raster is no home, and is shown without rooms: 100 m x 100 m at 5 cm.
const MAX_CELLS: usize = 4_000_000;
/// Below this a room is a corner that bridges cut off: it counts to no room of its own. Square metres.
const MIN_ROOM_M2: f64 = 1.0;

/// What is so far beside a wall is beside it, metres.
const BESIDE_M: f64 = 0.3;

/// What is known about a cell's place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Place {
    /// Part of a room, or of the walls and furniture around it.
    Inside,
    /// The robot was not there, and walls or gaps in them lie between.
    Outside,
}

/// A straight wall, or what a robot takes for one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Wall {
    /// Its ends, in the map frame.
    pub(super) ends: [Point; 2],
    /// True if it runs along x.
    pub(super) is_along_x: bool,
    /// True if no room is beside it where y, or x for a wall along y, is less.
    pub(super) is_outside_at_the_lower_side: bool,
}

impl Wall {
    /// Its length, metres.
    pub(super) fn length_m(&self) -> f64 {
        (self.ends[1] - self.ends[0]).norm()
    }

    /// Its middle, in the map frame.
    pub(super) fn middle(&self) -> Point {
        nalgebra::center(&self.ends[0], &self.ends[1])
    }

    /// A point beside its middle, at lower coordinates.
    fn below(&self) -> Point {
        let middle = self.middle();
        if self.is_along_x {
            Point::new(middle.x, middle.y - BESIDE_M)
        } else {
            Point::new(middle.x - BESIDE_M, middle.y)
        }
    }
}

/// A closed free area in which the robot was.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Room {
    /// Its free area, square metres.
    pub(super) area_m2: f64,
    /// Points far from all walls and from each other, the farthest first.
    pub(super) spots: Vec<Spot>,
}

/// A point of a room.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Spot {
    pub(super) at: Point,
    /// Its distance from all walls, metres.
    pub(super) radius_m: f64,
}

/// A raster as a floor plan.
#[derive(Clone, Debug, Default)]
pub(super) struct Plan {
    /// The walls, the longest first.
    pub(super) walls: Vec<Wall>,
    /// Gaps in walls that the robot did not pass: an opening, or a piece of wall without an echo.
    pub(super) gaps: Vec<[Point; 2]>,
    /// The rooms, the largest first.
    pub(super) rooms: Vec<Room>,
    /// What is known beyond the rooms and what stands in them, square metres.
    pub(super) afar_m2: f64,
    /// Per cell of the raster: is it inside? Empty if the raster is too large for a plan, or the robot was nowhere in it.
    inside: Vec<bool>,
}

impl Plan {
    /// The plan of a raster in which the robot has been along `paths`.
    pub(super) fn new<'a>(raster: &Raster, paths: impl Iterator<Item = &'a [Point]>) -> Self {
        if raster.occupancy.len() > MAX_CELLS || raster.cell_m <= 0.0 {
            return Self::default();
        }
        let visited: Vec<Cell> = paths.flat_map(|path| cells_along(raster, path)).collect();
        let lines = Lines::new(raster, &visited);
        let regions = Regions::new(raster, &lines, &visited);
        let mut rooms: Vec<Room> = regions.rooms().into_iter().filter(|room| room.area_m2 >= MIN_ROOM_M2).collect();
        rooms.sort_by(|a, b| b.area_m2.total_cmp(&a.area_m2));
        let gaps: Vec<[Cell; 2]> = lines.gaps().filter(|gap| rooms.is_empty() || regions.are_parted_by(gap)).collect();
        let inside = if rooms.is_empty() { Vec::new() } else { regions.into_inside() };
        let touches = |wall: &walls::Line| {
            let touching = wall.cells().filter(|cell| is_set(raster, &inside, *cell)).count();
            inside.is_empty() || 3 * touching >= wall.cells().count()
        };
        let mut walls: Vec<Wall> = lines.walls(touches).iter().map(|line| line.wall(raster)).collect();
        for wall in &mut walls {
            let beside = raster.cell(wall.below());
            wall.is_outside_at_the_lower_side = !beside.is_some_and(|cell| is_set(raster, &inside, cell));
        }
        walls.sort_by(|a, b| b.length_m().total_cmp(&a.length_m()));
        let is_afar = |(percent, inside): (&i8, &bool)| *percent != Raster::UNKNOWN && !inside;
        let afar = raster.occupancy.iter().zip(&inside).filter(|cell| is_afar(*cell)).count();
        Self {
            walls,
            gaps: gaps.into_iter().map(|gap| gap.map(|cell| middle_of(raster, cell))).collect(),
            rooms,
            afar_m2: afar as f64 * raster.cell_m * raster.cell_m,
            inside,
        }
    }

    /// Where the cell with this index in the raster is.
    pub(super) fn place(&self, index: usize) -> Place {
        if self.inside.is_empty() || self.inside.get(index) == Some(&true) { Place::Inside } else { Place::Outside }
    }

    /// The area of all rooms, square metres.
    pub(super) fn floor_m2(&self) -> f64 {
        self.rooms.iter().map(|room| room.area_m2).sum()
    }
}

fn is_set(raster: &Raster, inside: &[bool], (x, y): Cell) -> bool {
    inside.get(y * raster.width + x) == Some(&true)
}

/// The middle of a cell, in the map frame.
fn middle_of(raster: &Raster, (column, row): Cell) -> Point {
    let at = |origin_m: f64, index: usize| origin_m + (index as f64 + 0.5) * raster.cell_m;
    Point::new(at(raster.origin.x, column), at(raster.origin.y, row))
}

/// True if something in the cell returns the sound.
fn is_occupied(raster: &Raster, (column, row): Cell) -> bool {
    raster.occupancy.get(row * raster.width + column).is_some_and(|percent| *percent >= OCCUPIED_PERCENT)
}

/// The cells of a path in steps of half a cell.
fn cells_along<'a>(raster: &'a Raster, path: &'a [Point]) -> impl Iterator<Item = Cell> + 'a {
    let between = path.windows(2).flat_map(|ends| {
        let step = ends[1] - ends[0];
        let parts = (2.0 * step.norm() / raster.cell_m).ceil().clamp(1.0, MAX_PARTS);
        (0..=whole(parts)).map(move |part| ends[0] + step * (part as f64 / parts))
    });
    path.first().copied().into_iter().chain(between).filter_map(|point| raster.cell(point))
}

/// Steps between two points of a path at most.
const MAX_PARTS: f64 = 10_000.0;

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small number of cells")]
fn whole(cells: f64) -> usize {
    cells.max(0.0) as usize
}

#[cfg(test)]
mod tests;
