//! The occupancy grid: log-odds in sparse tiles.
//!
//! A cell holds ln(p / (1 − p)) in hundredths, clamped so that the map can follow a changed world (Thrun, Burgard and Fox, Probabilistic
//! Robotics, chapter 9). Tiles appear where something is written; how many is bounded, and what did not fit is counted.

mod patch;
mod ray;
mod saved;
mod undo;
mod whole;

pub use patch::{MapChange, Patch, percents};
pub(crate) use ray::Reader;

use self::undo::Undo;
use super::params::Params;
use crate::geometry::Point;
use rustc_hash::FxHashMap;

/// Cells along a tile's side.
const SIDE: i32 = 32;
const TILE: usize = SIDE.unsigned_abs() as usize;
/// Tiles at most: 10,000 m² of 5 cm cells take about 4,000.
const MAX_TILES: usize = 16_384;
/// The rectangle round all tiles holds no more: 1.3 km² of 5 cm cells. One tile far off must not make the picture of all of them useless.
const MAX_ENCLOSED: u64 = 1 << 19;
/// No tile lies farther from the origin: no cell does, see [`OccupancyGrid::cell`].
const FARTHEST_TILE: u32 = 4_000_000;

/// A cell's index: column and row from the frame's origin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Cell {
    /// Along x.
    pub column: i32,
    /// Along y.
    pub row: i32,
}

impl Cell {
    /// The cell so many columns and rows on.
    #[must_use]
    pub const fn offset(self, columns: i32, rows: i32) -> Self {
        Self { column: self.column.saturating_add(columns), row: self.row.saturating_add(rows) }
    }
}

/// The axis that a wall's normal lies along.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WallNormal {
    /// The wall runs along y.
    X,
    /// The wall runs along x.
    Y,
}

#[derive(Clone, Debug)]
struct Tile {
    /// Log-odds, hundredths.
    cells: [i16; TILE * TILE],
    /// Two bits per row and column: a wall that faces along x, along y.
    normal: [[u32; 2]; TILE],
    /// The grid's revision at the last change.
    revision: u64,
    /// The number of the mark that holds a copy of it.
    mark: u64,
}

impl Tile {
    const EMPTY: Self = Self { cells: [0; TILE * TILE], normal: [[0; 2]; TILE], revision: 0, mark: 0 };

    /// The one axis that the wall in a cell faces along.
    fn normal(&self, row: usize, bit: u32) -> Option<WallNormal> {
        match self.normal[row].map(|bits| bits & bit != 0) {
            [true, false] => Some(WallNormal::X),
            [false, true] => Some(WallNormal::Y),
            _ => None,
        }
    }
}

/// The grid.
#[derive(Clone, Debug)]
pub struct OccupancyGrid {
    params: Params,
    cell_m: f64,
    cells_per_m: f64,
    #[expect(clippy::vec_box, reason = "each has its own allocation: growth moves no tile")]
    tiles: Vec<Box<Tile>>,
    indices: FxHashMap<(i32, i32), usize>,
    recent: Option<((i32, i32), usize)>,
    /// First and last column and row of the tiles.
    extent: Option<[[i32; 2]; 2]>,
    refused: u64,
    revision: u64,
    undo: Option<Box<Undo>>,
}

impl OccupancyGrid {
    /// An empty grid with cells of `cell_m` metres.
    #[must_use]
    pub fn new(cell_m: f64) -> Self {
        Self::with_params(cell_m, Params::default())
    }

    /// The same with other constants.
    #[must_use]
    pub fn with_params(cell_m: f64, params: Params) -> Self {
        Self {
            params,
            cell_m,
            cells_per_m: cell_m.recip(),
            tiles: Vec::new(),
            indices: FxHashMap::default(),
            recent: None,
            extent: None,
            refused: 0,
            revision: 0,
            undo: None,
        }
    }

    /// The constants.
    #[must_use]
    pub fn params(&self) -> &Params {
        &self.params
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
    #[expect(clippy::cast_possible_truncation, reason = "saturates, and is then clamped")]
    pub fn cell(&self, point: Point) -> Cell {
        const FARTHEST: i32 = 100_000_000;
        let index = |coordinate_m: f64| {
            let cells = coordinate_m * self.cells_per_m;
            let whole = (cells as i32).clamp(-FARTHEST, FARTHEST);
            // A cast rounds toward zero.
            whole - i32::from(f64::from(whole) > cells)
        };
        Cell { column: index(point.x), row: index(point.y) }
    }

    /// Begins a new revision and returns it: what is written from now on belongs to it.
    pub fn revise(&mut self) -> u64 {
        self.revision += 1;
        self.revision
    }

    /// The lower left cells of the tiles that have changed in `revision` or later, in no order.
    pub fn changed_since(&self, revision: u64) -> impl Iterator<Item = Cell> {
        let corner = |&(column, row): &(i32, i32)| Cell { column: column * SIDE, row: row * SIDE };
        self.indices
            .iter()
            .filter(move |(_, tile)| self.tiles[**tile].revision >= revision)
            .map(move |(key, _)| corner(key))
    }

    /// Adds `hundredths` of log-odds to a cell.
    pub fn add(&mut self, cell: Cell, hundredths: i16) {
        let Params { floor, ceiling, .. } = self.params;
        if let Some(tile) = self.tile(cell) {
            let value = &mut tile.cells[index_in_tile(cell)];
            *value = value.saturating_add(hundredths).clamp(floor, ceiling);
        }
    }

    /// Takes `hundredths` from an occupied cell, down to where nothing is known, unless it is as well known as `than`.
    pub fn fade(&mut self, cell: Cell, than: Cell, hundredths: i16) {
        let value = self.log_odds(cell);
        if value > 0 && value < self.log_odds(than) {
            self.add(cell, -hundredths.min(value));
        }
    }

    /// The wall in a cell faces along this axis; one that has faced along both is no mirror.
    pub fn face(&mut self, cell: Cell, normal: WallNormal) {
        if let Some(tile) = self.tile(cell) {
            let (row, bit) = bit_in_tile(cell);
            tile.normal[row][normal as usize] |= bit;
        }
    }

    /// The one axis that the wall in a cell faces along; none where that is not known.
    #[must_use]
    pub fn normal(&self, cell: Cell) -> Option<WallNormal> {
        let (row, bit) = bit_in_tile(cell);
        self.tiles[self.tile_index(tile_of(cell))?].normal(row, bit)
    }

    /// A cell's log-odds in hundredths; 0 where nothing is known.
    #[must_use]
    pub fn log_odds(&self, cell: Cell) -> i16 {
        self.tile_index(tile_of(cell)).map_or(0, |tile| self.tiles[tile].cells[index_in_tile(cell)])
    }

    /// Where the tile of that key is.
    fn tile_index(&self, key: (i32, i32)) -> Option<usize> {
        match self.recent {
            Some((recent, index)) if recent == key => Some(index),
            _ => self.indices.get(&key).copied(),
        }
    }

    /// The tile of a cell that is about to change; none where there is no room for it.
    fn tile(&mut self, cell: Cell) -> Option<&mut Tile> {
        let index = self.tile_index_or_new(cell)?;
        Some(&mut self.tiles[index])
    }

    /// Where the tile of a cell is that is about to change, made where it does not exist; none, and counted, where there is no more room.
    fn tile_index_or_new(&mut self, cell: Cell) -> Option<usize> {
        let key = tile_of(cell);
        let index = match self.tile_index(key) {
            Some(index) => index,
            None => {
                let index = self.tiles.len();
                let Some(extent) = self.extended(key).filter(|_| index < MAX_TILES) else {
                    self.refused += 1;
                    return None;
                };
                self.extent = Some(extent);
                self.tiles.push(Box::new(Tile::EMPTY));
                self.indices.insert(key, index);
                index
            }
        };
        self.recent = Some((key, index));
        let tile = &mut *self.tiles[index];
        tile.revision = self.revision;
        if let Some(undo) = &mut self.undo {
            undo.keep(index, tile);
        }
        Some(index)
    }

    /// The extent with one more tile; none where that would enclose too much.
    fn extended(&self, (column, row): (i32, i32)) -> Option<[[i32; 2]; 2]> {
        let [[left, bottom], [right, top]] = self.extent.unwrap_or([[column, row]; 2]);
        let (low, high) = ([left.min(column), bottom.min(row)], [right.max(column), top.max(row)]);
        let [columns, rows] = [0, 1].map(|axis| u64::from(high[axis].abs_diff(low[axis])) + 1);
        let is_near = [low, high].as_flattened().iter().all(|index| index.unsigned_abs() < FARTHEST_TILE);
        (is_near && columns * rows <= MAX_ENCLOSED).then_some([low, high])
    }
}

const fn tile_of(cell: Cell) -> (i32, i32) {
    (cell.column >> SIDE.trailing_zeros(), cell.row >> SIDE.trailing_zeros())
}

/// Column and row in the tile.
#[expect(clippy::cast_sign_loss, reason = "the lowest bits of a number are not negative")]
const fn in_tile(cell: Cell) -> (usize, usize) {
    ((cell.column & (SIDE - 1)) as usize, (cell.row & (SIDE - 1)) as usize)
}

const fn index_in_tile(cell: Cell) -> usize {
    let (column, row) = in_tile(cell);
    row << TILE.trailing_zeros() | column
}

/// Row and column bit in the tile.
const fn bit_in_tile(cell: Cell) -> (usize, u32) {
    let (column, row) = in_tile(cell);
    (row, 1 << column)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mapping::raster::MAX_CELLS;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn log_odds_stay_clamped(steps in prop::collection::vec(-300..300i16, 1..50)) {
            let mut grid = OccupancyGrid::new(0.05);
            for step in steps {
                let cell = Cell { column: -3, row: 70 };
                grid.add(cell, step);
                let value = grid.log_odds(cell);
                prop_assert!((grid.params.floor..=grid.params.ceiling).contains(&value));
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

    #[test]
    fn only_changed_tiles_are_published() {
        let mut grid = OccupancyGrid::new(0.05);
        let (first, second) = (Cell { column: 5, row: -1 }, Cell { column: 40, row: 3 });
        grid.add(first, 10);
        let revision = grid.revise();
        assert_eq!(grid.changed_since(revision).count(), 0);
        grid.add(second, 10);
        assert_eq!(grid.changed_since(revision).collect::<Vec<_>>(), [Cell { column: 32, row: 0 }]);
        assert_eq!(grid.changed_since(0).count(), 2);
    }

    #[test]
    fn a_restored_grid_knows_what_it_knew() {
        let mut grid = OccupancyGrid::new(0.05);
        for (column, normal) in [(40, WallNormal::X), (-3, WallNormal::Y)] {
            grid.add(Cell { column, row: -70 }, 90);
            grid.face(Cell { column, row: -70 }, normal);
        }
        let restored = OccupancyGrid::restore(&grid.saved_state()).unwrap();
        assert_eq!(restored.saved_state(), grid.saved_state());
        assert_eq!(restored.normal(Cell { column: -3, row: -70 }), Some(WallNormal::Y));
        let mut far = grid.saved_state();
        far.tiles[0].column = i32::MIN;
        assert!(OccupancyGrid::restore(&far).is_err());
    }

    #[test]
    fn a_cell_far_off_is_refused_and_not_drawn() {
        let mut grid = OccupancyGrid::new(0.05);
        grid.add(Cell { column: 0, row: 0 }, 90);
        grid.add(grid.cell(Point::new(1e9, -1e9)), 90);
        grid.add(Cell { column: 0, row: 900 }, 90);
        assert_eq!((grid.tiles.len(), grid.refused(), grid.raster().height), (2, 1, 29 * TILE));
    }

    #[test]
    fn a_large_map_is_drawn_coarser() {
        let mut grid = OccupancyGrid::new(0.05);
        let [near, far] = [Point::new(-450.0, -450.0), Point::new(450.0, 450.0)];
        for point in [near, far] {
            grid.add(grid.cell(point), 400);
        }
        let raster = grid.raster();
        let at = |point| raster.cell(point).map(|(column, row)| raster.occupancy[row * raster.width + column]);
        assert!(raster.occupancy.len() <= MAX_CELLS && raster.cell_m > 0.05);
        assert_eq!(raster.occupancy.iter().filter(|&&value| value > 90).count(), 2);
        assert!(at(near) > Some(90) && at(far) > Some(90));
    }

    #[test]
    fn what_finds_no_room_is_counted() {
        let mut grid = OccupancyGrid::new(0.05);
        for column in 0..20_000 {
            grid.add(Cell { column: column * SIDE, row: 0 }, 10);
        }
        assert_eq!((grid.tiles.len(), grid.refused()), (MAX_TILES, 20_000 - MAX_TILES as u64));
    }

    #[test]
    fn fading_never_makes_free() {
        let mut grid = OccupancyGrid::new(0.05);
        let cell = Cell { column: 0, row: 0 };
        let known = cell.offset(1, 0);
        grid.add(cell, 10);
        grid.fade(cell, known, 3);
        assert_eq!(grid.log_odds(cell), 10, "the other is no better known");
        grid.add(known, 100);
        grid.fade(cell, known, 30);
        assert_eq!(grid.log_odds(cell), 0);
        grid.add(cell, -10);
        grid.fade(cell, known, 30);
        assert_eq!(grid.log_odds(cell), -10);
    }
}
