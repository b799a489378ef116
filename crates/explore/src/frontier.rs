//! Frontiers: free cells beside unknown ones (Yamauchi, 1997), in clusters.

use super::costmap::{Costmap, Kind};
use nalgebra::Vector2;
use std::collections::VecDeque;

/// Free cells beside unknown ones, connected.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Frontier {
    /// The cells, in the order in which they were found.
    pub(crate) cells: Vec<usize>,
    /// The cell nearest to their mean.
    pub(crate) middle: usize,
}

/// All frontiers of at least `least` cells. A longer one than `most` is several.
pub(crate) fn frontiers(map: &Costmap, least: usize, most: usize) -> Vec<Frontier> {
    let is_frontier =
        |cell: usize| map.kind(cell) == Kind::Free && map.sides(cell).any(|side| map.kind(side) == Kind::Unknown);
    let mut is_waiting: Vec<bool> = (0..map.len()).map(is_frontier).collect();
    let mut found = Vec::new();
    for first in 0..map.len() {
        let cells = cluster(map, first, most, &mut is_waiting);
        if cells.len() >= least.max(1) {
            found.push(Frontier { middle: middle(map, &cells).unwrap_or(first), cells });
        }
    }
    found
}

/// The cells around `first` that are still waiting.
fn cluster(map: &Costmap, first: usize, most: usize, is_waiting: &mut [bool]) -> Vec<usize> {
    let mut take = |cell: usize| is_waiting.get_mut(cell).is_some_and(std::mem::take);
    let mut open = VecDeque::new();
    if take(first) {
        open.push_back(first);
    }
    let mut cells: Vec<usize> = open.iter().copied().collect();
    while let Some(cell) = open.pop_front() {
        for (next, _) in map.around(cell) {
            if cells.len() < most && take(next) {
                cells.push(next);
                open.push_back(next);
            }
        }
    }
    cells
}

fn middle(map: &Costmap, cells: &[usize]) -> Option<usize> {
    let sum = cells.iter().fold(Vector2::zeros(), |sum, &cell| sum + map.centre(cell).coords);
    let mean = sum / cells.len().max(1) as f64;
    let off = |cell: usize| (map.centre(cell).coords - mean).norm_squared();
    cells.iter().copied().min_by(|&a, &b| off(a).total_cmp(&off(b)))
}
