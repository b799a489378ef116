//! A known map, prepared to score how well the cells of a new map fit on it.
//!
//! Each cell holds two marks: the score of a solid cell of the new map here, and the score of surely free floor here.
//! Only contradictions count against a pose: something solid on surely free floor, or the other way round. A wall
//! where this map has none is nearly as good as one where it has, for maps have gaps; a poorly mapped end of a symmetrical room
//! must not decide between its two ends. Above them stand coarser levels, as in Cartographer's scan matcher (Hess and others, 2016): an entry of level h holds
//! the greatest mark of the 2^h × 2^h cells from it on, so the sum over the points is a bound for all translations in that square.

#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing, clippy::string_slice)]
#![deny(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)]
#![deny(clippy::allow_attributes, clippy::allow_attributes_without_reason)]

use super::params::Params;
use crate::mapping::raster::Raster;

/// Levels above the cells: the coarsest squares have 32 cells to a side.
pub(super) const LEVELS: usize = 6;

/// Marks of the cells, or of squares of cells.
#[derive(Clone, Debug)]
struct Level {
    /// Solid and free mark of each entry.
    marks: Vec<[i8; 2]>,
}

/// The map.
#[derive(Clone, Debug)]
pub(super) struct KnownMap {
    /// Cells along x and y, with the margin in which coarse squares begin.
    pub(super) width: i32,
    pub(super) height: i32,
    /// The marks outside the map.
    unknown: [i8; 2],
    levels: Vec<Level>,
}

/// Entries before the map's first cell: the squares that reach into it begin there.
pub(super) const MARGIN: i32 = 1 << (LEVELS - 1);

impl KnownMap {
    /// The map of a raster.
    pub(super) fn new(raster: &Raster, params: &Params) -> Self {
        let (columns, rows) = (signed(raster.width), signed(raster.height));
        let (width, height) = (columns.saturating_add(MARGIN), rows.saturating_add(MARGIN));
        let mut map = Self { width, height, unknown: params.unknown_marks(), levels: Vec::with_capacity(LEVELS) };
        let extent = [raster.width, raster.height];
        let value = |column: i32, row: i32| -> i8 {
            let value = index_of(column, row, extent).and_then(|index| raster.occupancy.get(index));
            value.copied().unwrap_or(Raster::UNKNOWN)
        };
        let depths = depths(raster, params);
        let is_deep = |column: i32, row: i32| {
            let depth = index_of(column, row, extent).and_then(|index| depths.get(index));
            depth.is_some_and(|depth| *depth >= params.deep_cells)
        };
        let mut marks = Vec::with_capacity(map.cells());
        for row in -MARGIN..rows {
            for column in -MARGIN..columns {
                marks.push(if column < 0 || row < 0 {
                    map.unknown
                } else {
                    marks_of(&value, is_deep(column, row), column, row, params)
                });
            }
        }
        map.levels.push(Level { marks });
        for level in 1..LEVELS {
            let reach = 1 << (level - 1);
            let mut marks = Vec::with_capacity(map.cells());
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

    /// Solid and free mark of an entry of a level; entries are counted from [`MARGIN`] before the first cell.
    pub(super) fn mark(&self, level: usize, column: i32, row: i32) -> [i8; 2] {
        let index = index_of(column, row, self.extent());
        let mark = index.and_then(|index| self.levels.get(level)?.marks.get(index));
        mark.copied().unwrap_or(self.unknown)
    }

    fn extent(&self) -> [usize; 2] {
        [self.width, self.height].map(|cells| usize::try_from(cells).unwrap_or_default())
    }

    fn cells(&self) -> usize {
        let [width, height] = self.extent();
        width.saturating_mul(height)
    }
}

/// The index of a cell in a list of `width × height`, row by row; none outside.
fn index_of(column: i32, row: i32, [width, height]: [usize; 2]) -> Option<usize> {
    let (column, row) = (usize::try_from(column).ok()?, usize::try_from(row).ok()?);
    if column < width && row < height { row.checked_mul(width)?.checked_add(column) } else { None }
}

fn marks_of(value: &impl Fn(i32, i32) -> i8, is_deep: bool, column: i32, row: i32, params: &Params) -> [i8; 2] {
    let reach = signed(params.solid_by_distance.len()) - 1;
    let mut nearest: Option<u32> = None;
    for y in -reach..=reach {
        for x in -reach..=reach {
            if value(column + x, row + y) >= params.solid_percent {
                let distance = x.unsigned_abs().max(y.unsigned_abs());
                nearest = Some(nearest.map_or(distance, |least| least.min(distance)));
            }
        }
    }
    let by_distance =
        nearest.and_then(|distance| params.solid_by_distance.get(usize::try_from(distance).ok()?).copied());
    let solid = match by_distance {
        Some(solid) => solid,
        None if is_deep => params.solid_on_free,
        None => params.solid_elsewhere,
    };
    [solid, if nearest == Some(0) { params.free_on_solid } else { params.free_elsewhere }]
}

/// Each cell's distance in steps of a king from the nearest one that is not free; row by row.
fn depths(raster: &Raster, params: &Params) -> Vec<i32> {
    let mut depths: Vec<i32> = raster
        .occupancy
        .iter()
        .map(|value| if (0..=params.free_percent).contains(value) { i32::MAX / 2 } else { 0 })
        .collect();
    let (width, height) = (signed(raster.width), signed(raster.height));
    let extent = [raster.width, raster.height];
    let mut relax = |column: i32, row: i32, neighbours: [(i32, i32); 4]| {
        for (x, y) in neighbours {
            // Outside nothing is known to be free.
            let neighbour = index_of(column + x, row + y, extent).and_then(|index| depths.get(index));
            let bound = neighbour.map_or(1, |depth| depth.saturating_add(1));
            if let Some(here) = index_of(column, row, extent).and_then(|index| depths.get_mut(index)) {
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
pub(super) fn surely_free(raster: &Raster, params: &Params) -> Vec<bool> {
    depths(raster, params).into_iter().map(|depth| depth >= params.deep_cells).collect()
}

/// A number of cells; maps have far fewer than 2³¹ to a side.
pub(super) fn signed(cells: usize) -> i32 {
    i32::try_from(cells).unwrap_or(i32::MAX)
}
