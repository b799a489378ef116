//! Takes back what was drawn last: copies of the tiles as they were, taken before the first write after each mark.
//!
//! The copies come from a pool of fixed size. When it is empty the oldest mark is given up.

use super::{OccupancyGrid, Tile};
use std::collections::VecDeque;

/// Copies kept at most: 0.6 MB. A sonar ring changes some 25 tiles of 5 cm cells in half a metre.
const COPIES: usize = 256;
/// Marks kept at most.
const MARKS: usize = 16;

/// The latest marks.
#[derive(Clone, Debug)]
pub(super) struct Undo {
    /// Oldest first.
    marks: VecDeque<Mark>,
    /// Copies that are in no mark.
    #[expect(clippy::vec_box, reason = "copies move from mark to mark without being copied")]
    pool: Vec<Box<Tile>>,
    /// Lists of copies that are in no mark.
    lists: Vec<Vec<(usize, Box<Tile>)>>,
    /// How many of the newest marks are taken back.
    taken_back: usize,
    /// The number of the newest mark; a tile has the number of the one that holds its copy.
    newest: u64,
}

/// The tiles that have changed since a mark, as they were then: their indices and the copies.
#[derive(Clone, Debug)]
struct Mark {
    at: u64,
    copies: Vec<(usize, Box<Tile>)>,
}

impl Undo {
    fn new() -> Self {
        Self {
            marks: VecDeque::with_capacity(MARKS),
            pool: std::iter::repeat_with(|| Box::new(Tile::EMPTY)).take(COPIES).collect(),
            lists: std::iter::repeat_with(|| Vec::with_capacity(COPIES)).take(MARKS).collect(),
            taken_back: 0,
            newest: 0,
        }
    }

    fn give_up_oldest(&mut self) {
        if let Some(Mark { mut copies, .. }) = self.marks.pop_front() {
            self.pool.extend(copies.drain(..).map(|(_, copy)| copy));
            self.lists.push(copies);
        }
    }

    fn forget(&mut self) {
        self.taken_back = 0;
        while !self.marks.is_empty() {
            self.give_up_oldest();
        }
    }

    /// Something is about to be drawn: what was taken back cannot be drawn again over it.
    fn settle(&mut self) {
        if self.taken_back > 0 {
            self.forget();
        }
    }

    /// Keeps a tile that is about to change, if there is a mark and it is not kept yet.
    pub(super) fn keep(&mut self, index: usize, tile: &mut Tile) {
        self.settle();
        if self.marks.is_empty() || tile.mark == self.newest {
            return;
        }
        if self.pool.is_empty() {
            self.give_up_oldest();
        }
        if let Some(mark) = self.marks.back_mut()
            && let Some(mut copy) = self.pool.pop()
        {
            (copy.cells, copy.normal) = (tile.cells, tile.normal);
            mark.copies.push((index, copy));
            tile.mark = self.newest;
        }
    }
}

impl OccupancyGrid {
    /// What is drawn from now on can be taken back to here. Numbers of marks grow.
    pub fn mark(&mut self, at: u64) {
        let undo = self.undo.get_or_insert_with(|| Box::new(Undo::new()));
        undo.settle();
        if undo.marks.len() == MARKS {
            undo.give_up_oldest();
        }
        undo.newest += 1;
        let copies = undo.lists.pop().unwrap_or_default();
        undo.marks.push_back(Mark { at, copies });
    }

    /// Takes back what was drawn since the newest mark that is no later than `at`, or since the oldest that is kept.
    pub fn take_back(&mut self, at: u64) {
        let marks = self.undo.iter().flat_map(|undo| undo.marks.iter().rev());
        let later = marks.clone().take_while(|mark| mark.at > at).count();
        let count = marks.count().min(later + 1);
        self.swap(count, |undo, step| undo.marks.len() - 1 - step);
        if let Some(undo) = &mut self.undo {
            undo.taken_back = count;
        }
    }

    /// Draws again what was taken back. Nothing may have been drawn since.
    pub fn restore_taken_back(&mut self) {
        let count = self.undo.as_ref().map_or(0, |undo| undo.taken_back);
        self.swap(count, |undo, step| undo.marks.len() - count + step);
        if let Some(undo) = &mut self.undo {
            undo.forget();
        }
    }

    /// Exchanges the tiles of so many marks with their copies.
    fn swap(&mut self, count: usize, which: impl Fn(&Undo, usize) -> usize) {
        let revision = self.revise();
        let Some(undo) = &mut self.undo else { return };
        for step in 0..count {
            let mark = which(undo, step);
            for (index, copy) in undo.marks[mark].copies.iter_mut().rev() {
                let tile = &mut self.tiles[*index];
                std::mem::swap(&mut tile.cells, &mut copy.cells);
                std::mem::swap(&mut tile.normal, &mut copy.normal);
                tile.revision = revision;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Cell;
    use super::*;

    fn cell(column: i32) -> Cell {
        Cell { column, row: 3 }
    }

    fn drawn() -> OccupancyGrid {
        let mut grid = OccupancyGrid::new(0.05);
        for step in 0..10u8 {
            grid.add(cell(i32::from(step)), 100);
            grid.mark(10 * u64::from(step));
            grid.add(cell(40 * i32::from(step)), 20);
        }
        grid
    }

    #[test]
    fn what_was_drawn_since_a_mark_is_taken_back() {
        let mut grid = drawn();
        let whole = grid.saved_state();
        // Step 7 marked at 70, so that what came after it is gone.
        grid.take_back(75);
        assert_eq!([7, 8, 280, 240].map(|column| grid.log_odds(cell(column))), [100, 0, 0, 20]);
        grid.restore_taken_back();
        assert_eq!(grid.saved_state(), whole);
        // The marks are gone.
        grid.take_back(0);
        assert_eq!(grid.saved_state(), whole);
    }

    #[test]
    fn no_more_is_kept_than_the_pool_holds() {
        let mut grid = OccupancyGrid::new(0.05);
        grid.mark(1);
        grid.add(cell(0), 50);
        grid.mark(2);
        let fill = |grid: &mut OccupancyGrid| (1..=300).for_each(|tile| grid.add(cell(32 * tile), 50));
        fill(&mut grid);
        // Neither mark could be kept whole.
        grid.take_back(2);
        assert_eq!(grid.log_odds(cell(0)), 50);
        assert_eq!(grid.log_odds(cell(32)), 50);
        grid.mark(3);
        grid.add(cell(32), 50);
        grid.take_back(3);
        assert_eq!(grid.log_odds(cell(32)), 50);
    }
}
