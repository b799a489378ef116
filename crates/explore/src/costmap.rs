//! The costmap: where the robot's middle may be, and what a way there costs.

use super::params::Params;
use slamd_core::{Point, Raster};

/// What the map tells of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Nothing, or as good as nothing.
    Unknown,
    /// Free floor.
    Free,
    /// Perhaps occupied: not entered, and no frontier.
    Contested,
    /// Something stands there.
    Occupied,
}

/// The cells of a map, each with its distance from the nearest occupied one.
#[derive(Clone, Debug)]
pub(crate) struct Costmap {
    width: usize,
    height: usize,
    cell_m: f64,
    origin: Point,
    kinds: Vec<Kind>,
    /// Metres from the cell's centre to the nearest occupied cell, at most the comfortable clearance.
    clearance_m: Vec<f64>,
    /// The robot's middle has been there, and nothing stood in the way there lately: what the map tells of it may be a door that was closed
    /// or a person.
    is_trail: Vec<bool>,
    params: Params,
}

/// Steps to the eight neighbours and their lengths, hundredths of a cell.
const STEPS: [(isize, isize, u32); 8] =
    [(1, 0, 100), (0, 1, 100), (-1, 0, 100), (0, -1, 100), (1, 1, 141), (-1, 1, 141), (-1, -1, 141), (1, -1, 141)];

impl Costmap {
    /// The costmap of a map. `blocks` are places where something stood in the way lately; `trail` is where the robot's middle has been: the
    /// floor under it is free though no beam saw it.
    pub(crate) fn new(map: &Raster, blocks: &[Point], trail: &[Point], params: &Params) -> Self {
        let kind = |&value: &i8| match value {
            Raster::UNKNOWN => Kind::Unknown,
            value if value >= params.occupied_percent => Kind::Occupied,
            value if value <= params.free_percent => Kind::Free,
            value if value < params.undecided_percent => Kind::Unknown,
            _ => Kind::Contested,
        };
        let mut costmap = Self {
            width: map.width,
            height: map.height,
            cell_m: map.cell_m,
            origin: map.origin,
            kinds: map.occupancy.iter().map(kind).collect(),
            clearance_m: Vec::new(),
            is_trail: vec![false; map.width * map.height],
            params: *params,
        };
        costmap.kinds.resize(map.width * map.height, Kind::Unknown);
        for &point in trail {
            costmap.for_disc(point, params.body_radius_m, |kind| {
                if *kind == Kind::Unknown {
                    *kind = Kind::Free;
                }
            });
        }
        for &point in blocks {
            costmap.for_disc(point, params.block_radius_m, |kind| *kind = Kind::Occupied);
        }
        for (points, radius_m, is_trail) in [(trail, params.trail_m, true), (blocks, params.body_radius_m, false)] {
            for cell in points.iter().flat_map(|&point| costmap.disc(point, radius_m)).collect::<Vec<usize>>() {
                if let Some(mark) = costmap.is_trail.get_mut(cell) {
                    *mark = is_trail;
                }
            }
        }
        costmap.measure_clearances();
        costmap
    }

    fn for_disc(&mut self, middle: Point, radius_m: f64, mut change: impl FnMut(&mut Kind)) {
        for cell in self.disc(middle, radius_m) {
            if let Some(kind) = self.kinds.get_mut(cell) {
                change(kind);
            }
        }
    }

    /// The cells whose centre is within `radius_m` of a point.
    pub(crate) fn disc(&self, middle: Point, radius_m: f64) -> Vec<usize> {
        let reach = whole(libm::ceil(radius_m / self.cell_m)).max(1);
        let (column, row) = self.column_row(middle);
        let rows = (row - reach).max(0)..=(row + reach).min(signed(self.height) - 1);
        let mut cells = Vec::new();
        for row in rows {
            for column in (column - reach).max(0)..=(column + reach).min(signed(self.width) - 1) {
                let cell = row.unsigned_abs() * self.width + column.unsigned_abs();
                if (self.centre(cell) - middle).norm() <= radius_m {
                    cells.push(cell);
                }
            }
        }
        cells
    }

    fn measure_clearances(&mut self) {
        let comfort_m = self.params.comfort_m;
        let reach = whole(libm::ceil(comfort_m / self.cell_m));
        let mut ring: Vec<(isize, isize, f64)> = Vec::new();
        for dy in -reach..=reach {
            for dx in -reach..=reach {
                // From the centre to the nearest edge of the occupied cell, about.
                let distance_m = (libm::hypot(dx as f64, dy as f64) - 0.5).max(0.0) * self.cell_m;
                if distance_m < comfort_m {
                    ring.push((dx, dy, distance_m));
                }
            }
        }
        self.clearance_m = vec![comfort_m; self.kinds.len()];
        let surfaces: Vec<usize> = (0..self.kinds.len()).filter(|&cell| self.is_surface(cell)).collect();
        for cell in surfaces {
            for &(dx, dy, distance_m) in &ring {
                if let Some(clearance_m) = self.shifted(cell, dx, dy).and_then(|at| self.clearance_m.get_mut(at)) {
                    *clearance_m = clearance_m.min(distance_m);
                }
            }
        }
    }

    /// Occupied, and not inside of what is occupied.
    fn is_surface(&self, cell: usize) -> bool {
        let is_occupied = |cell: usize| self.kind(cell) == Kind::Occupied;
        is_occupied(cell) && !self.sides(cell).all(is_occupied)
    }

    /// The number of cells.
    pub(crate) fn len(&self) -> usize {
        self.kinds.len()
    }

    /// Side of a cell, metres.
    pub(crate) fn cell_m(&self) -> f64 {
        self.cell_m
    }

    /// What is known of a cell; nothing of one outside.
    pub(crate) fn kind(&self, cell: usize) -> Kind {
        self.kinds.get(cell).copied().unwrap_or(Kind::Unknown)
    }

    /// Metres from the cell's centre to the nearest occupied cell, at most the comfortable clearance.
    pub(crate) fn clearance(&self, cell: usize) -> f64 {
        self.clearance_m.get(cell).copied().unwrap_or(0.0)
    }

    /// A way may lead there: the robot's middle may be there, or has been.
    pub(crate) fn is_passable(&self, cell: usize) -> bool {
        self.is_open(cell) || self.is_trail.get(cell).copied().unwrap_or(false)
    }

    /// The robot's middle may be there.
    pub(crate) fn is_open(&self, cell: usize) -> bool {
        self.kind(cell) == Kind::Free && self.clearance(cell) >= self.params.body_radius_m + self.params.margin_m
    }

    /// The centre of a cell.
    pub(crate) fn centre(&self, cell: usize) -> Point {
        let (column, row) = (cell % self.width.max(1), cell / self.width.max(1));
        let middle = |index: usize| (index as f64 + 0.5) * self.cell_m;
        Point::new(self.origin.x + middle(column), self.origin.y + middle(row))
    }

    /// The cell that holds a point; none outside of the map.
    pub(crate) fn cell(&self, point: Point) -> Option<usize> {
        let (column, row) = self.column_row(point);
        self.index(column, row)
    }

    fn column_row(&self, point: Point) -> (isize, isize) {
        let offset = (point - self.origin) / self.cell_m;
        (whole(libm::floor(offset.x)), whole(libm::floor(offset.y)))
    }

    fn index(&self, column: isize, row: isize) -> Option<usize> {
        let inside = (0..signed(self.width)).contains(&column) && (0..signed(self.height)).contains(&row);
        inside.then(|| row.unsigned_abs() * self.width + column.unsigned_abs())
    }

    fn shifted(&self, cell: usize, dx: isize, dy: isize) -> Option<usize> {
        let width = self.width.max(1);
        self.index(signed(cell % width) + dx, signed(cell / width) + dy)
    }

    /// The four cells beside a cell; fewer at the map's edge.
    pub(crate) fn sides(&self, cell: usize) -> impl Iterator<Item = usize> {
        STEPS.iter().take(4).filter_map(move |&(dx, dy, _)| self.shifted(cell, dx, dy))
    }

    /// The eight cells around a cell and the length of the step to each, hundredths of a cell.
    pub(crate) fn around(&self, cell: usize) -> impl Iterator<Item = (usize, u32)> {
        STEPS.iter().filter_map(move |&(dx, dy, length)| Some((self.shifted(cell, dx, dy)?, length)))
    }

    /// The factor on the cost of a step to a cell: it falls with the distance from what is occupied.
    pub(crate) fn factor(&self, cell: usize) -> u32 {
        let least_m = self.params.body_radius_m + self.params.margin_m;
        if !self.is_open(cell) {
            return self.params.trail_factor;
        }
        let near = (self.params.comfort_m - self.clearance(cell)) / (self.params.comfort_m - least_m);
        1 + u32::try_from(whole(self.params.nearness_cost * near.clamp(0.0, 1.0) + 0.5)).unwrap_or(0)
    }

    /// Every cell on the straight line satisfies `is_good`.
    pub(crate) fn line(&self, from: Point, to: Point, is_good: impl Fn(usize) -> bool) -> bool {
        let steps = whole(libm::ceil((to - from).norm() / (0.5 * self.cell_m))).max(1);
        (0..=steps).all(|step| {
            let point = from + (to - from) * (step as f64 / steps as f64);
            self.cell(point).is_some_and(&is_good)
        })
    }
}

/// A number of cells; what is too large for a map is far outside of it.
#[expect(clippy::cast_possible_truncation, reason = "clamped to the range of a map")]
fn whole(number: f64) -> isize {
    number.clamp(-1e9, 1e9) as isize
}

/// Maps have fewer cells than `isize::MAX`.
fn signed(count: usize) -> isize {
    isize::try_from(count).unwrap_or(isize::MAX)
}
