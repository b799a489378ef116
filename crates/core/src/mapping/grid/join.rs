//! Takes over what another grid knows.

use super::{Cell, OccupancyGrid, SIDE, TILE, WallNormal};

impl OccupancyGrid {
    /// Writes the other grid's cells, each moved by `place`, where this one knows less than `known`, hundredths of log-odds. `is_turned` is
    /// true where `place` turns by an odd number of quarter turns. Returns how many cells were written.
    pub fn adopt(&mut self, other: &Self, known: i16, is_turned: bool, place: impl Fn(Cell) -> Cell) -> usize {
        self.revise();
        let mut keys: Vec<_> = other.indices.iter().collect();
        keys.sort_unstable();
        let mut written = 0;
        for (&(column, row), &index) in keys {
            let tile = &other.tiles[index];
            let corner = Cell { column: column * SIDE, row: row * SIDE };
            for (y, cells) in (0..).zip(tile.cells.chunks_exact(TILE)) {
                for (x, &value) in (0..).zip(cells).filter(|(_, value)| **value != 0) {
                    let from = corner.offset(x, y);
                    let to = place(from);
                    let before = self.log_odds(to);
                    if before.abs() >= known {
                        continue;
                    }
                    self.add(to, value - before);
                    written += 1;
                    match (other.normal(from), is_turned) {
                        (Some(WallNormal::X), false) | (Some(WallNormal::Y), true) => self.face(to, WallNormal::X),
                        (Some(WallNormal::Y), false) | (Some(WallNormal::X), true) => self.face(to, WallNormal::Y),
                        (None, _) => {}
                    }
                }
            }
        }
        written
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_not_known_is_taken_over_and_turns() {
        let (mut one, mut other) = (OccupancyGrid::new(0.05), OccupancyGrid::new(0.05));
        let turned = |cell: Cell| Cell { column: 10 - cell.row, row: cell.column };
        for column in [3, 40] {
            other.add(Cell { column, row: -5 }, 300);
            other.face(Cell { column, row: -5 }, WallNormal::X);
        }
        one.add(Cell { column: 15, row: 3 }, -200);
        assert_eq!(one.adopt(&other, 50, true, turned), 1);
        assert_eq!(one.log_odds(Cell { column: 15, row: 3 }), -200);
        assert_eq!(one.log_odds(Cell { column: 15, row: 40 }), 300);
        assert_eq!(one.normal(Cell { column: 15, row: 40 }), Some(WallNormal::Y));
    }
}
