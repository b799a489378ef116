//! Searches the pose of a new map in a known one: branch and bound over four headings and all translations.
//!
//! Both maps have their axes along the building's walls, so their headings differ by a multiple of 90 degrees; the
//! rest is a translation in whole cells. The fit of a pose is the sum of its points' marks (`super::known_map`) over
//! what a perfect fit would get: 1 is perfect, 0 is chance.

use super::known_map::{KnownMap, LEVELS, MARGIN, signed, surely_free};
use super::params::Params;
use crate::geometry::{Point, Pose2};
use crate::mapping::raster::Raster;
use std::collections::BinaryHeap;
use std::f64::consts::FRAC_PI_2;

/// A pose of the new map in the known one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// `known_from_new`.
    pub transform: Pose2,
    /// How well it fits: 1 is perfect, 0 is chance.
    pub fit: f64,
}

/// The best pose and the best other one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// The best.
    pub best: Place,
    /// The best that is elsewhere, where one comes within the margin asked for.
    pub rival: Option<Place>,
}

/// The new map's points under one of the headings, in cells.
struct Turned {
    points: [Vec<[i32; 2]>; 2],
}

/// One square of translations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Node {
    /// The bound of its fit; first, because the best is taken first.
    marks: i32,
    /// Finer ones first where bounds are equal: they are exact sooner.
    fineness: usize,
    quarter: u8,
    column: i32,
    row: i32,
}

/// Searches one known map.
#[derive(Clone, Debug)]
pub struct Searcher {
    params: Params,
    map: KnownMap,
    cell_m: f64,
    origin: Point,
}

impl Searcher {
    /// A searcher for a known map.
    #[must_use]
    pub fn new(known: &Raster) -> Self {
        Self::with_params(known, Params::default())
    }

    /// The same with other constants.
    #[must_use]
    pub fn with_params(known: &Raster, params: Params) -> Self {
        Self { params, map: KnownMap::new(known, &params), cell_m: known.cell_m, origin: known.origin }
    }

    /// The best pose of a new map, and a rival whose fit is less than `margin` worse; none where the new map shows fewer than
    /// `min_solid` solid cells.
    #[must_use]
    pub fn find(&self, new: &Raster, min_solid: usize, margin: f64) -> Option<Found> {
        let is_free = surely_free(new, &self.params);
        let points = [
            self.points(new, |cell| new.occupancy[cell] >= self.params.solid_percent),
            self.points(new, |cell| is_free[cell]),
        ];
        if points[0].len() < min_solid {
            return None;
        }
        let turned = [0, 1, 2, 3].map(|quarter| Turned {
            points: points.each_ref().map(|points| points.iter().map(|point| self.turned(*point, quarter)).collect()),
        });
        let best_marks = self.params.best_marks();
        let perfect: i32 = (0..2).map(|kind| best_marks[kind] * signed(points[kind].len())).sum();
        let perfect = f64::from(perfect.max(1));
        let best = self.branch_and_bound(&turned, i32::MIN, |_| true)?;
        #[expect(clippy::cast_possible_truncation, reason = "marks of a thousand points")]
        let least = best.marks - (margin * perfect) as i32;
        let rival = self.branch_and_bound(&turned, least, |node| self.is_elsewhere(node, &best));
        let solution = |node: Node| Place { transform: self.transform(&node), fit: f64::from(node.marks) / perfect };
        Some(Found { best: solution(best), rival: rival.map(solution) })
    }

    /// Middles of the cells of one kind, in metres, thinned evenly.
    fn points(&self, new: &Raster, is_kind: impl Fn(usize) -> bool) -> Vec<Point> {
        let cells: Vec<usize> = (0..new.occupancy.len()).filter(|&cell| is_kind(cell)).collect();
        let stride = cells.len().div_ceil(self.params.max_points.max(1)).max(1);
        let middle = |cell: usize| {
            let (column, row) = (cell % new.width, cell / new.width);
            new.origin + Point::new(column as f64 + 0.5, row as f64 + 0.5).coords * new.cell_m
        };
        cells.into_iter().step_by(stride).map(middle).collect()
    }

    #[expect(clippy::cast_possible_truncation, reason = "a map of some thousand cells")]
    fn turned(&self, point: Point, quarter: u8) -> [i32; 2] {
        let (x, y) = match quarter {
            0 => (point.x, point.y),
            1 => (-point.y, point.x),
            2 => (-point.x, -point.y),
            _ => (point.y, -point.x),
        };
        [x, y].map(|coordinate| libm::floor(coordinate / self.cell_m) as i32)
    }

    fn transform(&self, node: &Node) -> Pose2 {
        let metres = |cells: i32, origin: f64| origin + f64::from(cells - MARGIN) * self.cell_m;
        let heading_rad = f64::from(node.quarter) * FRAC_PI_2;
        Pose2::new(metres(node.column, self.origin.x), metres(node.row, self.origin.y), heading_rad)
    }

    fn is_elsewhere(&self, node: &Node, best: &Node) -> bool {
        // A square may reach out of the excluded region: only a square wholly in it is left out.
        let reach = 1 << (LEVELS - 1 - node.fineness);
        let near = |a: i32, b: i32| {
            let farthest = (a - b).abs().max((a + reach - 1 - b).abs());
            f64::from(farthest) * self.cell_m < self.params.same_m
        };
        node.quarter != best.quarter || !near(node.column, best.column) || !near(node.row, best.row)
    }

    /// The best single translation among those that `is_allowed`, if its marks are more than `least`.
    fn branch_and_bound(&self, turned: &[Turned; 4], least: i32, is_allowed: impl Fn(&Node) -> bool) -> Option<Node> {
        let mut open = BinaryHeap::new();
        let step = 1 << (LEVELS - 1);
        for (quarter, turned) in (0u8..).zip(turned) {
            let solid = &turned.points[0];
            let range = |axis: usize, cells: i32| {
                let (low, high) = solid.iter().fold((i32::MAX, i32::MIN), |(l, h), p| (l.min(p[axis]), h.max(p[axis])));
                (-high..cells - low).step_by(step)
            };
            for column in range(0, self.map.width) {
                for row in range(1, self.map.height) {
                    open.extend(self.judged(turned, 0, quarter, column, row, least, &is_allowed));
                }
            }
        }
        while let Some(node) = open.pop() {
            if node.fineness == LEVELS - 1 {
                return Some(node);
            }
            let half = 1 << (LEVELS - 2 - node.fineness);
            for (x, y) in [(0, 0), (half, 0), (0, half), (half, half)] {
                let (column, row) = (node.column + x, node.row + y);
                let turned = &turned[usize::from(node.quarter)];
                open.extend(self.judged(turned, node.fineness + 1, node.quarter, column, row, least, &is_allowed));
            }
        }
        None
    }

    #[expect(clippy::too_many_arguments, reason = "a node's parts and what it is judged by")]
    fn judged(
        &self,
        turned: &Turned,
        fineness: usize,
        quarter: u8,
        column: i32,
        row: i32,
        least: i32,
        is_allowed: &impl Fn(&Node) -> bool,
    ) -> Option<Node> {
        let level = LEVELS - 1 - fineness;
        let marks = (0..2)
            .flat_map(|kind| turned.points[kind].iter().map(move |point| (kind, point)))
            .map(|(kind, [x, y])| i32::from(self.map.mark(level, x + column, y + row)[kind]))
            .sum();
        let node = Node { marks, fineness, quarter, column, row };
        (marks > least && is_allowed(&node)).then_some(node)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A room of 6 by 4 m with a pillar that breaks its symmetry, if wanted.
    fn room(has_pillar: bool) -> Raster {
        let (width, height) = (140, 100);
        let mut occupancy = vec![Raster::UNKNOWN; width * height];
        for row in 10..=90 {
            for column in 10..=130 {
                let is_wall = row == 10 || row == 90 || column == 10 || column == 130;
                let is_pillar = has_pillar && (100..110).contains(&column) && (20..24).contains(&row);
                occupancy[row * width + column] = if is_wall || is_pillar { 95 } else { 5 };
            }
        }
        Raster { width, height, cell_m: 0.05, origin: Point::new(-2.0, -1.0), occupancy }
    }

    /// The room as seen in a frame turned by a quarter turn, cut to its lower part.
    fn seen(room: &Raster) -> Raster {
        let (width, height) = (60, room.width);
        let mut occupancy = vec![Raster::UNKNOWN; width * height];
        for row in 0..60 {
            for column in 0..room.width {
                // Turned counter-clockwise: x' = −y, y' = x.
                occupancy[column * width + (59 - row)] = room.occupancy[row * room.width + column];
            }
        }
        Raster { width, height, cell_m: 0.05, origin: Point::new(3.0, 7.0), occupancy }
    }

    #[test]
    fn a_part_of_the_room_is_found_in_any_frame() {
        let known = room(true);
        let found = Searcher::new(&known).find(&seen(&known), 40, 0.1).unwrap();
        assert_eq!(found.rival, None);
        assert!(found.best.fit > 0.95, "{found:?}");
        // The pillar's corner at column 100, row 20 of the known map, and at column 39, row 100 of the new one.
        let new = Point::new(3.0 + 0.05 * 39.5, 7.0 + 0.05 * 100.5);
        let expected = Point::new(-2.0 + 0.05 * 100.5, -1.0 + 0.05 * 20.5);
        assert!((found.best.transform.transform(new) - expected).norm() < 0.075, "{found:?}");
    }

    #[test]
    fn a_symmetrical_room_has_a_rival() {
        let known = room(false);
        let found = Searcher::new(&known).find(&known, 40, 0.1).unwrap();
        let rival = found.rival.unwrap();
        let turned = (found.best.transform.theta_rad - rival.transform.theta_rad).abs();
        assert!((turned - std::f64::consts::PI).abs() < 1e-9, "{found:?}");
    }

    #[test]
    fn an_empty_map_says_nothing() {
        assert_eq!(Searcher::new(&room(true)).find(&Raster::default(), 40, 0.1), None);
        assert_eq!(Searcher::new(&Raster::default()).find(&Raster::default(), 1, 0.1), None);
    }
}
