//! The cells along a ray: a step is two additions, and a tile is looked up once for the cells of it that follow each other.

use super::{Cell, OccupancyGrid, Tile, WallNormal, bit_in_tile, index_in_tile, tile_of};
use crate::geometry::Point;

/// A ray's cells, one cell's length apart.
#[derive(Clone, Debug)]
pub struct Ray {
    /// Column and row in units of 2⁻³² cells.
    position: [i64; 2],
    step: [i64; 2],
    left: u32,
}

/// A cell is so many units long.
const UNITS: f64 = (1u64 << 32) as f64;
/// Farther off, in cells, a ray has no direction any more; no tile is there.
const FARTHEST: f64 = 1e8;
/// What makes the part of a cell that is left a cell.
const ALMOST_ONE: f64 = 1.0 - 1e-9;
/// Longer, in cells, no ray is.
const LONGEST: f64 = 1e5;

impl Ray {
    const fn cell(&self) -> Cell {
        Cell { column: (self.position[0] >> 32) as i32, row: (self.position[1] >> 32) as i32 }
    }

    /// From 10⁸ cells off, 10⁵ steps of a cell overflow nothing, and no step is taken where none is left: the hottest sums are not checked.
    const fn advance(&mut self) {
        self.position = [self.position[0].wrapping_add(self.step[0]), self.position[1].wrapping_add(self.step[1])];
        self.left = self.left.wrapping_sub(1);
    }
}

impl Iterator for Ray {
    type Item = Cell;

    #[inline]
    fn next(&mut self) -> Option<Cell> {
        let cell = self.cell();
        (self.left > 0).then(|| {
            self.advance();
            cell
        })
    }
}

impl OccupancyGrid {
    /// The cells on the way from `origin` in the direction of this cosine and sine: at `start_m`, a cell farther, and so on up to `reach_m`.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
    pub fn ray(&self, origin: Point, direction: (f64, f64), start_m: f64, reach_m: f64) -> Ray {
        let cells = |metres: f64| metres * self.cells_per_m;
        // A cast rounds toward zero, which is a 2⁻³² of a cell off at most, and cheaper than a call of floor.
        let units = |cells: f64| (cells.clamp(-FARTHEST, FARTHEST) * UNITS) as i64;
        let (cos, sin) = direction;
        Ray {
            position: [units(cells(origin.x + start_m * cos)), units(cells(origin.y + start_m * sin))],
            step: [units(cos), units(sin)],
            left: (cells(reach_m - start_m) + ALMOST_ONE).clamp(0.0, LONGEST) as u32,
        }
    }

    /// Adds the negative `hundredths` to the cells of a ray up to the first where something stands: a value above `opaque`, or a wall that
    /// is known at all. That cell, and how many steps it is from the first; none where nothing stands on the ray.
    pub fn clear(&mut self, mut ray: Ray, hundredths: i16, opaque: i16) -> Option<(u32, Cell)> {
        let length = ray.left;
        let floor = self.params.floor;
        while ray.left > 0 {
            let key = tile_of(ray.cell());
            let Some(index) = self.tile_index_or_new(ray.cell()) else {
                while ray.left > 0 && tile_of(ray.cell()) == key {
                    ray.advance();
                }
                continue;
            };
            let Tile { cells, normal, .. } = &mut *self.tiles[index];
            while ray.left > 0 && tile_of(ray.cell()) == key {
                let value = &mut cells[index_in_tile(ray.cell())];
                if *value > 0 {
                    let (row, bit) = bit_in_tile(ray.cell());
                    if *value > opaque || normal[row].iter().any(|bits| bits & bit != 0) {
                        return Some((length - ray.left, ray.cell()));
                    }
                }
                *value = value.saturating_add(hundredths).max(floor);
                ray.advance();
            }
        }
        None
    }

    /// Reads cells near each other.
    #[must_use]
    pub fn reader(&self) -> Reader<'_> {
        Reader { grid: self, key: None, tile: None }
    }
}

/// Reads a grid; it remembers the tile of the last cell.
#[derive(Clone, Debug)]
pub struct Reader<'a> {
    grid: &'a OccupancyGrid,
    key: Option<(i32, i32)>,
    tile: Option<&'a Tile>,
}

impl Reader<'_> {
    /// A cell's log-odds in hundredths; 0 where nothing is known.
    #[inline]
    pub fn log_odds(&mut self, cell: Cell) -> i16 {
        let key = tile_of(cell);
        if self.key != Some(key) {
            self.key = Some(key);
            self.tile = self.grid.indices.get(&key).map(|&index| &*self.grid.tiles[index]);
        }
        self.tile.map_or(0, |tile| tile.cells[index_in_tile(cell)])
    }

    /// The one axis that the wall in the cell read last, or one of its tile, faces along; none where that is not known.
    #[must_use]
    pub fn normal(&self, cell: Cell) -> Option<WallNormal> {
        let (row, bit) = bit_in_tile(cell);
        self.tile?.normal(row, bit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_ray_passes_the_cells_at_its_points(x in -9.0..9.0f64, y in -9.0..9.0f64, heading in -3.0..3.0f64, start in 0.0..1.0f64) {
            let grid = OccupancyGrid::new(0.05);
            let (sin, cos) = libm::sincos(heading);
            let cells: Vec<Cell> = grid.ray(Point::new(x, y), (cos, sin), start, 3.0).collect();
            prop_assert!((0.0..1.0).contains(&(cells.len() as f64 - (3.0 - start) / 0.05)));
            for (step, cell) in cells.iter().enumerate() {
                // A rounding may fall on the other side of a cell's edge.
                let near = [-1e-6, 1e-6].map(|off| {
                    let distance_m = start + 0.05 * step as f64;
                    grid.cell(Point::new(x + distance_m * cos + off, y + distance_m * sin + off))
                });
                prop_assert!(near.iter().any(|at| at.column == cell.column) && near.iter().any(|at| at.row == cell.row));
            }
        }

        #[test]
        fn a_reader_reads_what_is_there(cells in prop::collection::vec((-70..70i32, -70..70i32), 1..40)) {
            let mut grid = OccupancyGrid::new(0.05);
            for &(column, row) in cells.iter().step_by(2) {
                grid.add(Cell { column, row }, 90);
                grid.face(Cell { column, row }, WallNormal::Y);
            }
            let mut reader = grid.reader();
            for (column, row) in cells {
                let cell = Cell { column, row };
                prop_assert_eq!(reader.log_odds(cell), grid.log_odds(cell));
                prop_assert_eq!(reader.normal(cell), grid.normal(cell));
            }
        }
    }
}
