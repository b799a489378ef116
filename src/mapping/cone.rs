//! The inverse sensor model of a sonar: a beam → which cells became freer and which more occupied.
//!
//! Up to the range the cone is free, because the nearest surface in it is at the range. Where on the arc that surface lies is not
//! known from one return: a wall that the pose filter has recognised is marked at the point that echoed; an unexplained return is
//! spread thinly over its arc, as far as that is not behind something known, so that only returns from several places add up to
//! something. A beam that heard nothing clears a
//! part of its cone and marks nothing, which removes the arcs at full range of the paper's Fig. 1. A ray stops at an
//! occupied cell: behind a wall that mirrors the sound away nothing is known.

use super::grid::OccupancyGrid;
use crate::geometry::{Point, Pose2};

/// What the beam's return came from.
#[derive(Clone, Copy, Debug)]
pub enum Target {
    /// A wall, at this point, running along this direction (radians).
    Wall(Point, f64),
    /// Something on the arc.
    Something,
    /// Nothing was heard.
    Nothing,
}

// Log-odds in hundredths.
const FREE: i16 = -9;
const FREE_UNHEARD: i16 = -3;
const WALL: i16 = 70;
const WALL_BESIDE: i16 = 35;
const ARC_TOTAL: f64 = 60.0;
const OPAQUE: i16 = 120;
/// The part of the cone that is cleared: its rim hears too weakly.
const CLEARED_PART: f64 = 0.7;
/// The part of the full range that a beam without an echo clears.
const UNHEARD_PART: f64 = 0.6;

/// Draws one beam into the grid.
pub fn draw(grid: &mut OccupancyGrid, map_from_sensor: Pose2, half_angle_rad: f64, range_m: f64, target: Target) {
    let cell_m = grid.cell_m();
    let (reach_m, free) = match target {
        Target::Nothing => (UNHEARD_PART * range_m, FREE_UNHEARD),
        Target::Wall(..) | Target::Something => (range_m - 1.5 * cell_m, FREE),
    };
    let cleared_rad = CLEARED_PART * half_angle_rad;
    let cells = (2.0 * cleared_rad * range_m / cell_m).max(1.0);
    #[expect(clippy::cast_possible_truncation, reason = "at most 60")]
    let hit = (ARC_TOTAL / cells).ceil() as i16;
    fan(cleared_rad, reach_m / cell_m, |off_rad| {
        let is_open = clear(grid, map_from_sensor, off_rad, reach_m, free);
        if is_open && matches!(target, Target::Something) {
            let (sin, cos) = libm::sincos(off_rad);
            grid.add(grid.cell(map_from_sensor.transform(Point::new(range_m * cos, range_m * sin))), hit);
        }
    });
    if let Target::Wall(point, along_rad) = target {
        let (sin, cos) = libm::sincos(along_rad);
        grid.add(grid.cell(point), WALL);
        for step_m in [-cell_m, cell_m] {
            grid.add(grid.cell(Point::new(point.x + step_m * cos, point.y + step_m * sin)), WALL_BESIDE);
        }
    }
}

/// Directions across a cone so dense that at a distance of `radius` steps neighbours are a step apart.
fn fan(half_angle_rad: f64, radius: f64, mut each: impl FnMut(f64)) {
    #[expect(clippy::cast_possible_truncation, reason = "a cone of 60 degrees and a range of 20 m are 4,000 cells")]
    let side = (half_angle_rad * radius).ceil().max(0.0) as i32;
    for index in -side..=side {
        each(half_angle_rad * f64::from(index) / f64::from(side.max(1)));
    }
}

/// Clears along one ray, up to a distance or to an occupied cell; true where it got all the way.
fn clear(grid: &mut OccupancyGrid, map_from_sensor: Pose2, off_rad: f64, reach_m: f64, free: i16) -> bool {
    let (sin, cos) = libm::sincos(map_from_sensor.theta_rad + off_rad);
    let step_m = grid.cell_m();
    let mut distance_m = 0.5 * step_m;
    while distance_m < reach_m {
        let point = Point::new(map_from_sensor.x_m + distance_m * cos, map_from_sensor.y_m + distance_m * sin);
        if grid.add(grid.cell(point), free) > OPAQUE {
            return false;
        }
        distance_m += step_m;
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wall_is_marked_and_the_way_to_it_cleared() {
        let mut grid = OccupancyGrid::new(0.05);
        let point = Point::new(1.52, 0.02);
        for _ in 0..5 {
            draw(&mut grid, Pose2::new(0.02, 0.02, 0.0), 0.2, 1.5, Target::Wall(point, 1.57));
        }
        assert!(grid.log_odds(grid.cell(point)) > 300);
        assert!(grid.log_odds(grid.cell(Point::new(1.0, 0.02))) < -30);
        assert_eq!(grid.log_odds(grid.cell(Point::new(1.8, 0.02))), 0);
    }

    #[test]
    fn silence_marks_nothing_and_does_not_see_through_walls() {
        let mut grid = OccupancyGrid::new(0.05);
        let wall = grid.cell(Point::new(1.02, 0.02));
        grid.add(wall, 400);
        draw(&mut grid, Pose2::new(0.02, 0.02, 0.0), 0.0, 3.0, Target::Nothing);
        assert_eq!(grid.log_odds(grid.cell(Point::new(1.3, 0.02))), 0);
        assert!(grid.log_odds(wall) > 300);
        assert!(grid.log_odds(grid.cell(Point::new(0.5, 0.02))) < 0);
    }
}
