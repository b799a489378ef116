//! The map as coloured cells, and where a point of the map frame is in the picture.

use super::canvas::mix;
use super::surface::{Ink, Pixel, Surface};
use crate::map_file::{FREE_PERCENT, OCCUPIED_PERCENT};
use crate::plan::{Place, Plan};
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

    /// True if a wall is drawn in a rectangle of pixels, from its upper left to its lower right corner.
    pub(super) fn has_walls(&self, low: Pixel, high: Pixel) -> bool {
        let block = |pixels: f64| whole_down(pixels) / self.pixels_per_cell * self.cells_per_pixel;
        let top = self.size().1 as f64;
        let rows = self.first.1 + block(top - high.1)..=self.first.1 + block(top - low.1);
        let columns = self.first.0 + block(low.0)..=self.first.0 + block(high.0);
        let occupancy = |row: usize, column: usize| self.raster.occupancy.get(row * self.raster.width + column);
        rows.into_iter().any(|row| {
            columns.clone().any(|column| occupancy(row, column).is_some_and(|percent| *percent >= OCCUPIED_PERCENT))
        })
    }

    /// Colours the cells, the upper left corner of the floor at pixel (`left`, `top`). Neighbours of one colour are one rectangle.
    pub(super) fn paint(&self, canvas: &mut dyn Surface, plan: &Plan, (left, top): (usize, usize)) {
        let side = self.pixels_per_cell;
        let (columns, rows) = (self.size().0 / side, self.size().1 / side);
        // First column, end column, first row from above, colour.
        let mut open: Vec<(usize, usize, usize, Ink)> = Vec::new();
        let mut close = |(from, to, first, ink): (usize, usize, usize, Ink), row: usize| {
            let corner = (left + from * side, top + first * side);
            canvas.rectangle(corner, ((to - from) * side, (row - first) * side), ink);
        };
        let mut runs: Vec<(usize, usize, Ink)> = Vec::new();
        for row in 0..rows {
            runs.clear();
            for column in 0..columns {
                let ink = self.ink(plan, (column, rows - 1 - row));
                match runs.last_mut() {
                    Some(run) if run.2 == ink => run.1 = column + 1,
                    _ => runs.push((column, column + 1, ink)),
                }
            }
            let mut above = std::mem::take(&mut open).into_iter().peekable();
            for &(from, to, ink) in &runs {
                while let Some(ended) = above.next_if(|run| run.0 < from) {
                    close(ended, row);
                }
                match above.next_if(|run| run.0 == from) {
                    Some(same) if same.1 == to && same.3 == ink => open.push(same),
                    other => {
                        if let Some(ended) = other {
                            close(ended, row);
                        }
                        open.push((from, to, row, ink));
                    }
                }
            }
            above.for_each(|ended| close(ended, row));
        }
        open.into_iter().for_each(|ended| close(ended, rows));
    }

    /// The colour of a block of `cells_per_pixel` squared cells. Its greatest occupancy counts: a thin wall must not vanish.
    fn ink(&self, plan: &Plan, (column, row): (usize, usize)) -> Ink {
        let block = |first: usize, at: usize, end: usize| {
            let from = first + at * self.cells_per_pixel;
            from..(from + self.cells_per_pixel).min(end)
        };
        let columns = block(self.first.0, column, self.raster.width);
        block(self.first.1, row, self.raster.height)
            .flat_map(|y| columns.clone().map(move |x| y * self.raster.width + x))
            .filter_map(|index| Some((*self.raster.occupancy.get(index)?, index)))
            .max()
            .map_or(UNKNOWN, |(percent, index)| ink(percent, plan.place(index)))
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

/// Few colours, so that a plan has plain areas.
fn ink(percent: i8, place: Place) -> Ink {
    match (place, percent) {
        (_, ..0) => UNKNOWN,
        (Place::Outside, OCCUPIED_PERCENT..) => mix(UNKNOWN, WALL, 0.25),
        (Place::Outside, _) => OUTSIDE,
        (Place::Inside, ..=FREE_PERCENT) => FREE,
        (Place::Inside, ..=LIKELY_FREE_PERCENT) => mix(FREE, WALL, 0.1),
        (Place::Inside, ..OCCUPIED_PERCENT) => mix(FREE, WALL, 0.4),
        (Place::Inside, _) => WALL,
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small positive number of cells")]
fn whole(cells: f64) -> usize {
    cells.ceil() as usize
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a place in a picture")]
fn whole_down(pixels: f64) -> usize {
    pixels.max(0.0) as usize
}

/// The floor's long side, roughly; large maps have up to twice as many pixels.
const LONG_SIDE_PX: usize = 1200;
/// More likely free than not, percent.
const LIKELY_FREE_PERCENT: i8 = 49;
/// Shown round everything that is known, metres.
const MARGIN_M: f64 = 0.3;

pub(super) const UNKNOWN: Ink = [228, 230, 235, 255];
/// Seen from a room, through a gap or as an echo of an echo.
pub(super) const OUTSIDE: Ink = [238, 240, 243, 255];
const FREE: Ink = [253, 253, 251, 255];
const WALL: Ink = [46, 56, 77, 255];
