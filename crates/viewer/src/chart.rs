//! The sink's own copy of the map. Viewers that join late or reconnect receive the full map.

use super::mailbox::NewMap;
use slamd_core::{Patch, Raster, stages::percents};
use std::collections::BTreeMap;
use std::sync::Arc;

/// The map as received so far.
#[derive(Debug)]
pub(super) struct Chart {
    cell_m: f64,
    patches: BTreeMap<(i32, i32), Arc<Patch>>,
    whole: Option<Arc<Raster>>,
    percent: Vec<i8>,
}

/// The map as an image. Row 0 is the top row.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Picture {
    /// Cells along x.
    pub(super) width: u32,
    /// Cells along y.
    pub(super) height: u32,
    /// Side of a cell, metres.
    pub(super) cell_m: f64,
    /// The lower left corner, map frame, metres.
    pub(super) corner_m: [f64; 2],
    /// As a ROS `OccupancyGrid`: 0 free, 100 occupied, 255 unknown.
    pub(super) cells: Vec<u8>,
}

impl Picture {
    /// Centre and size, metres.
    #[must_use]
    pub(super) fn extent_m(&self) -> ([f64; 2], [f64; 2]) {
        let size = [f64::from(self.width) * self.cell_m, f64::from(self.height) * self.cell_m];
        ([self.corner_m[0] + 0.5 * size[0], self.corner_m[1] + 0.5 * size[1]], size)
    }
}

impl Default for Chart {
    fn default() -> Self {
        Self { cell_m: 0.0, patches: BTreeMap::new(), whole: None, percent: percents() }
    }
}

/// Width of the margin around the known cells, cells.
const MARGIN: usize = 4;

impl Chart {
    /// Applies changes. Returns true if there are any.
    pub(super) fn update(&mut self, new: NewMap) -> bool {
        let is_new = new.whole.is_some() || !new.patches.is_empty();
        if let Some(whole) = new.whole {
            self.whole = Some(whole);
        }
        if !new.patches.is_empty() {
            self.cell_m = new.cell_m;
            self.patches.extend(new.patches);
        }
        is_new
    }

    /// The known part of the map; `None` while nothing is known.
    #[must_use]
    pub(super) fn picture(&self) -> Option<Picture> {
        self.whole.as_ref().map_or_else(|| cropped(&self.raster()?), |whole| cropped(whole))
    }

    #[expect(clippy::cast_sign_loss, reason = "differences from the minimum")]
    fn raster(&self) -> Option<Raster> {
        const SIDE: usize = Patch::SIDE.unsigned_abs() as usize;
        let (left, right) = bounds(self.patches.keys().map(|key| key.0))?;
        let (bottom, top) = bounds(self.patches.keys().map(|key| key.1))?;
        let (width, height) = ((right - left + 1) as usize * SIDE, (top - bottom + 1) as usize * SIDE);
        let mut occupancy = vec![Raster::UNKNOWN; width * height];
        for (&(column, row), patch) in &self.patches {
            let corner = (row - bottom) as usize * SIDE * width + (column - left) as usize * SIDE;
            for (y, values) in patch.rows(&self.percent).enumerate() {
                occupancy[corner + y * width..].iter_mut().zip(values).for_each(|(cell, value)| *cell = value);
            }
        }
        let corner_m = |patch: i32| f64::from(patch * Patch::SIDE) * self.cell_m;
        let origin = slamd_core::Point::new(corner_m(left), corner_m(bottom));
        Some(Raster { width, height, cell_m: self.cell_m, origin, occupancy })
    }
}

fn bounds(indices: impl Iterator<Item = i32> + Clone) -> Option<(i32, i32)> {
    Some((indices.clone().min()?, indices.max()?))
}

/// The known cells and a margin, with the top row first.
#[expect(clippy::cast_possible_truncation, reason = "rasters are bounded")]
fn cropped(raster: &Raster) -> Option<Picture> {
    let is_known = |cell: &i8| *cell != Raster::UNKNOWN;
    let (mut left, mut right, mut bottom, mut top) = (usize::MAX, 0, usize::MAX, 0);
    for (row, cells) in raster.occupancy.chunks_exact(raster.width.max(1)).enumerate() {
        if let (Some(first), Some(last)) = (cells.iter().position(is_known), cells.iter().rposition(is_known)) {
            (left, right) = (left.min(first), right.max(last + 1));
            (bottom, top) = (bottom.min(row), row + 1);
        }
    }
    if left >= right {
        return None;
    }
    let (left, bottom) = (left.saturating_sub(MARGIN), bottom.saturating_sub(MARGIN));
    let (right, top) = ((right + MARGIN).min(raster.width), (top + MARGIN).min(raster.height));
    let rows = raster.occupancy.chunks_exact(raster.width).take(top).skip(bottom).rev();
    Some(Picture {
        width: (right - left) as u32,
        height: (top - bottom) as u32,
        cell_m: raster.cell_m,
        corner_m: [raster.origin.x + left as f64 * raster.cell_m, raster.origin.y + bottom as f64 * raster.cell_m],
        // -1, unknown, becomes 255.
        cells: rows.flat_map(|row| row[left..right].iter().map(|cell| cell.cast_unsigned())).collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use slamd_core::{Point, stages::OccupancyGrid};

    fn changes(grid: &OccupancyGrid, since: u64) -> NewMap {
        let patches = grid.patches_since(since).into_iter();
        let patches = patches.map(|patch| ((patch.column, patch.row), Arc::new(patch))).collect();
        NewMap { cell_m: grid.cell_m(), patches, whole: None }
    }

    #[test]
    fn patches_add_up_to_the_whole_map() {
        let mut grid = OccupancyGrid::new(0.05);
        let mut chart = Chart::default();
        assert!(chart.picture().is_none());
        for (revision, x, y) in [(1, -3.0, 2.0), (2, 4.0, 0.5), (3, -3.0, 2.05), (4, 0.0, -1.0)] {
            assert_eq!(grid.revise(), revision);
            grid.add(grid.cell(Point::new(x, y)), 300);
            assert!(chart.update(changes(&grid, revision)));
        }
        assert!(!chart.update(changes(&grid, 5)));
        assert_eq!(chart.picture(), cropped(&grid.raster()));
    }

    #[test]
    fn the_first_row_is_the_top_row() {
        let mut occupancy = vec![Raster::UNKNOWN; 40 * 30];
        occupancy[10 * 40 + 20] = 100;
        occupancy[11 * 40 + 20] = 0;
        let raster = Raster { width: 40, height: 30, cell_m: 0.1, origin: Point::new(1.0, 2.0), occupancy };
        let picture = cropped(&raster).unwrap();
        assert_eq!((picture.width, picture.height), (9, 10));
        assert_eq!((picture.cells[4 * 9 + 4], picture.cells[5 * 9 + 4], picture.cells[0]), (0, 100, 255));
        assert!((picture.corner_m[0] - 2.6).abs() < 1e-9 && (picture.corner_m[1] - 2.6).abs() < 1e-9);
    }
}
