//! Routes through the true world: Dijkstra's algorithm on a coarse grid.

use super::world::World;
use slamd_core::Point;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Side of a cell, metres.
pub const CELL_M: f64 = 0.1;
/// Minimum distance of a route from a surface, metres.
pub const MIN_CLEARANCE_M: f64 = 0.25;
/// Nearer to a surface than this, a step costs more, metres.
const COMFORT_M: f64 = 0.45;
/// The cost of a cell that cannot be reached.
const FAR: u32 = u32::MAX;

/// The clearance of each cell of a world, row by row from the lower left.
#[derive(Clone, Debug)]
pub struct RouteGrid {
    origin: Point,
    width: usize,
    height: usize,
    clearance_m: Vec<f64>,
}

/// The cheapest routes from one cell to all others.
#[derive(Clone, Debug)]
pub struct Routes {
    cost: Vec<u32>,
    previous: Vec<usize>,
}

impl RouteGrid {
    /// Computes the clearance of every cell of `world` from what does not move.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "worlds reach at most 100 m")]
    pub fn new(world: &World) -> Self {
        let (origin, end) = world.bounds();
        let cells = |from: f64, to: f64| ((to - from) / CELL_M).ceil().max(1.0) as usize;
        let (width, height) = (cells(origin.x, end.x), cells(origin.y, end.y));
        let mut grid = Self { origin, width, height, clearance_m: Vec::new() };
        grid.clearance_m = (0..width * height).map(|cell| world.fixed_clearance(grid.middle(cell))).collect();
        grid
    }

    /// The number of cells.
    #[must_use]
    pub fn len(&self) -> usize {
        self.clearance_m.len()
    }

    /// Never true: a grid has at least one cell.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.clearance_m.is_empty()
    }

    /// The centre of a cell.
    #[must_use]
    pub fn middle(&self, cell: usize) -> Point {
        let (column, row) = (cell % self.width, cell / self.width);
        Point::new(self.origin.x + (column as f64 + 0.5) * CELL_M, self.origin.y + (row as f64 + 0.5) * CELL_M)
    }

    /// The cell that holds `point`, or the nearest one.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the grid")]
    pub fn cell(&self, point: Point) -> usize {
        let index = |offset: f64, count: usize| (offset / CELL_M).clamp(0.0, (count - 1) as f64) as usize;
        index(point.y - self.origin.y, self.height) * self.width + index(point.x - self.origin.x, self.width)
    }

    /// The same grid with the door leaves and people of `world` where they are now.
    #[must_use]
    pub fn with_moving(&self, world: &World) -> Self {
        let mut grid = self.clone();
        for (cell, clearance_m) in grid.clearance_m.iter_mut().enumerate() {
            *clearance_m = clearance_m.min(world.moving_clearance(self.middle(cell)));
        }
        grid
    }

    /// The routes from `start`, which counts as free.
    #[must_use]
    pub fn routes(&self, start: Point) -> Routes {
        let start = self.cell(start);
        let mut routes = Routes { cost: vec![FAR; self.len()], previous: vec![start; self.len()] };
        let mut open = BinaryHeap::from([Reverse((0_u32, start))]);
        routes.cost[start] = 0;
        while let Some(Reverse((cost, cell))) = open.pop() {
            if cost > routes.cost[cell] {
                continue;
            }
            for (next, step) in self.neighbours(cell) {
                let next_cost = cost + step * self.cost_factor(next);
                if next_cost < routes.cost[next] {
                    routes.cost[next] = next_cost;
                    routes.previous[next] = cell;
                    open.push(Reverse((next_cost, next)));
                }
            }
        }
        routes
    }

    /// The free neighbours of a cell and the length of the step to each, in hundredths of a cell.
    fn neighbours(&self, cell: usize) -> impl Iterator<Item = (usize, u32)> {
        const STEPS: [(isize, isize, u32); 8] = [
            (1, 0, 100),
            (0, 1, 100),
            (-1, 0, 100),
            (0, -1, 100),
            (1, 1, 141),
            (-1, 1, 141),
            (-1, -1, 141),
            (1, -1, 141),
        ];
        let (column, row) = (cell % self.width, cell / self.width);
        STEPS.into_iter().filter_map(move |(dx, dy, length)| {
            let column = column.checked_add_signed(dx).filter(|&column| column < self.width)?;
            let row = row.checked_add_signed(dy).filter(|&row| row < self.height)?;
            let next = row * self.width + column;
            (self.clearance_m[next] >= MIN_CLEARANCE_M).then_some((next, length))
        })
    }

    /// The factor on the cost of a step to a cell: larger near surfaces.
    fn cost_factor(&self, cell: usize) -> u32 {
        let clearance_m = self.clearance_m[cell];
        if clearance_m < 0.5 * (MIN_CLEARANCE_M + COMFORT_M) {
            4
        } else if clearance_m < COMFORT_M {
            2
        } else {
            1
        }
    }
}

impl Routes {
    /// The cost of the route to a cell, if there is one: its length in millimetres, counted more near
    /// surfaces.
    #[must_use]
    pub fn cost(&self, cell: usize) -> Option<u32> {
        self.cost.get(cell).copied().filter(|&cost| cost != FAR)
    }

    /// The cells on the route to `goal`, without the start; empty if there is no route.
    #[must_use]
    pub fn route(&self, goal: usize) -> Vec<usize> {
        let mut route = Vec::new();
        let mut cell = goal;
        while self.cost(cell).is_some_and(|cost| cost > 0) {
            route.push(cell);
            cell = self.previous[cell];
        }
        route.reverse();
        route
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_room_of_the_built_in_worlds_can_be_reached() {
        for (name, rooms) in [
            ("flat", &[(2.0, 2.0), (6.0, 2.0), (9.0, 2.0), (9.0, 5.0), (2.0, 6.5), (5.0, 7.0), (9.0, 7.0)][..]),
            ("office", &[(2.0, 2.0), (12.0, 2.0), (28.0, 2.0), (2.0, 18.0), (28.0, 18.0), (2.0, 12.0), (10.0, 9.0)]),
            ("furnished", &[(0.6, 3.0), (7.0, 3.0), (2.7, 5.5), (5.6, 5.5)]),
        ] {
            let world = World::named(name).unwrap();
            let grid = RouteGrid::new(&world);
            let routes = grid.routes(world.start);
            for &(x, y) in rooms {
                assert!(!routes.route(grid.cell(Point::new(x, y))).is_empty(), "{name}: no route to {x}, {y}");
            }
        }
    }

    #[test]
    fn routes_keep_their_clearance_and_have_no_gaps() {
        let world = World::named("furnished").unwrap();
        let grid = RouteGrid::new(&world);
        let route = grid.routes(world.start).route(grid.cell(Point::new(7.0, 3.0)));
        let points: Vec<Point> = route.iter().map(|&cell| grid.middle(cell)).collect();
        assert!(points.iter().all(|&point| world.clearance(point) >= MIN_CLEARANCE_M));
        assert!(points.windows(2).all(|pair| (pair[1] - pair[0]).norm() < 1.5 * CELL_M));
    }
}
