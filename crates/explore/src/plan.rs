//! Ways through the costmap, by the crate `pathfinding`.

use super::costmap::{Costmap, Kind};
use super::params::Params;
use slamd_core::Point;
use std::collections::HashMap;

/// What every cell that can be reached costs, and the way there.
#[derive(Debug)]
pub(crate) struct Reach {
    start: usize,
    /// The cell before on the cheapest way, and that way's cost, hundredths of a cell.
    parents: HashMap<usize, (usize, u32)>,
    cell_m: f64,
}

/// The cells that the robot can go to from a cell, and the cost of the step. Within `escape_m` of the start it may leave what is too near.
fn steps(map: &Costmap, start: usize, escape_m: f64) -> impl Fn(&usize) -> Vec<(usize, u32)> {
    let from = map.centre(start);
    move |&cell| {
        let may_enter = |next: usize| {
            map.is_passable(next) || map.kind(next) != Kind::Occupied && (map.centre(next) - from).norm() < escape_m
        };
        map.around(cell)
            .filter(|&(next, _)| may_enter(next))
            .map(|(next, length)| (next, length * map.factor(next)))
            .collect()
    }
}

impl Reach {
    /// What can be reached from a cell.
    pub(crate) fn new(map: &Costmap, start: usize, escape_m: f64) -> Self {
        let parents = pathfinding::directed::dijkstra::dijkstra_all(&start, steps(map, start, escape_m));
        Self { start, parents, cell_m: map.cell_m() }
    }

    /// The cost of the way to a cell, metres of comfortable way; none if there is no way.
    pub(crate) fn cost_m(&self, cell: usize) -> Option<f64> {
        if cell == self.start {
            return Some(0.0);
        }
        self.parents.get(&cell).map(|&(_, cost)| f64::from(cost) / 100.0 * self.cell_m)
    }

    /// The cell nearest to a place, at most `radius_m` away, that can be reached.
    pub(crate) fn nearest(&self, map: &Costmap, place: Point, radius_m: f64) -> Option<usize> {
        let off = |cell: &usize| (map.centre(*cell) - place).norm();
        let cells = map.disc(place, radius_m).into_iter().filter(|&cell| self.cost_m(cell).is_some());
        cells.min_by(|a, b| off(a).total_cmp(&off(b)))
    }

    /// The cell is free floor that the robot's body covers from some place that it can reach.
    pub(crate) fn is_beside(&self, map: &Costmap, cell: usize, params: &Params) -> bool {
        self.cost_m(cell).is_some() || {
            let near = map.disc(map.centre(cell), params.body_radius_m + params.margin_m);
            near.into_iter().any(|near| self.cost_m(near).is_some())
        }
    }
}

/// The cheapest way from cell to cell as points, both ends included (A*); none if there is none.
pub(crate) fn way(map: &Costmap, start: usize, goal: usize, escape_m: f64) -> Option<Vec<Point>> {
    let end = map.centre(goal);
    // Straight there, without penalties: never more than the true cost.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a distance within a map")]
    let least = |&cell: &usize| ((map.centre(cell) - end).norm() / map.cell_m() * 99.0) as u32;
    let found = pathfinding::directed::astar::astar(&start, steps(map, start, escape_m), least, |&cell| cell == goal);
    found.map(|(cells, _)| cells.into_iter().map(|cell| map.centre(cell)).collect())
}
