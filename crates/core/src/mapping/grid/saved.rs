//! The grid as plain numbers, for files.

use super::{OccupancyGrid, TILE, Tile};
use crate::mapping::params::Params;
use crate::saved_state::{InvalidState, MapState, TileState};

impl OccupancyGrid {
    /// The tiles as plain numbers, in the order of their columns and rows.
    #[must_use]
    pub fn saved_state(&self) -> MapState {
        let mut indices: Vec<_> = self.indices.iter().collect();
        indices.sort_unstable();
        let tile = |(&(column, row), &index): (&(i32, i32), &usize)| {
            let Tile { cells, normal, .. } = &*self.tiles[index];
            TileState { column, row, log_odds: cells.to_vec(), normal: normal.to_vec() }
        };
        MapState { cell_m: self.cell_m, tiles: indices.into_iter().map(tile).collect() }
    }

    /// The grid that wrote the memory.
    ///
    /// # Errors
    /// Where cells or tiles are none that a grid could have.
    pub fn restore(memory: &MapState) -> Result<Self, InvalidState> {
        Self::restore_with_params(memory, Params::default())
    }

    /// The same with other constants. A value beyond their bounds, but not beyond the defaults', becomes the bound.
    ///
    /// # Errors
    /// Where cells or tiles are none that a grid could have.
    pub fn restore_with_params(memory: &MapState, params: Params) -> Result<Self, InvalidState> {
        if !(0.005..=1.0).contains(&memory.cell_m) || memory.tiles.len() > super::MAX_TILES {
            return Err(InvalidState("the map's cells are of no usable size or number"));
        }
        let mut grid = Self::with_params(memory.cell_m, params);
        let (Params { floor, ceiling, .. }, default) = (params, Params::default());
        let allowed = floor.min(default.floor)..=ceiling.max(default.ceiling);
        for tile in &memory.tiles {
            let (Ok(mut cells), Ok(normal)) =
                (<[i16; TILE * TILE]>::try_from(&tile.log_odds[..]), tile.normal[..].try_into())
            else {
                return Err(InvalidState("a tile of the map is not whole"));
            };
            if tile.log_odds.iter().any(|value| !allowed.contains(value)) {
                return Err(InvalidState("a tile of the map holds what no tile can"));
            }
            cells.iter_mut().for_each(|value| *value = (*value).clamp(floor, ceiling));
            grid.extent = grid.extended((tile.column, tile.row));
            if grid.extent.is_none() {
                return Err(InvalidState("a tile of the map lies too far from the others"));
            }
            if grid.indices.insert((tile.column, tile.row), grid.tiles.len()).is_some() {
                return Err(InvalidState("a tile of the map is there twice"));
            }
            grid.tiles.push(Box::new(Tile { cells, normal, ..Tile::EMPTY }));
        }
        Ok(grid)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Point;

    #[test]
    fn a_saved_map_fits_other_bounds_and_keeps_what_lies_within() {
        let (near, far) = (Point::new(0.0, 0.0), Point::new(3.0, 0.0));
        let mut grid = OccupancyGrid::new(0.05);
        grid.add(grid.cell(near), 400);
        grid.add(grid.cell(far), -100);
        let narrow = Params { ceiling: 320, ..Params::default() };
        let restored = OccupancyGrid::restore_with_params(&grid.saved_state(), narrow).unwrap();
        assert_eq!([near, far].map(|point| restored.log_odds(restored.cell(point))), [320, -100]);

        let wide = Params { ceiling: 480, ..Params::default() };
        let mut grid = OccupancyGrid::with_params(0.05, wide);
        grid.add(grid.cell(near), 480);
        assert!(OccupancyGrid::restore_with_params(&grid.saved_state(), wide).is_ok());
        assert!(OccupancyGrid::restore(&grid.saved_state()).is_err());
    }
}
