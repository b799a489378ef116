//! A known map, ready to say how well the cells of another one lie on it.
//!
//! Each cell holds two marks: what it means that the other map has something solid here, and what it means that it has surely free
//! floor here. Only contradictions count against a place: something solid on surely free floor, or the other way round. A wall
//! where this map has none is nearly as good as one where it has, for maps have gaps; a room with two alike ends of which one was
//! mapped badly must not be told apart by that. Above them stand coarser levels, as in Cartographer's scan matcher (Hess and others, 2016): a place of level h holds
//! the greatest mark of the 2^h × 2^h cells from it on, so the sum over the points is a bound for all translations in that square.

#![expect(clippy::cast_sign_loss, reason = "places inside a map are not negative")]

use crate::mapping::raster::Raster;

/// Levels above the cells: the coarsest squares have 32 cells to a side.
pub(super) const LEVELS: usize = 6;
/// Percent from which a cell is solid, and up to which it is free.
pub(super) const SOLID: i8 = 65;
const FREE: i8 = 35;
/// Marks of a solid cell by its distance in cells from the nearest solid cell of the map.
const SOLID_BY_DISTANCE: [i8; 3] = [20, 16, 8];
/// Solid on floor that is surely free, and where the map may only have missed a wall.
const SOLID_ON_FREE: i8 = -10;
const SOLID_ELSEWHERE: i8 = 10;
const FREE_ELSEWHERE: i8 = 3;
const FREE_ON_SOLID: i8 = -10;
/// Floor this many cells from anything else is surely free: beams that miss a wall clear a little of what lies behind it.
const DEEP: i32 = 9;

/// The marks that a perfect fit would get per solid and per free point.
pub(super) const BEST_MARKS: [i32; 2] = [SOLID_BY_DISTANCE[0] as i32, FREE_ELSEWHERE as i32];

/// Marks of the cells, or of squares of cells.
#[derive(Clone, Debug)]
struct Level {
    /// Solid and free mark of each place.
    marks: Vec<[i8; 2]>,
}

/// The map.
#[derive(Clone, Debug)]
pub(super) struct KnownMap {
    /// Cells along x and y, with the margin in which coarse squares begin.
    pub(super) width: i32,
    pub(super) height: i32,
    levels: Vec<Level>,
}

/// Places in front of the map's first cell: the squares that reach into it begin there.
pub(super) const MARGIN: i32 = 1 << (LEVELS - 1);
const NOTHING: [i8; 2] = [SOLID_ELSEWHERE, FREE_ELSEWHERE];

impl KnownMap {
    /// The map of a raster.
    pub(super) fn new(raster: &Raster) -> Self {
        let (columns, rows) = (signed(raster.width), signed(raster.height));
        let (width, height) = (columns + MARGIN, rows + MARGIN);
        let mut map = Self { width, height, levels: Vec::with_capacity(LEVELS) };
        let value = |column: i32, row: i32| -> i8 {
            let inside = (0..columns).contains(&column) && (0..rows).contains(&row);
            if inside { raster.occupancy[row as usize * raster.width + column as usize] } else { Raster::UNKNOWN }
        };
        let depths = depths(raster);
        let is_deep = |column: i32, row: i32| depths[row as usize * raster.width + column as usize] >= DEEP;
        let mut marks = Vec::with_capacity(width as usize * height as usize);
        for row in -MARGIN..rows {
            for column in -MARGIN..columns {
                marks.push(if column < 0 || row < 0 {
                    NOTHING
                } else {
                    marks_of(&value, is_deep(column, row), column, row)
                });
            }
        }
        map.levels.push(Level { marks });
        for level in 1..LEVELS {
            let reach = 1 << (level - 1);
            let finer = map.levels.len() - 1;
            let mut marks = Vec::with_capacity(width as usize * height as usize);
            for row in 0..height {
                for column in 0..width {
                    let four = [(0, 0), (reach, 0), (0, reach), (reach, reach)]
                        .map(|(x, y)| map.mark(finer, column + x, row + y));
                    marks.push([0, 1].map(|kind| four.iter().map(|mark| mark[kind]).max().unwrap_or_default()));
                }
            }
            map.levels.push(Level { marks });
        }
        map
    }

    /// Solid and free mark of a place of a level; places are counted from [`MARGIN`] before the first cell.
    pub(super) fn mark(&self, level: usize, column: i32, row: i32) -> [i8; 2] {
        let inside = (0..self.width).contains(&column) && (0..self.height).contains(&row);
        if inside { self.levels[level].marks[row as usize * self.width as usize + column as usize] } else { NOTHING }
    }
}

fn marks_of(value: &impl Fn(i32, i32) -> i8, is_deep: bool, column: i32, row: i32) -> [i8; 2] {
    let reach = signed(SOLID_BY_DISTANCE.len()) - 1;
    let mut nearest: Option<i32> = None;
    for y in -reach..=reach {
        for x in -reach..=reach {
            if value(column + x, row + y) >= SOLID {
                let distance = x.abs().max(y.abs());
                nearest = Some(nearest.map_or(distance, |least| least.min(distance)));
            }
        }
    }
    let solid = match nearest {
        Some(distance) => SOLID_BY_DISTANCE[distance as usize],
        None if is_deep => SOLID_ON_FREE,
        None => SOLID_ELSEWHERE,
    };
    [solid, if nearest == Some(0) { FREE_ON_SOLID } else { FREE_ELSEWHERE }]
}

/// Each cell's distance in steps of a king from the nearest one that is not free; row by row.
fn depths(raster: &Raster) -> Vec<i32> {
    let mut depths: Vec<i32> =
        raster.occupancy.iter().map(|value| if (0..=FREE).contains(value) { i32::MAX / 2 } else { 0 }).collect();
    let (width, height) = (signed(raster.width), signed(raster.height));
    let index = |column: i32, row: i32| row as usize * raster.width + column as usize;
    let mut relax = |column: i32, row: i32, neighbours: [(i32, i32); 4]| {
        for (x, y) in neighbours.map(|(x, y)| (column + x, row + y)) {
            let inside = (0..width).contains(&x) && (0..height).contains(&y);
            let bound = if inside { depths[index(x, y)] + 1 } else { 1 };
            let here = &mut depths[index(column, row)];
            *here = (*here).min(bound);
        }
    };
    for (row, column) in (0..height).flat_map(|row| (0..width).map(move |column| (row, column))) {
        relax(column, row, [(-1, 0), (-1, -1), (0, -1), (1, -1)]);
    }
    for (row, column) in (0..height).rev().flat_map(|row| (0..width).rev().map(move |column| (row, column))) {
        relax(column, row, [(1, 0), (1, 1), (0, 1), (-1, 1)]);
    }
    depths
}

/// The cells that are surely free.
pub(super) fn surely_free(raster: &Raster) -> Vec<bool> {
    depths(raster).into_iter().map(|depth| depth >= DEEP).collect()
}

/// A number of cells; maps have far fewer than 2³¹ to a side.
pub(super) fn signed(cells: usize) -> i32 {
    i32::try_from(cells).unwrap_or(i32::MAX)
}
