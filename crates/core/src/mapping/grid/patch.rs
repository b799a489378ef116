//! Grid → the pieces of it that have changed, for a client that keeps a copy.

use super::{OccupancyGrid, SIDE, TILE};
use crate::mapping::raster::Raster;

/// A square of the grid's cells.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Patch {
    /// Its index, in squares from the frame's origin along x.
    pub column: i32,
    /// The same along y.
    pub row: i32,
    log_odds: [i16; TILE * TILE],
}

/// What has changed of a map.
#[derive(Clone, Debug)]
pub enum MapChange {
    /// These squares, of cells of this size in metres.
    Patches(f64, Vec<Patch>),
    /// Whatever: this is all of it.
    Whole(Raster),
}

impl Patch {
    /// Cells along a side.
    pub const SIDE: i32 = SIDE;

    /// The cells' values as in a [`Raster`], row by row from the lower left. `percent` is [`percents`].
    pub fn rows<'a>(&'a self, percent: &'a [i8]) -> impl DoubleEndedIterator<Item = impl Iterator<Item = i8> + 'a> {
        self.log_odds.chunks_exact(TILE).map(|row| row.iter().map(|&value| percent_of(value, percent)))
    }
}

/// The log-odds that [`percents`] covers, hundredths: beyond them the percentage stays 0 or 100.
const MAX_LOG_ODDS: i16 = 1000;

/// The probability of being occupied, from 0 to 100, by log-odds from −10 to 10 in hundredths.
#[must_use]
#[expect(clippy::cast_possible_truncation, reason = "percent")]
pub fn percents() -> Vec<i8> {
    let percent = |hundredths| (100.0 / (1.0 + libm::exp(-0.01 * f64::from(hundredths)))).round() as i8;
    (-MAX_LOG_ODDS..=MAX_LOG_ODDS).map(percent).collect()
}

pub(super) fn percent_of(log_odds: i16, percent: &[i8]) -> i8 {
    let index =
        usize::try_from(log_odds.clamp(-MAX_LOG_ODDS, MAX_LOG_ODDS) + MAX_LOG_ODDS).ok().filter(|_| log_odds != 0);
    index.and_then(|index| percent.get(index)).copied().unwrap_or(Raster::UNKNOWN)
}

impl OccupancyGrid {
    /// The newest revision.
    #[must_use]
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// The squares that have changed in `revision` or later, in no order.
    #[must_use]
    pub fn patches_since(&self, revision: u64) -> Vec<Patch> {
        let changed = self.indices.iter().map(|(key, tile)| (key, &self.tiles[*tile]));
        let changed = changed.filter(|(_, tile)| tile.revision >= revision);
        changed.map(|(&(column, row), tile)| Patch { column, row, log_odds: tile.cells }).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Point;

    #[test]
    fn patches_show_what_the_raster_shows() {
        let mut grid = OccupancyGrid::new(0.05);
        for (x, y, value) in [(-0.3, 1.9, 400), (2.2, -0.7, -320), (0.01, 0.01, 55)] {
            grid.add(grid.cell(Point::new(x, y)), value);
        }
        let (raster, percent) = (grid.raster(), percents());
        let mut known = 0;
        for patch in grid.patches_since(0) {
            for (y, row) in patch.rows(&percent).enumerate() {
                for (x, value) in row.enumerate() {
                    let centre_m = |patch: i32, cell: usize| (f64::from(patch * SIDE) + cell as f64 + 0.5) * 0.05;
                    let (column, row) =
                        raster.cell(Point::new(centre_m(patch.column, x), centre_m(patch.row, y))).unwrap();
                    assert_eq!(value, raster.occupancy[row * raster.width + column]);
                    known += usize::from(value != Raster::UNKNOWN);
                }
            }
        }
        assert_eq!(known, 3);
        grid.revise();
        assert!(grid.patches_since(grid.revision()).is_empty());
    }
}
