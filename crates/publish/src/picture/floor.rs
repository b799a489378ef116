//! The map as coloured cells, and where a point of the map frame is in the picture.

use super::canvas::{Canvas, Ink, Pixel, mix};
use crate::map_file::{FREE_PERCENT, OCCUPIED_PERCENT};
use slamd_core::{Point, Raster};

/// The part of a raster that is shown, and its scale.
pub(super) struct Floor<'a> {
    raster: &'a Raster,
    /// First column and row shown, from the lower left.
    first: (usize, usize),
    /// Columns and rows shown.
    cells: (usize, usize),
    /// Pixels per cell; 1 where `cells_per_pixel` is more.
    pixels_per_cell: usize,
    cells_per_pixel: usize,
}

impl<'a> Floor<'a> {
    /// Shows everything that is known and everything in `points`.
    pub(super) fn new(raster: &'a Raster, points: impl Iterator<Item = Point>) -> Self {
        let margin = if raster.cell_m > 0.0 { whole(MARGIN_M / raster.cell_m) } else { 0 };
        let (low, high) = bounds(raster, points).unwrap_or(((0, 0), (0, 0)));
        let first = (low.0.saturating_sub(margin), low.1.saturating_sub(margin));
        let last = (
            (high.0 + margin).min(raster.width.saturating_sub(1)),
            (high.1 + margin).min(raster.height.saturating_sub(1)),
        );
        let cells = (last.0.saturating_sub(first.0) + 1, last.1.saturating_sub(first.1) + 1);
        let long = cells.0.max(cells.1);
        Self {
            raster,
            first,
            cells,
            pixels_per_cell: (LONG_SIDE_PX / long).max(1),
            cells_per_pixel: long.div_ceil(2 * LONG_SIDE_PX).max(1),
        }
    }

    /// Width and height in pixels.
    pub(super) fn size(&self) -> (usize, usize) {
        let pixels = |cells: usize| cells.div_ceil(self.cells_per_pixel) * self.pixels_per_cell;
        (pixels(self.cells.0), pixels(self.cells.1))
    }

    /// Metres along x and y.
    pub(super) fn size_m(&self) -> (f64, f64) {
        (self.cells.0 as f64 * self.raster.cell_m, self.cells.1 as f64 * self.raster.cell_m)
    }

    /// Pixels per metre.
    pub(super) fn scale_px_m(&self) -> f64 {
        let cell_m = if self.raster.cell_m > 0.0 { self.raster.cell_m } else { 1.0 };
        self.pixels_per_cell as f64 / (self.cells_per_pixel as f64 * cell_m)
    }

    /// A point of the map frame, in pixels from the floor's upper left corner.
    pub(super) fn pixel(&self, point: Point) -> Pixel {
        let left_m = self.raster.origin.x + self.first.0 as f64 * self.raster.cell_m;
        let bottom_m = self.raster.origin.y + self.first.1 as f64 * self.raster.cell_m;
        let scale = self.scale_px_m();
        ((point.x - left_m) * scale, self.size().1 as f64 - (point.y - bottom_m) * scale)
    }

    /// Colours the cells, the upper left corner of the floor at pixel (`left`, `top`).
    pub(super) fn paint(&self, canvas: &mut Canvas, (left, top): (usize, usize)) {
        let (width, height) = self.size();
        let mut inks = Vec::new();
        for row in 0..height {
            if row.is_multiple_of(self.pixels_per_cell) {
                let cells =
                    (0..width / self.pixels_per_cell).map(|column| (column, (height - 1 - row) / self.pixels_per_cell));
                inks.clear();
                inks.extend(cells.map(|cell| ink(self.occupancy(cell))));
            }
            for column in 0..width {
                canvas.set(left + column, top + row, inks[column / self.pixels_per_cell]);
            }
        }
    }

    /// The greatest occupancy in a block of `cells_per_pixel` squared cells: a thin wall must not vanish.
    fn occupancy(&self, (column, row): (usize, usize)) -> i8 {
        let block = |first: usize, at: usize, end: usize| {
            let from = first + at * self.cells_per_pixel;
            from..(from + self.cells_per_pixel).min(end)
        };
        let columns = block(self.first.0, column, self.raster.width);
        block(self.first.1, row, self.raster.height)
            .flat_map(|y| columns.clone().map(move |x| y * self.raster.width + x))
            .filter_map(|index| self.raster.occupancy.get(index).copied())
            .max()
            .unwrap_or(Raster::UNKNOWN)
    }
}

type Cell = (usize, usize);

/// The lowest and highest column and row that hold something.
fn bounds(raster: &Raster, points: impl Iterator<Item = Point>) -> Option<(Cell, Cell)> {
    let known = raster
        .occupancy
        .iter()
        .enumerate()
        .filter(|(_, percent)| **percent != Raster::UNKNOWN)
        .map(|(index, _)| (index % raster.width.max(1), index / raster.width.max(1)));
    known.chain(points.filter_map(|point| raster.cell(point))).fold(None, |bounds, (x, y)| {
        let ((x0, y0), (x1, y1)) = bounds.unwrap_or(((x, y), (x, y)));
        Some(((x0.min(x), y0.min(y)), (x1.max(x), y1.max(y))))
    })
}

fn ink(percent: i8) -> Ink {
    if percent < 0 {
        return UNKNOWN;
    }
    let part = (f64::from(percent) - f64::from(FREE_PERCENT)) / f64::from(OCCUPIED_PERCENT - FREE_PERCENT);
    mix(FREE, WALL, part)
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small positive number of cells")]
fn whole(cells: f64) -> usize {
    cells.ceil() as usize
}

/// The floor's long side, roughly; large maps have up to twice as many pixels.
const LONG_SIDE_PX: usize = 1200;
/// Shown round everything that is known, metres.
const MARGIN_M: f64 = 0.3;

pub(super) const UNKNOWN: Ink = [228, 230, 235, 255];
const FREE: Ink = [253, 253, 251, 255];
const WALL: Ink = [46, 56, 77, 255];
