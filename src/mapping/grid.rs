//! The occupancy grid: log-odds in sparse tiles.
//!
//! A cell holds ln(p / (1 − p)) in hundredths, clamped so that a changed world is learnt anew (Thrun, Burgard and Fox, Probabilistic
//! Robotics, chapter 9). Tiles appear where something is written; how many is bounded, and what did not fit is counted.

use super::raster::Raster;
use crate::geometry::Point;
use crate::memory::{Impossible, MapMemory, TileMemory};
use std::collections::HashMap;

/// Cells along a tile's side.
const SIDE: i32 = 32;
const TILE: usize = SIDE.unsigned_abs() as usize;
/// Tiles at most: 10,000 m² of 5 cm cells take about 4,000.
const MAX_TILES: usize = 16_384;
/// A restored map reaches no farther, in tiles: 800 m of 5 cm cells.
const FARTHEST_TILE: i32 = 500;
/// Log-odds are clamped here, in hundredths: p from 0.04 to 0.98.
const FLOOR: i16 = -320;
const CEILING: i16 = 400;

/// A cell's place: column and row from the frame's origin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Cell {
    /// Along x.
    pub column: i32,
    /// Along y.
    pub row: i32,
}

type Tile = [i16; TILE * TILE];

/// The grid.
#[derive(Clone, Debug)]
pub struct OccupancyGrid {
    cell_m: f64,
    tiles: Vec<Tile>,
    places: HashMap<(i32, i32), usize>,
    recent: Option<((i32, i32), usize)>,
    refused: u64,
}

impl OccupancyGrid {
    /// An empty grid with cells of `cell_m` metres.
    #[must_use]
    pub fn new(cell_m: f64) -> Self {
        Self { cell_m, tiles: Vec::new(), places: HashMap::new(), recent: None, refused: 0 }
    }

    /// Side of a cell, metres.
    #[must_use]
    pub fn cell_m(&self) -> f64 {
        self.cell_m
    }

    /// Writes that found no room for another tile.
    #[must_use]
    pub fn refused(&self) -> u64 {
        self.refused
    }

    /// The cell that holds a point; points beyond 10⁸ cells share the outermost.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "clamped")]
    pub fn cell(&self, point: Point) -> Cell {
        let place = |coordinate_m: f64| libm::floor(coordinate_m / self.cell_m).clamp(-1e8, 1e8) as i32;
        Cell { column: place(point.x), row: place(point.y) }
    }

    /// Adds `hundredths` of log-odds to a cell and returns its new value.
    pub fn add(&mut self, cell: Cell, hundredths: i16) -> i16 {
        let Some(tile) = self.tile(cell) else {
            self.refused += 1;
            return 0;
        };
        let value = &mut self.tiles[tile][place_in_tile(cell)];
        *value = value.saturating_add(hundredths).clamp(FLOOR, CEILING);
        *value
    }

    /// A cell's log-odds in hundredths; 0 where nothing is known.
    #[must_use]
    pub fn log_odds(&self, cell: Cell) -> i16 {
        self.places.get(&tile_of(cell)).map_or(0, |&tile| self.tiles[tile][place_in_tile(cell)])
    }

    /// The tiles as plain numbers, in the order of their places.
    #[must_use]
    pub fn memory(&self) -> MapMemory {
        let mut places: Vec<_> = self.places.iter().collect();
        places.sort_unstable();
        let tile = |(&(column, row), &tile): (&(i32, i32), &usize)| TileMemory {
            column,
            row,
            log_odds: self.tiles[tile].to_vec(),
        };
        MapMemory { cell_m: self.cell_m, tiles: places.into_iter().map(tile).collect() }
    }

    /// The grid that wrote the memory.
    ///
    /// # Errors
    /// Where cells or tiles are none that a grid could have.
    pub fn restore(memory: &MapMemory) -> Result<Self, Impossible> {
        if !(0.005..=1.0).contains(&memory.cell_m) || memory.tiles.len() > MAX_TILES {
            return Err(Impossible("the map's cells are of no usable size or number"));
        }
        let mut grid = Self::new(memory.cell_m);
        for tile in &memory.tiles {
            let cells = Tile::try_from(&tile.log_odds[..]).map_err(|_| Impossible("a tile of the map is not whole"))?;
            let is_near = tile.column.abs().max(tile.row.abs()) < FARTHEST_TILE;
            if !is_near || cells.iter().any(|value| !(FLOOR..=CEILING).contains(value)) {
                return Err(Impossible("a tile of the map holds what no tile can"));
            }
            if grid.places.insert((tile.column, tile.row), grid.tiles.len()).is_some() {
                return Err(Impossible("a tile of the map is there twice"));
            }
            grid.tiles.push(cells);
        }
        Ok(grid)
    }

    fn tile(&mut self, cell: Cell) -> Option<usize> {
        let key = tile_of(cell);
        if let Some((_, tile)) = self.recent.filter(|(recent, _)| *recent == key) {
            return Some(tile);
        }
        let next = self.tiles.len();
        let tile = match self.places.get(&key) {
            Some(&tile) => tile,
            None if next < MAX_TILES => {
                self.tiles.push([0; TILE * TILE]);
                self.places.insert(key, next);
                next
            }
            None => return None,
        };
        self.recent = Some((key, tile));
        Some(tile)
    }

    /// The known part of the grid as a rectangle.
    #[must_use]
    #[expect(
        clippy::cast_sign_loss,
        clippy::cast_possible_truncation,
        reason = "differences from the minimum; percent"
    )]
    pub fn raster(&self) -> Raster {
        let percent: Vec<i8> = (FLOOR..=CEILING)
            .map(|hundredths| (100.0 / (1.0 + libm::exp(-0.01 * f64::from(hundredths)))).round() as i8)
            .collect();
        let columns = self.places.keys().map(|key| key.0);
        let rows = self.places.keys().map(|key| key.1);
        let (Some(left), Some(right)) = (columns.clone().min(), columns.max()) else { return Raster::default() };
        let (Some(bottom), Some(top)) = (rows.clone().min(), rows.max()) else { return Raster::default() };
        let width = (right - left + 1) as usize * TILE;
        let height = (top - bottom + 1) as usize * TILE;
        let mut occupancy = vec![Raster::UNKNOWN; width * height];
        for (&(column, row), &tile) in &self.places {
            let corner = (row - bottom) as usize * TILE * width + (column - left) as usize * TILE;
            for (y, cells) in self.tiles[tile].chunks_exact(TILE).enumerate() {
                let line = &mut occupancy[corner + y * width..][..TILE];
                for (target, &value) in line.iter_mut().zip(cells).filter(|(_, value)| **value != 0) {
                    *target = percent[(value - FLOOR) as usize];
                }
            }
        }
        let origin = Point::new(f64::from(left * SIDE) * self.cell_m, f64::from(bottom * SIDE) * self.cell_m);
        Raster { width, height, cell_m: self.cell_m, origin, occupancy }
    }
}

const fn tile_of(cell: Cell) -> (i32, i32) {
    (cell.column.div_euclid(SIDE), cell.row.div_euclid(SIDE))
}

#[expect(clippy::cast_sign_loss, reason = "Euclidean remainders are not negative")]
const fn place_in_tile(cell: Cell) -> usize {
    (cell.row.rem_euclid(SIDE) * SIDE + cell.column.rem_euclid(SIDE)) as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn log_odds_stay_clamped(steps in prop::collection::vec(-300..300i16, 1..50)) {
            let mut grid = OccupancyGrid::new(0.05);
            for step in steps {
                let value = grid.add(Cell { column: -3, row: 70 }, step);
                prop_assert!((FLOOR..=CEILING).contains(&value));
            }
        }

        #[test]
        fn a_written_cell_is_found_in_the_raster(x in -9.0..9.0f64, y in -9.0..9.0f64) {
            let mut grid = OccupancyGrid::new(0.05);
            let point = Point::new(x, y);
            grid.add(grid.cell(point), 400);
            grid.add(grid.cell(Point::new(0.0, 0.0)), -400);
            let raster = grid.raster();
            let (column, row) = raster.cell(point).unwrap();
            prop_assert!(raster.occupancy[row * raster.width + column] >= 97 || grid.cell(point) == grid.cell(Point::origin()));
            prop_assert_eq!(raster.occupancy.len(), raster.width * raster.height);
        }
    }
}
