//! Merges maps into one: the sum of integers, cell by cell.
//!
//! `merged(cell) = Σ over robots of log_odds(cell of the robot's map that the cell's middle lies in)`
//!
//! Only the newest map of each robot counts, in a total order ([`Grid`]). So the result depends only on
//! the set of received maps, bit for bit, and not on order, repetition, loss or refill. All arithmetic
//! after the placement is in integers. Sums are clamped only when they are written as an image.

use crate::name::Name;
use crate::wire::{Grid, SIDE, TILE, Tile, VERSION, WireError};
use serde::Serialize;
use slamd_core::{
    Pose2, Raster,
    saved_state::{MapState, TileState},
    stages::OccupancyGrid,
};
use std::collections::BTreeMap;

/// The newest map of each robot.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Newest(BTreeMap<Name, Grid>);

impl Newest {
    /// Stores a map if it is newer than the robot's last one. Returns true if it is.
    pub fn take(&mut self, robot: &Name, grid: Grid) -> bool {
        let is_newer = self.0.get(robot).is_none_or(|known| *known < grid);
        if is_newer {
            self.0.insert(robot.clone(), grid);
        }
        is_newer
    }

    /// The newest map of a robot.
    #[must_use]
    pub fn get(&self, robot: &Name) -> Option<&Grid> {
        self.0.get(robot)
    }

    /// All, by name.
    pub fn iter(&self) -> impl Iterator<Item = (&Name, &Grid)> {
        self.0.iter()
    }
}

/// The pose of a robot's map on the site, `site_from_map`, in integers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Placement {
    x_um: i64,
    y_um: i64,
    /// In units of 2⁻³⁰.
    cos: i64,
    sin: i64,
}

const ONE_BITS: u32 = 30;

impl Placement {
    /// A pose, to the micrometre and the billionth of a turn's sine.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "saturates")]
    pub fn new(site_from_map: Pose2) -> Self {
        let (sin, cos) = libm::sincos(site_from_map.theta_rad);
        let [x_um, y_um] = [site_from_map.x_m, site_from_map.y_m].map(|metres| libm::round(metres * 1e6) as i64);
        let [sin, cos] = [sin, cos].map(|part| libm::round(part * f64::from(1u32 << ONE_BITS)) as i64);
        Self { x_um, y_um, cos, sin }
    }

    /// The map's point at a point of the site; half micrometres.
    fn inverse(&self, x: i128, y: i128) -> [i128; 2] {
        let (x, y) = (x - 2 * i128::from(self.x_um), y - 2 * i128::from(self.y_um));
        let (cos, sin) = (i128::from(self.cos), i128::from(self.sin));
        [cos * x + sin * y, cos * y - sin * x].map(|sum| sum >> ONE_BITS)
    }

    /// The site's point at a point of the map; half micrometres.
    fn forward(&self, x: i128, y: i128) -> [i128; 2] {
        let (cos, sin) = (i128::from(self.cos), i128::from(self.sin));
        let [x, y] = [cos * x - sin * y, sin * x + cos * y].map(|sum| sum >> ONE_BITS);
        [x + 2 * i128::from(self.x_um), y + 2 * i128::from(self.y_um)]
    }
}

/// The sum of maps, in the site's frame.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Merged {
    /// Side of a cell, micrometres.
    cell_um: u32,
    /// Sums of log-odds in hundredths, by tile, row by row.
    tiles: BTreeMap<(i32, i32), Vec<i32>>,
}

impl Merged {
    /// Nothing yet, in cells of this size.
    #[must_use]
    pub const fn new(cell_um: u32) -> Self {
        Self { cell_um, tiles: BTreeMap::new() }
    }

    /// True while nothing is known.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.tiles.is_empty()
    }

    /// Adds a robot's map.
    pub fn add(&mut self, grid: &Grid, placement: &Placement) {
        for tile in &grid.tiles {
            self.add_tile(tile, i128::from(grid.cell_um), placement);
        }
    }

    /// As the bytes of a file: a version byte and postcard's form.
    ///
    /// # Panics
    /// Never: it is made of numbers and lists.
    #[must_use]
    pub fn encode(&self) -> Vec<u8> {
        let mut bytes = vec![VERSION];
        bytes.extend(postcard::to_allocvec(self).expect("numbers and lists"));
        bytes
    }

    /// As an image's cells, with the sums clamped to the range of one robot's map.
    ///
    /// # Errors
    /// When the parts are too far apart for one image.
    pub fn raster(&self) -> Result<Raster, WireError> {
        // The limits of slamd's own grid, so that images of one robot and of many mean the same.
        let cell = |sum: &i32| i16::try_from((*sum).clamp(-320, 400)).unwrap_or_default();
        let normal = vec![[0; 2]; TILE.isqrt()];
        let tile = |(&(column, row), cells): (&(i32, i32), &Vec<i32>)| TileState {
            column,
            row,
            log_odds: cells.iter().map(cell).collect(),
            normal: normal.clone(),
        };
        let map = MapState { cell_m: f64::from(self.cell_um) * 1e-6, tiles: self.tiles.iter().map(tile).collect() };
        let grid = OccupancyGrid::restore(&map).map_err(|error| WireError::Content(error.to_string()))?;
        Ok(grid.raster())
    }

    /// Adds the value of each cell of the tile to the site's cells whose centres are in it.
    fn add_tile(&mut self, tile: &Tile, map_cell_um: i128, placement: &Placement) {
        let side = i128::from(SIDE);
        let (left, bottom) = (i128::from(tile.column) * side, i128::from(tile.row) * side);
        let Some([columns, rows]) = self.reach(left, bottom, map_cell_um, placement) else { return };
        let site_um = i128::from(self.cell_um);
        for row in rows {
            for column in columns.clone() {
                let middle = |cell: i32| (2 * i128::from(cell) + 1) * site_um;
                let inner = placement.inverse(middle(column), middle(row)).map(|at| at.div_euclid(2 * map_cell_um));
                let (Ok(x), Ok(y)) = (usize::try_from(inner[0] - left), usize::try_from(inner[1] - bottom)) else {
                    continue;
                };
                if x >= TILE.isqrt() || y >= TILE.isqrt() {
                    continue;
                }
                let value = tile.log_odds.get(y * TILE.isqrt() + x).copied().unwrap_or_default();
                if value != 0 {
                    *self.cell(column, row) += i32::from(value);
                }
            }
        }
    }

    /// The site's columns and rows that a tile can overlap; `None` if they exceed the integers.
    fn reach(
        &self,
        left: i128,
        bottom: i128,
        map_cell_um: i128,
        placement: &Placement,
    ) -> Option<[std::ops::RangeInclusive<i32>; 2]> {
        let side = i128::from(SIDE);
        let corners = [(0, 0), (side, 0), (0, side), (side, side)]
            .map(|(x, y)| placement.forward(2 * (left + x) * map_cell_um, 2 * (bottom + y) * map_cell_um));
        let range = |axis: usize| {
            let indices = corners.map(|corner| corner[axis].div_euclid(2 * i128::from(self.cell_um)));
            let (low, high) = (indices.iter().min()? - 1, indices.iter().max()? + 1);
            Some(i32::try_from(low).ok()?..=i32::try_from(high).ok()?)
        };
        Some([range(0)?, range(1)?])
    }

    #[expect(clippy::cast_sign_loss, reason = "a remainder is not negative")]
    fn cell(&mut self, column: i32, row: i32) -> &mut i32 {
        let key = (column.div_euclid(SIDE), row.div_euclid(SIDE));
        let index = (row.rem_euclid(SIDE) * SIDE + column.rem_euclid(SIDE)) as usize;
        &mut self.tiles.entry(key).or_insert_with(|| vec![0; TILE])[index]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::SessionId;
    use crate::wire::Start;
    use std::f64::consts::FRAC_PI_2;

    /// A wall of 20 cells along x and a lone cell.
    fn grid() -> Grid {
        let mut log_odds = vec![0i16; TILE];
        log_odds[3..23].fill(350);
        log_odds[17 * 32 + 5] = -80;
        let tiles = vec![Tile { column: 0, row: 0, log_odds }];
        Grid { session: SessionId::default(), seq: 1, start: Start::default(), cell_um: 50_000, tiles }
    }

    fn sums(merged: &Merged) -> Vec<(i32, i32, i32)> {
        let mut found = Vec::new();
        for (&(column, row), cells) in &merged.tiles {
            for (place, &value) in (0i32..).zip(cells).filter(|(_, value)| **value != 0) {
                found.push((column * SIDE + place % SIDE, row * SIDE + place / SIDE, value));
            }
        }
        found.sort_unstable();
        found
    }

    #[test]
    fn a_quarter_turn_and_whole_cells_lose_nothing() {
        let mut merged = Merged::new(50_000);
        merged.add(&grid(), &Placement::new(Pose2::new(1.0, -2.0, FRAC_PI_2)));
        // Turned counter-clockwise the cell (x, y) becomes (−1 − y, x), then it moves by (20, −40).
        let mut expected: Vec<_> = (3..23).map(|x| (20 - 1, x - 40, 350)).collect();
        expected.push((20 - 1 - 17, 5 - 40, -80));
        expected.sort_unstable();
        assert_eq!(sums(&merged), expected);
    }

    #[test]
    fn sums_saturate_in_the_picture_alone() {
        let mut merged = Merged::new(50_000);
        let here = Placement::new(Pose2::default());
        for _ in 0..3 {
            merged.add(&grid(), &here);
        }
        assert_eq!(sums(&merged)[0].2, 1050);
        let mut opposite = grid();
        opposite.tiles[0].log_odds.iter_mut().for_each(|value| *value = (-*value).max(-320));
        for _ in 0..2 {
            merged.add(&opposite, &here);
        }
        assert_eq!(sums(&merged)[0].2, 1050 - 640, "nothing was lost at the top");
        assert!(merged.raster().unwrap().occupancy.contains(&98));
    }

    #[test]
    fn any_turn_keeps_the_number_of_cells_nearly() {
        for degrees in [7.0, 30.0, 45.0, 123.0] {
            let mut merged = Merged::new(50_000);
            let mut full = grid();
            full.tiles[0].log_odds.fill(10);
            merged.add(&full, &Placement::new(Pose2::new(0.013, -7.7, f64::to_radians(degrees))));
            let cells = sums(&merged).len();
            assert!((1_004..=1_044).contains(&cells), "{cells} of 1024 at {degrees} degrees");
            assert!(sums(&merged).iter().all(|(.., value)| *value == 10), "no cell is counted twice");
        }
    }

    #[test]
    fn maps_too_far_off_for_one_picture_are_an_error() {
        let mut merged = Merged::new(50_000);
        merged.add(&grid(), &Placement::new(Pose2::default()));
        merged.add(&grid(), &Placement::new(Pose2::new(1e6, 1e6, 0.0)));
        assert!(merged.raster().is_err());
        merged.add(&grid(), &Placement::new(Pose2::new(1e12, 0.0, 0.0)));
    }
}
