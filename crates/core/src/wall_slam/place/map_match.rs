//! Lays the map that was drawn since the robot was lost out on the map before: four quarter turns, all translations in cells.
//!
//! Both maps have their axes along the building's walls, so their headings differ by quarter turns. A pose's score is the length of wall
//! that both maps have in common, less what contradicts: a wall of one on free floor of the other. What one of them does not know
//! counts for nothing, so two maps that hardly overlap never fit.

use super::field::{Field, PERFECT};
use super::params::JoinParams;
use crate::geometry::{Pose2, nearest_quarter};
use std::f64::consts::FRAC_PI_2;

/// How cells of the new map become cells of the old one: quarter turns about the origin, then a shift.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::wall_slam) struct Join {
    pub(in crate::wall_slam) quarter: u8,
    pub(in crate::wall_slam) shift: [i32; 2],
}

/// How well the two maps fit there, metres of wall.
#[derive(Clone, Copy, Debug)]
struct Fit {
    join: Join,
    matched_m: f64,
    contradicted_m: f64,
}

/// What a search found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(in crate::wall_slam) struct Matched {
    /// The best join, if one fits.
    pub(in crate::wall_slam) best: Option<Join>,
    /// The joins that explain nearly as much, with the best.
    pub(in crate::wall_slam) places: usize,
    /// The best one explains so much that it needs no other evidence.
    pub(in crate::wall_slam) is_sure: bool,
}

/// A search that goes on over several sweeps.
#[derive(Clone, Debug)]
pub(in crate::wall_slam) struct MapMatch {
    cell_m: f64,
    /// Cells of the new map, in cells from the frame's origin: surfaces and sure floor.
    surfaces: Vec<[i32; 2]>,
    floor: Vec<[i32; 2]>,
    /// Cells of the map for each of them.
    per_point: [f64; 2],
    /// Those that are compared at every pose, under each quarter turn.
    coarse: [Coarse; 4],
    /// The quarter turn and shift to score next.
    next: (usize, [i32; 2]),
    best: Vec<(Join, i32)>,
    refined: Vec<Fit>,
}

/// A thinned map under one quarter turn.
#[derive(Clone, Debug)]
struct Coarse {
    surfaces: Vec<[i32; 2]>,
    floor: Vec<[i32; 2]>,
    /// The least and greatest shift at which the maps overlap.
    low: [i32; 2],
    high: [i32; 2],
}

impl Join {
    /// The cell of the old map on which a cell of the new one lies.
    pub(in crate::wall_slam) const fn cell(&self, cell: [i32; 2]) -> [i32; 2] {
        let [x, y] = turned(cell, self.quarter);
        [x.saturating_add(self.shift[0]), y.saturating_add(self.shift[1])]
    }

    /// The join of two maps in which a robot has these poses; none if their headings do not differ by quarter turns.
    #[expect(clippy::cast_possible_truncation, reason = "a map of some thousand cells, and 0 to 3")]
    pub(in crate::wall_slam) fn between(old: Pose2, new: Pose2, cell_m: f64, params: &JoinParams) -> Option<Self> {
        let (quarter, off_rad) = nearest_quarter(old.theta_rad - new.theta_rad);
        let turn = Pose2::new(0.0, 0.0, quarter as f64 * FRAC_PI_2);
        let shift = old.position() - (turn * new).position();
        let shift = [shift.x, shift.y].map(|metres| libm::round(metres / cell_m) as i32);
        (off_rad.abs() < params.max_off_rad).then_some(Self { quarter: quarter as u8, shift })
    }

    /// `old_from_new`, for cells of that size.
    pub(in crate::wall_slam) fn transform(&self, cell_m: f64) -> Pose2 {
        let [x_m, y_m] = self.shift.map(|cells| f64::from(cells) * cell_m);
        Pose2::new(x_m, y_m, f64::from(self.quarter) * FRAC_PI_2)
    }

    /// True if another join is the same place.
    pub(in crate::wall_slam) const fn is_near(&self, other: &Self, cells: i32) -> bool {
        let [dx, dy] = [self.shift[0] - other.shift[0], self.shift[1] - other.shift[1]];
        self.quarter == other.quarter && dx.abs() <= cells && dy.abs() <= cells
    }
}

/// A cell after quarter turns about the origin, which is a corner of four cells.
const fn turned([x, y]: [i32; 2], quarter: u8) -> [i32; 2] {
    match quarter {
        0 => [x, y],
        1 => [-1 - y, x],
        2 => [-1 - x, -1 - y],
        _ => [y, -1 - x],
    }
}

impl MapMatch {
    /// A search for the place of `new` in `old`; none where the new map shows too little or has other cells.
    pub(in crate::wall_slam) fn new(old: &Field, new: &Field, params: &JoinParams) -> Option<Self> {
        let (surfaces, floor) = (new.cells_marked(PERFECT), new.deep_cells());
        let cell_m = old.cell_m;
        let is_alike = (cell_m - new.cell_m).abs() < 1e-9;
        if !is_alike || (surfaces.len() as f64) * cell_m < params.min_drawn_m {
            return None;
        }
        let (all, few) = (params.points, params.coarse_points);
        let per_point =
            [(surfaces.len(), all), (floor.len(), all / 2)].map(|(cells, points)| cells.div_ceil(points).max(1) as f64);
        let surfaces = thinned(&surfaces, all);
        let floor = thinned(&floor, all / 2);
        let coarse = [0, 1, 2, 3].map(|quarter| {
            let turn = |cells: Vec<[i32; 2]>| cells.into_iter().map(|cell| turned(cell, quarter)).collect::<Vec<_>>();
            let (surfaces, floor) = (turn(thinned(&surfaces, few)), turn(thinned(&floor, few / 2)));
            let bound = |axis: usize, pick: fn(i32, i32) -> i32, from: i32| {
                surfaces.iter().map(|cell| cell[axis]).fold(from, pick)
            };
            let [low, high] = old.bounds();
            Coarse {
                low: [0, 1].map(|axis| low[axis] - bound(axis, i32::max, i32::MIN)),
                high: [0, 1].map(|axis| high[axis] - bound(axis, i32::min, i32::MAX)),
                surfaces,
                floor,
            }
        });
        let next = (0, coarse[0].low);
        Some(Self { cell_m, surfaces, floor, per_point, coarse, next, best: Vec::new(), refined: Vec::new() })
    }

    /// Searches a little farther; what was found, once that is known.
    pub(in crate::wall_slam) fn step(&mut self, old: &Field, params: &JoinParams) -> Option<Matched> {
        let mut left = params.per_sweep;
        while left > 0 {
            let (quarter, [x, y]) = self.next;
            let Some(coarse) = self.coarse.get(quarter) else { return self.refine(old, params) };
            if y > coarse.high[1] {
                self.next = (quarter + 1, self.coarse.get(quarter + 1).map_or([0; 2], |next| next.low));
                continue;
            }
            self.next.1 = if x > coarse.high[0] { [coarse.low[0], y + PITCH] } else { [x + PITCH, y] };
            #[expect(clippy::cast_possible_truncation, reason = "0 to 3")]
            let join = Join { quarter: quarter as u8, shift: [x, y] };
            let (score, compared) = coarse.score(old, join.shift);
            left = left.saturating_sub(compared);
            self.keep(join, score, params);
        }
        None
    }

    /// Keeps the best of neighbouring shifts, and the best places.
    fn keep(&mut self, join: Join, score: i32, params: &JoinParams) {
        let is_full = self.best.len() >= params.candidates;
        let worst = self.best.iter().map(|(_, score)| *score).min().filter(|_| is_full).unwrap_or(0);
        if score <= worst {
            return;
        }
        if let Some(same) = self.best.iter_mut().find(|(other, _)| other.is_near(&join, params.same_cells)) {
            if score > same.1 {
                *same = (join, score);
            }
        } else if !is_full {
            self.best.push((join, score));
        } else if let Some(worst) = self.best.iter_mut().min_by_key(|(_, score)| *score) {
            *worst = (join, score);
        }
    }

    /// Climbs from the candidates to the best shift beside each, some per sweep; decides once all are done.
    fn refine(&mut self, old: &Field, params: &JoinParams) -> Option<Matched> {
        for _ in 0..params.refined_per_sweep {
            let Some((from, _)) = self.best.pop() else { return Some(self.decide(params)) };
            let mut best = self.fit(old, from);
            for _ in 0..params.same_cells {
                let beside = |step: [i32; 2]| Join {
                    shift: [best.join.shift[0] + step[0], best.join.shift[1] + step[1]],
                    ..best.join
                };
                let steps = [[1, 0], [-1, 0], [0, 1], [0, -1]].map(|step| self.fit(old, beside(step)));
                let Some(better) = steps.into_iter().max_by(|a, b| a.score_m().total_cmp(&b.score_m())) else { break };
                if better.score_m() <= best.score_m() {
                    break;
                }
                best = better;
            }
            match self.refined.iter_mut().find(|other| other.join.is_near(&best.join, params.same_cells)) {
                Some(same) if same.score_m() < best.score_m() => *same = best,
                Some(_) => {}
                None => self.refined.push(best),
            }
        }
        None
    }

    /// How well the maps fit at a join.
    fn fit(&self, old: &Field, join: Join) -> Fit {
        let (mut matched, mut contradicted) = (0.0, 0.0);
        for cell in &self.surfaces {
            let cell = join.cell(*cell);
            match old.mark_of(cell) {
                PERFECT.. => matched += self.per_point[0],
                7 => matched += 0.9 * self.per_point[0],
                3..7 => matched += 0.5 * self.per_point[0],
                ..0 if old.is_deep(cell) => contradicted += self.per_point[0],
                _ => {}
            }
        }
        let through = self.floor.iter().filter(|cell| old.mark_of(join.cell(**cell)) == PERFECT).count();
        contradicted += through as f64 * self.per_point[1];
        Fit { join, matched_m: matched * self.cell_m, contradicted_m: contradicted * self.cell_m }
    }

    fn decide(&self, params: &JoinParams) -> Matched {
        let fits = |fit: &&Fit| fit.is_good(params);
        let by_score = |a: &&Fit, b: &&Fit| a.score_m().total_cmp(&b.score_m());
        let Some(best) = self.refined.iter().filter(fits).max_by(by_score) else { return Matched::default() };
        let places = 1 + self.rivals(best, params.min_lead_m.max(params.min_lead * best.score_m()), params);
        Matched { best: Some(best.join), places, is_sure: places == 1 && best.matched_m >= params.min_join_m }
    }

    /// How many other places explain as much, but for `lead_m`.
    fn rivals(&self, of: &Fit, lead_m: f64, params: &JoinParams) -> usize {
        let least_m = of.score_m() - lead_m;
        let is_rival = |fit: &&Fit| {
            fit.score_m() > least_m
                && fit.explained() >= params.rival_explained
                && !fit.join.is_near(&of.join, params.same_cells)
        };
        self.refined.iter().filter(is_rival).count()
    }

    /// After the last step: the join beside this one, if the maps fit there, and as at no other place.
    pub(in crate::wall_slam) fn confirm(&self, old: &Field, join: Join, params: &JoinParams) -> Option<Join> {
        let reach = params.same_join_cells;
        let beside = (-reach..=reach).flat_map(|x| (-reach..=reach).map(move |y| [x, y]));
        let fits = beside.map(|[x, y]| {
            self.fit(old, Join { shift: [join.shift[0].saturating_add(x), join.shift[1].saturating_add(y)], ..join })
        });
        let best = fits.max_by(|a, b| a.score_m().total_cmp(&b.score_m()))?;
        let lead_m = params.confirm_lead * best.score_m();
        (best.explained() >= params.min_explained && self.rivals(&best, lead_m, params) == 0).then_some(best.join)
    }
}

/// Cells from one shift to the next: what is two cells off still scores.
const PITCH: i32 = 2;
/// Marks of a contradiction when poses are ranked.
const THROUGH: i32 = 6;

impl Coarse {
    /// The sum of the marks, and how many cells were compared.
    fn score(&self, old: &Field, [x, y]: [i32; 2]) -> (i32, usize) {
        let mark = |cell: &[i32; 2]| old.mark_of([cell[0] + x, cell[1] + y]);
        let surfaces: i32 = self.surfaces.iter().map(mark).sum();
        if surfaces <= 0 {
            return (0, self.surfaces.len());
        }
        let through: i32 = self.floor.iter().map(|cell| if mark(cell) == PERFECT { THROUGH } else { 0 }).sum();
        (surfaces - through, self.surfaces.len() + self.floor.len())
    }
}

impl Fit {
    fn score_m(&self) -> f64 {
        self.matched_m - self.contradicted_m
    }

    /// Enough of the maps overlaps, and hardly anything contradicts.
    fn is_good(&self, params: &JoinParams) -> bool {
        self.matched_m >= params.min_matched_m && self.explained() >= params.min_explained
    }

    fn explained(&self) -> f64 {
        self.matched_m / (self.matched_m + self.contradicted_m).max(1e-9)
    }
}

/// At most so many of the cells, evenly.
fn thinned(cells: &[[i32; 2]], points: usize) -> Vec<[i32; 2]> {
    cells.iter().copied().step_by(cells.len().div_ceil(points.max(1)).max(1)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mapping::grid::{Cell, OccupancyGrid};
    use crate::wall_slam::place::params::Params;

    /// Two rooms of 6 by 4 m side by side, the first with a pillar that breaks its symmetry, if wanted; only what `is_seen`, moved by `place`.
    fn rooms(has_pillar: bool, is_seen: impl Fn(i32, i32) -> bool, place: impl Fn([i32; 2]) -> [i32; 2]) -> Field {
        let mut grid = OccupancyGrid::new(0.05);
        for (x, y) in (0..=240).flat_map(|x| (0..=80).map(move |y| (x, y))) {
            let is_wall = x % 120 == 0 || y % 80 == 0;
            let is_pillar = has_pillar && (80..100).contains(&x) && (10..20).contains(&y);
            if is_seen(x, y) {
                let [column, row] = place([x, y]);
                grid.add(Cell { column, row }, if is_wall || is_pillar { 300 } else { -300 });
            }
        }
        Field::new(&grid, &Params::default())
    }

    fn matched(old: &Field, new: &Field) -> Matched {
        let params = JoinParams::default();
        let mut search = MapMatch::new(old, new, &params).unwrap();
        loop {
            if let Some(matched) = search.step(old, &params) {
                return matched;
            }
        }
    }

    /// The first room as a robot draws it whose frame is turned by a quarter turn.
    const TURNED: Join = Join { quarter: 1, shift: [17, -31] };

    fn seen_turned(has_pillar: bool) -> Field {
        // The inverse of the join.
        rooms(has_pillar, |x, _| x < 110, |[x, y]| turned([x - 17, y + 31], 3))
    }

    #[test]
    fn a_part_of_the_map_is_found_in_any_frame() {
        let found = matched(&rooms(true, |_, _| true, |cell| cell), &seen_turned(true));
        assert_eq!(found, Matched { best: Some(TURNED), places: 1, is_sure: true });
    }

    #[test]
    fn a_room_like_another_is_ambiguous() {
        let found = matched(&rooms(false, |_, _| true, |cell| cell), &seen_turned(false));
        assert!(found.best.is_some() && found.places >= 2 && !found.is_sure, "{found:?}");
    }

    #[test]
    fn what_was_never_mapped_fits_nowhere() {
        let old = rooms(true, |x, _| x > 130, |cell| cell);
        let found = matched(&old, &seen_turned(true));
        assert!(!found.is_sure, "{found:?}");
    }

    #[test]
    fn a_pose_in_both_maps_tells_the_join() {
        let (params, new) = (JoinParams::default(), Pose2::new(1.3, -0.4, 2.0));
        let old = TURNED.transform(0.05) * new;
        assert_eq!(Join::between(old, new, 0.05, &params), Some(TURNED));
        let askew = old * Pose2::new(0.0, 0.0, 0.5);
        assert_eq!(Join::between(askew, new, 0.05, &params), None);
    }

    #[test]
    fn an_empty_map_is_not_searched() {
        let empty = Field::new(&OccupancyGrid::new(0.05), &Params::default());
        assert!(MapMatch::new(&empty, &empty, &JoinParams::default()).is_none());
    }
}
