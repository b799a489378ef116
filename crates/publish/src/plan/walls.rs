//! Occupied cells → straight walls along both axes, and the bridges over the gaps between them.

use super::{Wall, is_occupied, middle_of, whole};
use slamd_core::Raster;

/// Column and row of a raster, from the lower left.
pub(super) type Cell = (usize, usize);

/// A shorter run of occupied cells is no wall, metres.
const MIN_RUN_M: f64 = 0.3;
/// A wall is drawn as ragged cells: so much may be missing within a run, metres.
const RAGGED_M: f64 = 0.15;
/// Walls as far apart as this across their direction are one, metres.
const APART_M: f64 = 0.2;
/// A bridge this short is not shown as a gap, metres.
const MIN_GAP_M: f64 = 0.25;
/// A shorter run is the edge of a door or furniture, no wall that ends another, metres.
const MIN_CORNER_M: f64 = 0.6;
/// A wider gap that the robot passed is no door, metres. Doors of homes are 0.6 to 1.0 m wide.
const MAX_DOOR_M: f64 = 1.2;
/// A wider gap that the robot did not pass is not bridged, metres: what lies beyond may be of the same room.
const MAX_GAP_M: f64 = 1.6;

/// A run of occupied cells along one axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Line {
    is_along_x: bool,
    /// The row of a line along x, the column of one along y.
    across: usize,
    /// First and last index along the line.
    from: usize,
    to: usize,
    /// Occupied cells in its own row or column.
    weight: usize,
}

impl Line {
    fn cell(&self, along: usize) -> Cell {
        if self.is_along_x { (along, self.across) } else { (self.across, along) }
    }

    fn length(&self) -> usize {
        self.to - self.from + 1
    }

    /// Its cells.
    pub(super) fn cells(&self) -> impl Iterator<Item = Cell> + '_ {
        (self.from..=self.to).map(|along| self.cell(along))
    }

    /// What one of its ends is to be joined to: the corner with a wall across, and the next wall in the same line. Each with the distance, for a
    /// corner the longer way of both walls to it, the cell there, and the length of the other wall. Nothing if the end touches a wall across.
    fn next(&self, runs: &[Self], is_low: bool, sizes: &Sizes) -> impl Iterator<Item = (usize, Cell, usize)> + use<> {
        let beyond = |along: usize| if is_low { self.from.checked_sub(along) } else { along.checked_sub(self.to) };
        let end = if is_low { self.from } else { self.to };
        let across = || runs.iter().filter(|other| other.is_along_x != self.is_along_x);
        let touches = across().any(|other| {
            let is_near = end.abs_diff(other.across) <= sizes.apart && other.beyond(self.across) <= sizes.apart;
            is_near && other.to - other.from >= sizes.wall
        });
        let in_line = runs.iter().filter(|next| {
            next.is_along_x == self.is_along_x && next.across.abs_diff(self.across) <= sizes.apart && *next != self
        });
        let in_line = in_line.filter_map(|next| {
            let end = if is_low { next.to } else { next.from };
            Some((beyond(end)?, next.cell(end), next.length()))
        });
        let in_line = in_line.min_by_key(|(gap, ..)| *gap);
        let corners = across().filter_map(|other| {
            let near = beyond(other.across)?;
            Some((near.max(other.beyond(self.across)), near, self.cell(other.across), other.length()))
        });
        let corner = corners.min_by_key(|(distance, ..)| *distance);
        // A corner behind the next wall is that wall's.
        let corner = corner.filter(|(_, near, ..)| in_line.is_none_or(|(gap, ..)| *near < gap));
        let both = [corner.map(|(distance, _, cell, length)| (distance, cell, length)), in_line];
        both.into_iter().flatten().filter(move |_| !touches)
    }

    /// How far an index is beyond its ends.
    fn beyond(&self, along: usize) -> usize {
        self.from.saturating_sub(along).max(along.saturating_sub(self.to))
    }

    /// The same in the map frame, from the outer edges of the first and last cell.
    pub(super) fn wall(&self, raster: &Raster) -> Wall {
        let half_m = 0.5 * raster.cell_m;
        let [mut from, mut to] = [self.from, self.to].map(|along| middle_of(raster, self.cell(along)));
        if self.is_along_x {
            (from.x, to.x) = (from.x - half_m, to.x + half_m);
        } else {
            (from.y, to.y) = (from.y - half_m, to.y + half_m);
        }
        Wall { ends: [from, to], is_along_x: self.is_along_x, is_outside_at_the_lower_side: false }
    }
}

/// The walls of a raster, and what closes the gaps between them.
pub(super) struct Lines {
    runs: Vec<Line>,
    /// First and last cell of each bridge, and whether the robot has passed it.
    bridges: Vec<([Cell; 2], bool)>,
    /// The runs, extended over bridges and into the corners.
    extended: Vec<Line>,
    sizes: Sizes,
}

/// The constants above in cells.
struct Sizes {
    apart: usize,
    wall: usize,
    min_gap: usize,
    max_door: usize,
    max_gap: usize,
}

impl Sizes {
    fn new(raster: &Raster) -> Self {
        let cells = |length_m| cells(raster, length_m);
        Self {
            apart: cells(APART_M),
            wall: cells(MIN_CORNER_M),
            min_gap: cells(MIN_GAP_M),
            max_door: cells(MAX_DOOR_M),
            max_gap: cells(MAX_GAP_M),
        }
    }
}

impl Lines {
    /// The lines of a raster; `visited` are the cells of the robot's path.
    pub(super) fn new(raster: &Raster, visited: &[Cell]) -> Self {
        let mut runs = runs(raster, true);
        runs.extend(self::runs(raster, false));
        let sizes = Sizes::new(raster);
        let mut is_visited = vec![false; raster.occupancy.len()];
        visited.iter().for_each(|(x, y)| is_visited[y * raster.width + x] = true);
        let is_passed = |ends: [Cell; 2]| between(ends).any(|(x, y)| is_visited[y * raster.width + x]);
        let mut extended = runs.clone();
        let mut bridges = Vec::new();
        for (run, line) in runs.iter().zip(&mut extended) {
            for is_low in [true, false] {
                let start = run.cell(if is_low { run.from } else { run.to });
                let mut nearest: Option<usize> = None;
                for (distance, end, length) in run.next(&runs, is_low, &sizes) {
                    let is_passed = is_passed([start, end]);
                    // Furniture is no wall with a gap that is much wider than itself.
                    let are_walls = 2 * length.min(run.length()) >= distance;
                    if distance > if is_passed || !are_walls { sizes.max_door } else { sizes.max_gap } {
                        continue;
                    }
                    // Beyond a nearer corner only a door leads on.
                    if nearest.is_some_and(|nearest| nearest < distance) && !is_passed {
                        continue;
                    }
                    nearest = Some(distance);
                    if start != end {
                        bridges.push(([start, end], is_passed));
                    }
                    let along = if run.is_along_x { end.0 } else { end.1 };
                    (line.from, line.to) = (line.from.min(along), line.to.max(along));
                }
            }
        }
        Self { runs, bridges, extended, sizes }
    }

    /// The cells that nothing passes: walls and bridges.
    pub(super) fn barrier(&self) -> impl Iterator<Item = Cell> + '_ {
        let bridges = self.bridges.iter().flat_map(|(ends, _)| between(*ends));
        self.runs.iter().flat_map(Line::cells).chain(bridges)
    }

    /// The walls whose occupied part is `wanted`, joined where they lie in one line.
    pub(super) fn walls(&self, wanted: impl Fn(&Line) -> bool) -> Vec<Line> {
        let wanted = self.runs.iter().zip(&self.extended).filter(|(run, _)| wanted(run));
        // Of a wall most was seen.
        let line = |(run, line): (&Line, &Line)| if line.length() > 2 * run.length() { *run } else { *line };
        let lines = wanted.map(line).collect();
        join(lines, self.sizes.apart, self.sizes.max_door)
    }

    /// First and last cell of each gap that the robot has not passed.
    pub(super) fn gaps(&self) -> impl Iterator<Item = [Cell; 2]> + '_ {
        let is_long = |[from, to]: &[Cell; 2]| from.0.abs_diff(to.0).max(from.1.abs_diff(to.1)) >= self.sizes.min_gap;
        let mut gaps: Vec<[Cell; 2]> = self
            .bridges
            .iter()
            .filter(|(ends, is_passed)| !is_passed && is_long(ends))
            .map(|([from, to], _)| [*from.min(to), *from.max(to)])
            .collect();
        // Most gaps are bridged from both sides.
        gaps.sort_unstable();
        gaps.dedup();
        gaps.into_iter()
    }
}

/// The runs along one axis, each of them the best of those beside it.
fn runs(raster: &Raster, is_along_x: bool) -> Vec<Line> {
    let (along, across) = if is_along_x { (raster.width, raster.height) } else { (raster.height, raster.width) };
    let (min_run, ragged, apart) = (cells(raster, MIN_RUN_M), cells(raster, RAGGED_M), cells(raster, APART_M));
    let occupied =
        |along: usize, across: usize| is_occupied(raster, if is_along_x { (along, across) } else { (across, along) });
    let mut found = Vec::new();
    for at in 0..across {
        let band = at.saturating_sub(1)..(at + 2).min(across);
        let mut run: Option<Line> = None;
        for index in 0..along {
            if !band.clone().any(|at| occupied(index, at)) {
                continue;
            }
            let weight = usize::from(occupied(index, at));
            match &mut run {
                Some(run) if index - run.to <= ragged + 1 => {
                    run.to = index;
                    run.weight += weight;
                }
                _ => {
                    found.extend(run.take());
                    run = Some(Line { is_along_x, across: at, from: index, to: index, weight });
                }
            }
        }
        found.extend(run);
    }
    // Half of a wall may lie in the rows beside it, never most of it.
    found.retain(|run| run.to - run.from + 1 >= min_run && 3 * run.weight > run.to - run.from);
    found.sort_by_key(|run| (std::cmp::Reverse(run.weight), run.across, run.from));
    let mut kept: Vec<Line> = Vec::new();
    for run in found {
        let is_beside = |other: &Line| {
            let common = (other.to.min(run.to) + 1).saturating_sub(other.from.max(run.from));
            other.across.abs_diff(run.across) <= apart && 2 * common > run.to - run.from
        };
        if !kept.iter().any(is_beside) {
            kept.push(run);
        }
    }
    kept
}

/// Joins lines that overlap or that a bridge connects.
fn join(mut lines: Vec<Line>, apart: usize, max_gap: usize) -> Vec<Line> {
    lines.sort_by_key(|line| (line.is_along_x, line.from, line.to));
    let mut joined: Vec<Line> = Vec::new();
    for line in lines {
        let same = joined.iter_mut().find(|other| {
            other.is_along_x == line.is_along_x
                && other.across.abs_diff(line.across) <= apart
                && line.from <= other.to + max_gap
        });
        match same {
            Some(other) => {
                other.to = other.to.max(line.to);
                if line.weight > other.weight {
                    (other.across, other.weight) = (line.across, line.weight);
                }
            }
            None => joined.push(line),
        }
    }
    joined
}

/// The cells of a straight line, each a neighbour of the next.
pub(super) fn between([from, to]: [Cell; 2]) -> impl Iterator<Item = Cell> {
    let steps = from.0.abs_diff(to.0).max(from.1.abs_diff(to.1));
    let at = move |from: usize, to: usize, step: usize| {
        let moved = (from.abs_diff(to) * step + steps / 2) / steps.max(1);
        if to >= from { from + moved } else { from - moved }
    };
    (0..=steps).map(move |step| (at(from.0, to.0, step), at(from.1, to.1, step)))
}

/// How many cells a length is.
fn cells(raster: &Raster, length_m: f64) -> usize {
    whole((length_m / raster.cell_m).round())
}
