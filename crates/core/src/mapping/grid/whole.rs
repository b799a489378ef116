//! Grid → the rectangle of all that is known.

use super::patch::{percent_of, percents};
use super::{OccupancyGrid, TILE};
use crate::geometry::Point;
use crate::mapping::raster::Raster;

impl OccupancyGrid {
    /// The known part of the grid as a rectangle. A cell of it is one of the grid's, or the most occupied of a square of them where there would
    /// be more than [`crate::mapping::raster::MAX_CELLS`].
    #[must_use]
    #[expect(clippy::cast_sign_loss, reason = "differences from the minimum")]
    pub fn raster(&self) -> Raster {
        let percent = percents();
        let Some([[left, bottom], [right, top]]) = self.extent else { return Raster::default() };
        let [columns, rows] = [right - left, top - bottom].map(|tiles| (tiles as usize + 1) * TILE);
        let merge = Raster::coarseness(columns, rows);
        let (width, height) = (columns.div_ceil(merge), rows.div_ceil(merge));
        let mut occupancy = vec![Raster::UNKNOWN; width * height];
        for (&(column, row), &tile) in &self.indices {
            let (first_column, first_row) = ((column - left) as usize * TILE, (row - bottom) as usize * TILE);
            for (y, cells) in self.tiles[tile].cells.chunks_exact(TILE).enumerate() {
                let line = &mut occupancy[(first_row + y) / merge * width..][..width];
                for (x, &value) in cells.iter().enumerate().filter(|(_, value)| **value != 0) {
                    let kind = &mut line[(first_column + x) / merge];
                    *kind = (*kind).max(percent_of(value, &percent));
                }
            }
        }
        let [x, y] = [left, bottom].map(|tile| f64::from(tile) * TILE as f64 * self.cell_m);
        Raster { width, height, cell_m: self.cell_m * merge as f64, origin: Point::new(x, y), occupancy }
    }
}
