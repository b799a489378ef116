//! A known map, ready to say how well the cells of another one lie on it.
//!
//! Each cell holds two marks: what it means that the other map has something solid here, and what it means that it has surely free
//! floor here. Only contradictions count against a place: something solid on surely free floor, or the other way round. A wall
//! where this map has none is nearly as good as one where it has, for maps have gaps; a room with two alike ends of which one was
//! mapped badly must not be told apart by that. Above them stand coarser levels, as in Cartographer's scan matcher (Hess and others, 2016): a place of level h holds
//! the greatest mark of the 2^h × 2^h cells from it on, so the sum over the points is a bound for all translations in that square.

#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing, clippy::string_slice)]
#![deny(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)]
#![deny(clippy::allow_attributes, clippy::allow_attributes_without_reason)]

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
        let (width, height) = (columns.saturating_add(MARGIN), rows.saturating_add(MARGIN));
        let mut map = Self { width, height, levels: Vec::with_capacity(LEVELS) };
        let extent = [raster.width, raster.height];
        let value = |column: i32, row: i32| -> i8 {
            let value = place(column, row, extent).and_then(|place| raster.occupancy.get(place));
            value.copied().unwrap_or(Raster::UNKNOWN)
        };
        let depths = depths(raster);
        let is_deep = |column: i32, row: i32| {
            let depth = place(column, row, extent).and_then(|place| depths.get(place));
            depth.is_some_and(|depth| *depth >= DEEP)
        };
        let mut marks = Vec::with_capacity(map.places());
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
            let mut marks = Vec::with_capacity(map.places());
            for row in 0..height {
                for column in 0..width {
                    let four = [(0, 0), (reach, 0), (0, reach), (reach, reach)]
                        .map(|(x, y)| map.mark(level - 1, column + x, row + y));
                    let greatest = |[a, b]: [i8; 2], [c, d]: [i8; 2]| [a.max(c), b.max(d)];
                    marks.push(four.into_iter().fold([i8::MIN; 2], greatest));
                }
            }
            map.levels.push(Level { marks });
        }
        map
    }

    /// Solid and free mark of a place of a level; places are counted from [`MARGIN`] before the first cell.
    pub(super) fn mark(&self, level: usize, column: i32, row: i32) -> [i8; 2] {
        let place = place(column, row, self.extent());
        let mark = place.and_then(|place| self.levels.get(level)?.marks.get(place));
        mark.copied().unwrap_or(NOTHING)
    }

    fn extent(&self) -> [usize; 2] {
        [self.width, self.height].map(|cells| usize::try_from(cells).unwrap_or_default())
    }

    fn places(&self) -> usize {
        let [width, height] = self.extent();
        width.saturating_mul(height)
    }
}

/// Where a cell stands in a list of `width × height`, row by row; none outside.
fn place(column: i32, row: i32, [width, height]: [usize; 2]) -> Option<usize> {
    let (column, row) = (usize::try_from(column).ok()?, usize::try_from(row).ok()?);
    if column < width && row < height { row.checked_mul(width)?.checked_add(column) } else { None }
}

fn marks_of(value: &impl Fn(i32, i32) -> i8, is_deep: bool, column: i32, row: i32) -> [i8; 2] {
    let reach = signed(SOLID_BY_DISTANCE.len()) - 1;
    let mut nearest: Option<u32> = None;
    for y in -reach..=reach {
        for x in -reach..=reach {
            if value(column + x, row + y) >= SOLID {
                let distance = x.unsigned_abs().max(y.unsigned_abs());
                nearest = Some(nearest.map_or(distance, |least| least.min(distance)));
            }
        }
    }
    let by_distance = nearest.and_then(|distance| SOLID_BY_DISTANCE.get(usize::try_from(distance).ok()?).copied());
    let solid = match by_distance {
        Some(solid) => solid,
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
    let extent = [raster.width, raster.height];
    let mut relax = |column: i32, row: i32, neighbours: [(i32, i32); 4]| {
        for (x, y) in neighbours {
            // Outside nothing is known to be free.
            let neighbour = place(column + x, row + y, extent).and_then(|place| depths.get(place));
            let bound = neighbour.map_or(1, |depth| depth.saturating_add(1));
            if let Some(here) = place(column, row, extent).and_then(|place| depths.get_mut(place)) {
                *here = (*here).min(bound);
            }
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
