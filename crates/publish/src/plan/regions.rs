//! Free cells that walls and bridges enclose.

use super::walls::{Cell, Lines, between};
use super::{Room, Spot, middle_of, whole};
use crate::map_file::{FREE_PERCENT, OCCUPIED_PERCENT};
use slamd_core::Raster;
use std::collections::VecDeque;

/// From here on a cell is no floor, percent.
const FLOOR_PERCENT: i8 = 50;
/// Walls and furniture within this distance of a room's floor belong to the room, metres.
const DEPTH_M: f64 = 0.3;

/// What is so far from a gap is beside it, metres.
const BESIDE_GAP_M: f64 = 0.15;
/// Spots of a room are so far apart, metres, and are so many at most.
const SPOTS_APART_M: f64 = 0.3;
const MAX_SPOTS: usize = 100;

/// The label of cells that are in no room.
const NONE: u16 = 0;
/// The label of walls and bridges.
const BARRIER: u16 = u16::MAX;

/// Which room each cell is in.
pub(super) struct Regions<'a> {
    raster: &'a Raster,
    labels: Vec<u16>,
    /// Rooms have the labels from 1 on.
    count: u16,
}

impl<'a> Regions<'a> {
    /// The rooms of a raster: what is free around the cells that the robot has visited.
    pub(super) fn new(raster: &'a Raster, lines: &Lines, visited: &[Cell]) -> Self {
        let mut regions = Self { raster, labels: vec![NONE; raster.occupancy.len()], count: 0 };
        for (x, y) in lines.barrier() {
            regions.labels[y * raster.width + x] = BARRIER;
        }
        for cell in visited {
            if regions.count < BARRIER - 1 && regions.is_open(*cell) {
                regions.count += 1;
                regions.fill(*cell, regions.count);
            }
        }
        regions
    }

    /// True if the cell is floor that belongs to no room yet.
    fn is_open(&self, (x, y): Cell) -> bool {
        let index = y * self.raster.width + x;
        self.labels[index] == NONE && (0..FLOOR_PERCENT).contains(&self.raster.occupancy[index])
    }

    fn fill(&mut self, from: Cell, label: u16) {
        let mut waiting = vec![from];
        self.labels[from.1 * self.raster.width + from.0] = label;
        while let Some(cell) = waiting.pop() {
            for next in neighbours(self.raster, cell, false) {
                if self.is_open(next) {
                    self.labels[next.1 * self.raster.width + next.0] = label;
                    waiting.push(next);
                }
            }
        }
    }

    /// Each room with its area and its spots.
    pub(super) fn rooms(&self) -> Vec<Room> {
        let (depth, width) = (self.depth(), self.raster.width);
        let mut rooms: Vec<(usize, Vec<(u16, usize)>)> = vec![(0, Vec::new()); usize::from(self.count)];
        let apart = whole((SPOTS_APART_M / self.raster.cell_m).round()).max(1);
        for (index, label) in self.labels.iter().enumerate() {
            let Some(room) = usize::from(*label).checked_sub(1).and_then(|room| rooms.get_mut(room)) else { continue };
            room.0 += 1;
            if room.1.first().is_none_or(|(deepest, _)| depth[index] > *deepest) {
                room.1.insert(0, (depth[index], index));
            } else if (index % width) % apart == 0 && (index / width) % apart == 0 {
                room.1.push((depth[index], index));
            }
        }
        let cell_m = self.raster.cell_m;
        let spot = |(depth, index): (u16, usize)| Spot {
            at: middle_of(self.raster, (index % width, index / width)),
            radius_m: f64::from(depth) / 3.0 * cell_m,
        };
        let room = |(cells, mut spots): (usize, Vec<(u16, usize)>)| {
            spots.sort_by_key(|(depth, index)| (std::cmp::Reverse(*depth), *index));
            spots.truncate(MAX_SPOTS);
            Room { area_m2: cells as f64 * cell_m * cell_m, spots: spots.into_iter().map(spot).collect() }
        };
        rooms.into_iter().map(room).collect()
    }

    /// True if a gap has a room at one side and something else at the other, at most of its length.
    pub(super) fn are_parted_by(&self, [from, to]: &[Cell; 2]) -> bool {
        let (dx, dy) = (from.0.abs_diff(to.0), from.1.abs_diff(to.1));
        let reach = whole((BESIDE_GAP_M / self.raster.cell_m).round()).max(1);
        let label = |(x, y): Cell, is_lower: bool| {
            let beside = |at: usize| if is_lower { at.checked_sub(reach) } else { at.checked_add(reach) };
            let (x, y) = if dx >= dy { (Some(x), beside(y)) } else { (beside(x), Some(y)) };
            let cell = x.zip(y).filter(|(x, y)| *x < self.raster.width && *y < self.raster.height);
            cell.map_or(NONE, |(x, y)| self.labels[y * self.raster.width + x])
        };
        let is_room = |label: u16| label != NONE && label != BARRIER;
        let parts = |cell: &Cell| {
            let (lower, upper) = (label(*cell, true), label(*cell, false));
            (is_room(lower) || is_room(upper)) && lower != upper && lower != BARRIER && upper != BARRIER
        };
        let cells: Vec<Cell> = between([*from, *to]).collect();
        2 * cells.iter().filter(|cell| parts(cell)).count() > cells.len()
    }

    /// How far each cell of a room is from what is not of this room, in thirds of a cell: a chamfer distance with the weights 3 and 4.
    fn depth(&self) -> Vec<u16> {
        let (width, height) = (self.raster.width, self.raster.height);
        let is_room = |index: usize| self.labels[index] != NONE && self.labels[index] != BARRIER;
        let mut depth: Vec<u16> = (0..self.labels.len()).map(|i| if is_room(i) { u16::MAX } else { 0 }).collect();
        let mut pass = |order: &mut dyn Iterator<Item = usize>, sides: [(isize, isize, u16); 4]| {
            for index in order {
                let (x, y) = (index % width, index / width);
                for (dx, dy, weight) in sides {
                    let beside = x.checked_add_signed(dx).filter(|x| *x < width);
                    let cell = beside.zip(y.checked_add_signed(dy).filter(|y| *y < height));
                    let from = cell.map_or(0, |(x, y)| {
                        let beside = y * width + x;
                        if self.labels[beside] == self.labels[index] { depth[beside] } else { 0 }
                    });
                    depth[index] = depth[index].min(from.saturating_add(weight));
                }
            }
        };
        pass(&mut (0..self.labels.len()).filter(|i| is_room(*i)), [(-1, 0, 3), (0, -1, 3), (-1, -1, 4), (1, -1, 4)]);
        pass(&mut (0..self.labels.len()).rev().filter(|i| is_room(*i)), [(1, 0, 3), (0, 1, 3), (1, 1, 4), (-1, 1, 4)]);
        depth
    }

    /// Per cell: is it of a room, or of what stands in and around it?
    pub(super) fn into_inside(self) -> Vec<bool> {
        let raster = self.raster;
        let mut inside: Vec<bool> = self.labels.iter().map(|label| *label != NONE && *label != BARRIER).collect();
        let reach = whole((DEPTH_M / raster.cell_m).round());
        let mut waiting: VecDeque<(Cell, usize)> = (0..inside.len())
            .filter(|index| inside[*index])
            .map(|index| ((index % raster.width, index / raster.width), 0))
            .collect();
        while let Some((cell, steps)) = waiting.pop_front() {
            if steps == reach {
                continue;
            }
            for next in neighbours(raster, cell, true) {
                let index = next.1 * raster.width + next.0;
                let percent = raster.occupancy[index];
                // Floor beyond a bridge is not the room's; the bridge itself is.
                let is_solid = percent > FREE_PERCENT && (steps == 0 || percent >= OCCUPIED_PERCENT);
                let is_threshold = steps == 0 && percent >= 0 && self.labels[index] == BARRIER;
                if !inside[index] && (is_solid || is_threshold) {
                    inside[index] = true;
                    if is_solid {
                        waiting.push_back((next, steps + 1));
                    }
                }
            }
        }
        inside
    }
}

/// The cells beside a cell, with those over its corners if wanted.
fn neighbours(raster: &Raster, (x, y): Cell, corners: bool) -> impl Iterator<Item = Cell> {
    let (width, height) = (raster.width, raster.height);
    SIDES.iter().take(if corners { 8 } else { 4 }).filter_map(move |(dx, dy)| {
        let x = x.checked_add_signed(*dx).filter(|x| *x < width);
        x.zip(y.checked_add_signed(*dy).filter(|y| *y < height))
    })
}

const SIDES: [(isize, isize); 8] = [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)];
