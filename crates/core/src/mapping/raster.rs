//! A map as a plain rectangle of cells: what is written to files and shown to people.

use crate::geometry::Point;

/// Cells of a raster at most: 200 m by 200 m at 5 cm. A larger map is drawn coarser.
pub const MAX_CELLS: usize = 1 << 24;

/// A rectangle of cells in the map frame, with the values of a ROS `OccupancyGrid`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Raster {
    /// Cells along x.
    pub width: usize,
    /// Cells along y.
    pub height: usize,
    /// Side of a cell, metres.
    pub cell_m: f64,
    /// The lower left corner of cell 0.
    pub origin: Point,
    /// −1 unknown, else the probability of being occupied from 0 to 100; row by row from the lower left, `width * height` of them.
    pub occupancy: Vec<i8>,
}

impl Raster {
    /// The value of unknown cells.
    pub const UNKNOWN: i8 = -1;

    /// How many cells along a side of a `columns` by `rows` map become one, a power of two, for no more than [`MAX_CELLS`] in all.
    #[must_use]
    pub const fn coarseness(columns: usize, rows: usize) -> usize {
        let mut merge = 1;
        while columns.div_ceil(merge) * rows.div_ceil(merge) > MAX_CELLS {
            merge *= 2;
        }
        merge
    }

    /// The cell that holds a point of the map frame.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked against the raster's bounds")]
    pub fn cell(&self, point: Point) -> Option<(usize, usize)> {
        let column = libm::floor((point.x - self.origin.x) / self.cell_m);
        let row = libm::floor((point.y - self.origin.y) / self.cell_m);
        let inside = column >= 0.0 && row >= 0.0 && column < self.width as f64 && row < self.height as f64;
        inside.then_some((column as usize, row as usize))
    }
}
