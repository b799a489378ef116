//! The paper's map: a binary grid of 1 cm cells.
//!
//! A reliable endpoint e is moved into the map frame, g = \[X Y\]ᵀ + R(theta) e (equations 5, 6), and its cell is occupied, for ever:
//! the paper has neither free space nor forgetting. The heading is sought in the local map only, the occupied cells
//! within r = Vmax · dt + alpha of the robot (equation 10).
//!
//! **An addition.** A map without free space is of no use for driving, so each 8 cm square also has one bit
//! that says whether a beam's axis has crossed it on the way to its endpoint. It is used in [`BinaryGrid::raster`] only; the
//! estimator never sees it. Occupied wins, and silence clears nothing: a sensor that is stuck at "nothing in range" must not draw free
//! space through walls.
//!
//! Cells live in tiles of 64 cm that are made on touch, up to a bound; what was refused is counted.

use slamd_core::{Point, Pose2, Raster};
use std::collections::BTreeMap;

/// Side of a cell, metres.
pub const CELL_M: f64 = 0.01;

/// Tiles of 64 cm at most: 27 000 square metres in 34 MB.
const MAX_TILES: usize = 65_536;
/// Cells along a tile's side.
const TILE: i32 = 64;
/// Cells along the side of a square that is free as a whole.
const SQUARE: i32 = 8;

/// Column and row of a tile or of a cell.
type Index = (i32, i32);

#[derive(Clone, Debug)]
struct Tile {
    /// One bit per cell, row by row.
    occupied: [u64; TILE as usize],
    /// One bit per square, row by row.
    free: u64,
}

/// The grid, map frame.
#[derive(Clone, Debug, Default)]
pub struct BinaryGrid {
    tiles: BTreeMap<Index, Tile>,
    refused: u64,
}

impl BinaryGrid {
    /// Equations 5 and 6 for one reliable beam: its endpoint is occupied, its axis up to there is free. `sensor` and `endpoint` are
    /// metres in the robot frame. Points that are not finite or do not fit are refused and counted.
    pub fn mark(&mut self, map_from_robot: Pose2, sensor: Point, endpoint: Point) {
        let (from, to) = (map_from_robot.transform(sensor), map_from_robot.transform(endpoint));
        let Some((column, row)) = cell(to) else {
            self.refused += 1;
            return;
        };
        if let Some(tile) = self.tile((column.div_euclid(TILE), row.div_euclid(TILE))) {
            tile.occupied[row.rem_euclid(TILE).unsigned_abs() as usize] |= 1 << column.rem_euclid(TILE);
        }
        self.clear(from, to);
    }

    /// Equation 10: appends the centres of the occupied cells within `radius_m` of `centre`, relative to `centre`, to `cells`.
    pub fn local_map(&self, centre: Point, radius_m: f64, cells: &mut Vec<Point>) {
        let corner = |sign: f64| cell(centre + nalgebra::Vector2::repeat(sign * radius_m));
        let (Some(low), Some(high)) = (corner(-1.0), corner(1.0)) else { return };
        let radius2 = radius_m * radius_m;
        for tile_column in low.0.div_euclid(TILE)..=high.0.div_euclid(TILE) {
            let (first, last) = ((tile_column, low.1.div_euclid(TILE)), (tile_column, high.1.div_euclid(TILE)));
            for (index, tile) in self.tiles.range(first..=last) {
                for (column, row) in tile.cells(*index) {
                    let x = (f64::from(column) + 0.5) * CELL_M - centre.x;
                    let y = (f64::from(row) + 0.5) * CELL_M - centre.y;
                    if x * x + y * y <= radius2 {
                        cells.push(Point::new(x, y));
                    }
                }
            }
        }
    }

    /// Beams and squares that did not fit.
    #[must_use]
    pub fn refused(&self) -> u64 {
        self.refused
    }

    /// The map drawn over all tiles: occupied 100, crossed by a beam 0, else unknown. Cells are 1 cm, doubled until there are no more
    /// than [`slamd_core::stages::MAX_CELLS`]: a lost robot's map may be large. An empty grid gives an empty raster.
    #[must_use]
    pub fn raster(&self) -> Raster {
        let Some(((left, right), (bottom, top))) = self.bounds() else {
            return Raster { cell_m: CELL_M, ..Raster::default() };
        };
        let side = |low: i32, high: i32| usize::try_from((high - low + 1) * TILE).expect("tiles are in order");
        let (columns, rows) = (side(left, right), side(bottom, top));
        let merge = Raster::coarseness(columns, rows);
        let (width, height) = (columns.div_ceil(merge), rows.div_ceil(merge));
        let mut raster = Raster {
            width,
            height,
            cell_m: CELL_M * merge as f64,
            origin: Point::new(f64::from(left * TILE) * CELL_M, f64::from(bottom * TILE) * CELL_M),
            occupancy: vec![Raster::UNKNOWN; width * height],
        };
        let mut draw = |(column, row): Index, value: i8| {
            let (x, y) = (column - left * TILE, row - bottom * TILE);
            let index = x.unsigned_abs() as usize / merge + y.unsigned_abs() as usize / merge * width;
            if let Some(drawn) = raster.occupancy.get_mut(index) {
                *drawn = (*drawn).max(value);
            }
        };
        for (index, tile) in &self.tiles {
            for (column, row) in tile.free_cells(*index) {
                draw((column, row), 0);
            }
            for (column, row) in tile.cells(*index) {
                draw((column, row), 100);
            }
        }
        raster
    }

    /// Marks the squares from `from` to `to` free, up to the square before the last.
    fn clear(&mut self, from: Point, to: Point) {
        let step_m = CELL_M * f64::from(SQUARE);
        let (length_m, way) = ((to - from).norm(), to - from);
        let mut pending: Option<(Index, u64)> = None;
        let mut travelled_m = 0.0;
        while travelled_m < length_m - step_m {
            let Some((column, row)) = cell(from + way * (travelled_m / length_m)) else { break };
            let index = (column.div_euclid(TILE), row.div_euclid(TILE));
            let bit = 1 << (column.rem_euclid(TILE) / SQUARE + row.rem_euclid(TILE) / SQUARE * (TILE / SQUARE));
            pending = match pending {
                Some((same, bits)) if same == index => Some((index, bits | bit)),
                other => {
                    self.free(other);
                    Some((index, bit))
                }
            };
            travelled_m += 0.5 * step_m;
        }
        self.free(pending);
    }

    fn free(&mut self, squares: Option<(Index, u64)>) {
        if let Some((index, bits)) = squares
            && let Some(tile) = self.tile(index)
        {
            tile.free |= bits;
        }
    }

    /// The tile, made where it does not exist; none where there is no more room.
    fn tile(&mut self, index: Index) -> Option<&mut Tile> {
        if self.tiles.len() >= MAX_TILES && !self.tiles.contains_key(&index) {
            self.refused += 1;
            return None;
        }
        Some(self.tiles.entry(index).or_insert(Tile { occupied: [0; TILE as usize], free: 0 }))
    }

    /// First and last tile along x and y.
    fn bounds(&self) -> Option<(Index, Index)> {
        let columns = (self.tiles.keys().next()?.0, self.tiles.keys().next_back()?.0);
        let rows = (self.tiles.keys().map(|key| key.1).min()?, self.tiles.keys().map(|key| key.1).max()?);
        Some((columns, rows))
    }
}

impl Tile {
    /// The occupied cells of this tile.
    fn cells(&self, (tile_column, tile_row): Index) -> impl Iterator<Item = Index> {
        (0..TILE).zip(self.occupied).flat_map(move |(row, bits)| {
            ones(bits).map(move |column| (tile_column * TILE + column, tile_row * TILE + row))
        })
    }

    /// The cells of this tile's free squares.
    fn free_cells(&self, (tile_column, tile_row): Index) -> impl Iterator<Item = Index> {
        ones(self.free).flat_map(move |square| {
            let (x, y) = (square % (TILE / SQUARE) * SQUARE, square / (TILE / SQUARE) * SQUARE);
            (0..SQUARE * SQUARE).map(move |i| (tile_column * TILE + x + i % SQUARE, tile_row * TILE + y + i / SQUARE))
        })
    }
}

/// The indices of the bits that are set, lowest first.
fn ones(mut bits: u64) -> impl Iterator<Item = i32> {
    std::iter::from_fn(move || {
        let index = bits.trailing_zeros();
        bits &= bits.wrapping_sub(1);
        (index < u64::BITS).then_some(index.cast_signed())
    })
}

/// The cell that holds a point; none more than 10 km away, and none for NaN.
#[expect(clippy::cast_possible_truncation, reason = "at most a million cells away")]
fn cell(point: Point) -> Option<Index> {
    const FARTHEST_M: f64 = 1e4;
    let near = point.x.abs() < FARTHEST_M && point.y.abs() < FARTHEST_M;
    near.then(|| (libm::floor(point.x / CELL_M) as i32, libm::floor(point.y / CELL_M) as i32))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use slamd_core::stages::MAX_CELLS;

    fn at(raster: &Raster, x: f64, y: f64) -> i8 {
        let (column, row) = raster.cell(Point::new(x, y)).unwrap();
        raster.occupancy[row * raster.width + column]
    }

    proptest! {
        #[test]
        fn the_local_map_is_what_a_look_at_every_cell_finds(
            ends in prop::collection::vec((-4.0..4.0f64, -4.0..4.0f64), 1..60), x in -3.0..3.0f64, r in 0.1..3.0f64,
        ) {
            let mut grid = BinaryGrid::default();
            for (x, y) in &ends {
                grid.mark(Pose2::default(), Point::origin(), Point::new(*x, *y));
            }
            let centre = Point::new(x, 0.5);
            let mut found = Vec::new();
            grid.local_map(centre, r, &mut found);
            let mut cells: Vec<Index> = ends.iter().map(|(x, y)| cell(Point::new(*x, *y)).unwrap()).collect();
            cells.sort_unstable();
            cells.dedup();
            let inside = |(column, row): &&Index| {
                let (x, y) = ((f64::from(*column) + 0.5) * CELL_M, (f64::from(*row) + 0.5) * CELL_M);
                (Point::new(x, y) - centre).norm() <= r
            };
            prop_assert_eq!(found.len(), cells.iter().filter(inside).count());
        }
    }

    #[test]
    fn endpoints_are_occupied_their_beams_free_and_the_rest_unknown() {
        let mut grid = BinaryGrid::default();
        grid.mark(Pose2::new(1.005, -0.5, std::f64::consts::FRAC_PI_2), Point::new(0.15, 0.0), Point::new(2.005, 0.0));
        let raster = grid.raster();
        assert_eq!(at(&raster, 1.005, 1.505), 100);
        assert_eq!((at(&raster, 1.005, 0.5), at(&raster, 1.25, 0.5)), (0, Raster::UNKNOWN));
        assert_eq!(raster.occupancy.iter().filter(|v| **v == 100).count(), 1);
    }

    #[test]
    fn an_empty_grid_is_an_empty_raster() {
        assert_eq!(BinaryGrid::default().raster().occupancy.len(), 0);
    }

    #[test]
    fn places_nowhere_and_beyond_the_bound_are_refused_and_counted() {
        let mut grid = BinaryGrid::default();
        grid.mark(Pose2::default(), Point::origin(), Point::new(f64::NAN, 0.0));
        grid.mark(Pose2::default(), Point::origin(), Point::new(1e9, 0.0));
        assert_eq!((grid.refused(), grid.tiles.len()), (2, 0));
        for i in 0..70_000 {
            let end = Point::new(0.64 * f64::from(i % 300) + 0.1, 0.64 * f64::from(i / 300) + 0.1);
            grid.mark(Pose2::default(), end, end);
        }
        assert_eq!((grid.refused(), grid.tiles.len()), (2 + 70_000 - 65_536, MAX_TILES));
    }

    #[test]
    fn a_large_map_is_drawn_coarser() {
        for most in [200.001, 9_999.0] {
            let mut grid = BinaryGrid::default();
            for far in [-most, most] {
                grid.mark(Pose2::default(), Point::new(far, far), Point::new(far, far));
            }
            let raster = grid.raster();
            assert!(raster.width * raster.height <= MAX_CELLS && raster.cell_m > CELL_M);
            assert_eq!((at(&raster, -most, -most), at(&raster, most, most)), (100, 100));
        }
    }
}
