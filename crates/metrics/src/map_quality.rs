//! Quality of a map against the true walls.
//!
//! - **Precision**: the share of occupied cells (65 % and more, as in `map_server`) whose centre is within 5 cm of
//!   a true wall.
//! - **Coverage**: the share of visible wall samples that have the centre of an occupied cell within
//!   5 cm. The true walls are sampled every 2 cm; a sample is visible if it is, from any pose of the true
//!   path, in line of sight, within range and at most 45 degrees off the wall's normal.
//!
//! Map and truth are aligned at the first pose only, as trajectories are (see [`AccuracyMeter`](super::AccuracyMeter)): a map that is
//! correct in itself but turned against the start counts as wrong.

use serde::Serialize;
use slamd_core::{Point, Pose2, Raster};

/// A straight wall from end to end, metres in the world frame.
pub type Wall = [Point; 2];

/// Minimum occupancy of an occupied cell, percent.
const OCCUPIED_PERCENT: i8 = 65;
/// Maximum distance between a cell and the wall that it shows, metres.
const TOLERANCE_M: f64 = 0.05;
/// Distance between samples of a wall, metres.
const SAMPLE_M: f64 = 0.02;
/// Cosine of the maximum incidence at which a wall counts as visible: 45 degrees.
const COS_MAX_INCIDENCE: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// Distance along the true path between two visibility tests, metres.
const VISIBILITY_STEP_M: f64 = 0.05;

/// The quality of one map.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MapQuality {
    /// Share of the occupied cells within 5 cm of a true wall; `None` if no cell is occupied.
    pub precision: Option<f64>,
    /// Share of the visible walls with an occupied cell within 5 cm; `None` if no wall was visible.
    pub coverage: Option<f64>,
    /// Number of occupied cells.
    pub occupied_cells: usize,
    /// Length of the walls that the robot could see, metres.
    pub visible_m: f64,
}

/// Collects the walls visible from the true path, then scores maps.
#[derive(Clone, Debug)]
pub struct MapMeter {
    walls: Vec<Wall>,
    max_range_m: f64,
    samples: Vec<Sample>,
    tested_at: Option<Point>,
}

#[derive(Clone, Copy, Debug)]
struct Sample {
    point: Point,
    wall: usize,
    is_visible: bool,
}

impl MapMeter {
    /// A meter for a world of `walls` and sensors that reach `max_range_m`.
    #[must_use]
    pub fn new(walls: Vec<Wall>, max_range_m: f64) -> Self {
        let samples = walls.iter().enumerate().flat_map(|(wall, ends)| sampled(wall, *ends)).collect();
        Self { walls, max_range_m, samples, tested_at: None }
    }

    /// Adds a true pose, `world_from_robot`.
    pub fn truth(&mut self, pose: Pose2) {
        let position = pose.position();
        if self.tested_at.is_some_and(|last| (last - position).norm() < VISIBILITY_STEP_M) {
            return;
        }
        self.tested_at = Some(position);
        let near: Vec<Wall> =
            self.walls.iter().filter(|wall| distance_m(**wall, position) <= self.max_range_m).copied().collect();
        for sample in self.samples.iter_mut().filter(|sample| !sample.is_visible) {
            sample.is_visible = is_visible(position, sample.point, self.walls[sample.wall], self.max_range_m, &near);
        }
    }

    /// Scores a map whose frame is `world_from_map`, the alignment at the first pose.
    #[must_use]
    pub fn score(&self, raster: &Raster, world_from_map: Pose2) -> MapQuality {
        let is_wall = |point: Point| self.walls.iter().any(|wall| distance_m(*wall, point) <= TOLERANCE_M);
        let occupied = (0..raster.occupancy.len()).filter(|&cell| raster.occupancy[cell] >= OCCUPIED_PERCENT);
        let (mut cells, mut right) = (0usize, 0usize);
        for cell in occupied {
            let middle = middle(raster, cell % raster.width, cell / raster.width);
            cells += 1;
            right += usize::from(is_wall(world_from_map.transform(middle)));
        }
        let map_from_world = world_from_map.inverse();
        let visible = self.samples.iter().filter(|sample| sample.is_visible);
        let (mut seen, mut covered) = (0usize, 0usize);
        for sample in visible {
            seen += 1;
            covered += usize::from(is_covered(raster, map_from_world.transform(sample.point)));
        }
        let share = |part: usize, of: usize| (of > 0).then(|| part as f64 / of as f64);
        MapQuality {
            precision: share(right, cells),
            coverage: share(covered, seen),
            occupied_cells: cells,
            visible_m: SAMPLE_M * seen as f64,
        }
    }
}

/// Samples of a wall, 2 cm apart, the outermost half a step from its ends.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a wall of a kilometre has 50,000")]
fn sampled(wall: usize, [from, to]: Wall) -> impl Iterator<Item = Sample> {
    let count = ((to - from).norm() / SAMPLE_M).round().max(1.0) as usize;
    let point = move |index: usize| from + (to - from) * ((index as f64 + 0.5) / count as f64);
    (0..count).map(move |index| Sample { point: point(index), wall, is_visible: false })
}

/// True if `point` of a wall is visible from `position`: within range, within the maximum incidence,
/// and not hidden by one of the walls `near`.
fn is_visible(position: Point, point: Point, [from, to]: Wall, max_range_m: f64, near: &[Wall]) -> bool {
    let sight = point - position;
    let range_m = sight.norm();
    if range_m > max_range_m || range_m < 1e-9 {
        return false;
    }
    let along = (to - from).normalize();
    if along.perp(&sight).abs() < COS_MAX_INCIDENCE * range_m {
        return false;
    }
    near.iter().all(|[from, to]| {
        let along = to - from;
        let across = sight.perp(&along);
        let share_of_sight = (from - position).perp(&along) / across;
        let share_of_wall = (from - position).perp(&sight) / across;
        // Parallel walls divide by zero; the comparisons are then false, and nothing is hidden.
        !((1e-9..1.0 - 1e-6).contains(&share_of_sight) && (0.0..=1.0).contains(&share_of_wall))
    })
}

/// True if the centre of an occupied cell is near `point`, map frame.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the raster")]
fn is_covered(raster: &Raster, point: Point) -> bool {
    let span = |coordinate_m: f64, cells: usize| {
        let index = |m: f64| libm::floor(m / raster.cell_m).clamp(0.0, cells as f64) as usize;
        index(coordinate_m - TOLERANCE_M)..(index(coordinate_m + TOLERANCE_M) + 1).min(cells)
    };
    let (columns, rows) =
        (span(point.x - raster.origin.x, raster.width), span(point.y - raster.origin.y, raster.height));
    rows.into_iter().any(|row| {
        columns.clone().any(|column| {
            raster.occupancy[row * raster.width + column] >= OCCUPIED_PERCENT
                && (middle(raster, column, row) - point).norm() <= TOLERANCE_M
        })
    })
}

fn middle(raster: &Raster, column: usize, row: usize) -> Point {
    raster.origin + nalgebra::Vector2::new(column as f64 + 0.5, row as f64 + 0.5) * raster.cell_m
}

/// Metres from `point` to the nearest point of a wall.
fn distance_m([from, to]: Wall, point: Point) -> f64 {
    let along = to - from;
    let share = (point - from).dot(&along) / along.norm_squared();
    (from + along * share.clamp(0.0, 1.0) - point).norm()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wall(x0: f64, y0: f64, x1: f64, y1: f64) -> Wall {
        [Point::new(x0, y0), Point::new(x1, y1)]
    }

    /// A raster of 5 cm cells from (0, -1) to (3, 1). Cells whose centre `is_occupied` are occupied.
    fn raster(is_occupied: impl Fn(Point) -> bool) -> Raster {
        let mut raster =
            Raster { width: 60, height: 40, cell_m: 0.05, origin: Point::new(0.0, -1.0), occupancy: vec![0; 60 * 40] };
        for cell in 0..raster.occupancy.len() {
            raster.occupancy[cell] = if is_occupied(middle(&raster, cell % 60, cell / 60)) { 90 } else { 10 };
        }
        raster
    }

    #[test]
    fn a_perfect_map_is_perfect_in_any_frame() {
        let world_from_map = Pose2::new(4.0, 2.0, 0.7);
        let corner = |x: f64, y: f64| world_from_map.transform(Point::new(x, y));
        let mut meter = MapMeter::new(vec![[corner(2.0, -0.5), corner(2.0, 0.5)]], 3.0);
        meter.truth(world_from_map);
        let map = raster(|cell| (cell.x - 2.0).abs() < 0.026 && cell.y.abs() < 0.5);
        let quality = meter.score(&map, world_from_map);
        assert_eq!((quality.precision, quality.coverage), (Some(1.0), Some(1.0)));
        assert!((quality.visible_m - 1.0).abs() < 1e-9 && quality.occupied_cells == 40, "{quality:?}");
        // The same map turned by 10 degrees: its ends are 9 cm off.
        let turned = meter.score(&map, world_from_map * Pose2::new(0.0, 0.35, -10f64.to_radians()));
        assert!(turned.precision.unwrap() < 0.6 && turned.coverage.unwrap() < 0.8, "{turned:?}");
    }

    #[test]
    fn a_missing_part_costs_coverage_and_a_ghost_costs_precision() {
        let mut meter = MapMeter::new(vec![wall(2.0, -0.5, 2.0, 0.5)], 3.0);
        meter.truth(Pose2::default());
        let half = meter.score(&raster(|c| (c.x - 2.0).abs() < 0.026 && c.y > 0.0 && c.y < 0.5), Pose2::default());
        assert_eq!(half.precision, Some(1.0));
        assert!((half.coverage.unwrap() - 0.5).abs() < 0.05, "{half:?}");
        let ghost = meter.score(
            &raster(|c| ((c.x - 2.0).abs() < 0.026 || (c.x - 1.525).abs() < 0.01) && c.y.abs() < 0.5),
            Pose2::default(),
        );
        assert_eq!((ghost.precision, ghost.coverage), (Some(2.0 / 3.0), Some(1.0)));
    }

    #[test]
    fn only_visible_walls_count_for_coverage() {
        let front = wall(1.0, -0.2, 1.0, 0.2);
        let hidden = wall(2.0, -0.2, 2.0, 0.2);
        let far = wall(3.1, 1.0, 3.1, 2.0);
        let oblique = wall(2.0, 1.0, 2.5, 1.0);
        let mut meter = MapMeter::new(vec![front, hidden, far, oblique], 3.0);
        meter.truth(Pose2::default());
        assert!((meter.score(&raster(|_| false), Pose2::default()).visible_m - 0.4).abs() < 1e-9);
        meter.truth(Pose2::new(2.25, 0.0, 0.0));
        let moved = meter.score(&raster(|_| false), Pose2::default());
        assert!((moved.visible_m - 0.4 - 0.4 - 0.5).abs() < 1e-9, "{moved:?}");
        assert_eq!((moved.precision, moved.coverage), (None, Some(0.0)));
    }

    #[test]
    fn an_empty_map_and_a_world_without_walls_have_no_score() {
        let quality = MapMeter::new(Vec::new(), 3.0).score(&Raster::default(), Pose2::default());
        assert_eq!((quality.precision, quality.coverage), (None, None));
    }
}
