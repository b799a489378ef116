//! The inverse sensor model of a sonar: a beam → which cells became freer and which more occupied.
//!
//! Up to the range the cone is free, because the nearest surface in it is at the range. One return does not tell
//! where on the arc that surface lies:
//!
//! - A wall that the pose filter knows is marked at the point of the echo.
//! - A return that an occupied cell on the arc explains marks that cell. A return that nothing explains is
//!   spread thinly over its arc, so that returns from several poses must agree before something appears.
//! - A beam that heard nothing clears a part of its cone and marks nothing, which removes the arcs at full range of the paper's Fig. 1.
//!
//! A surface is thin: what is marked in one cell fades in weaker ones just before and behind it along the beam. A wall is a mirror: a ray
//! that meets one steeply ends there and says nothing against it; one that should have been thrown back does. Each cell of a cone
//! is touched about once: rays split on their way out, where they would be more than a cell apart.

use super::grid::{OccupancyGrid, WallNormal};
use crate::geometry::{Point, Pose2};

/// What the beam's return came from.
#[derive(Clone, Copy, Debug)]
pub enum ReturnKind {
    /// A wall, at this point, with this side toward the sensor.
    Wall(Point, WallNormal),
    /// An unknown surface on the arc.
    Something,
    /// No echo.
    Nothing,
}

/// Rays of a cone at most; a wider or longer one is cleared less densely at its end.
const MAX_RAYS: usize = 64;

/// Clears the cone of one beam and, where it heard something, marks what that was.
pub fn integrate_beam(
    grid: &mut OccupancyGrid,
    map_from_sensor: Pose2,
    half_angle_rad: f64,
    range_m: f64,
    kind: ReturnKind,
) {
    let params = *grid.params();
    let (reach_m, free) = match kind {
        ReturnKind::Nothing => (params.unheard_part * range_m, params.free_unheard),
        ReturnKind::Wall(..) | ReturnKind::Something => (range_m - params.shortfall_cells * grid.cell_m(), params.free),
    };
    let fan = Fan::new(map_from_sensor, params.cleared_part * half_angle_rad, reach_m, grid.cell_m());
    let (count, is_open) = fan.clear(grid, free);
    match kind {
        ReturnKind::Wall(point, normal) => mark_wall(grid, point, normal),
        ReturnKind::Something => mark_arc(grid, &fan, range_m, &is_open[..count]),
        ReturnKind::Nothing => {}
    }
}

/// Marks the point of a wall that echoed, without clearing the way to it.
pub fn mark_wall(grid: &mut OccupancyGrid, point: Point, normal: WallNormal) {
    let params = *grid.params();
    let cell = grid.cell(point);
    let (across, along) = match normal {
        WallNormal::X => ((1, 0), (0, 1)),
        WallNormal::Y => ((0, 1), (1, 0)),
    };
    for (step, hundredths) in [(0, params.wall), (-1, params.wall_beside), (1, params.wall_beside)] {
        let here = cell.offset(step * along.0, step * along.1);
        grid.add(here, hundredths);
        grid.face(here, normal);
        for behind in [-2, -1, 1, 2] {
            grid.fade(here.offset(behind * across.0, behind * across.1), here, hundredths / 2);
        }
    }
}

/// Gives a return to the occupied cell that explains it, or to all of the arc that is in sight.
fn mark_arc(grid: &mut OccupancyGrid, fan: &Fan, range_m: f64, is_open: &[bool]) {
    let params = *grid.params();
    let at = |ray: usize, range_m: f64| {
        let (cos, sin) = fan.directions[ray];
        Point::new(fan.origin.x + range_m * cos, fan.origin.y + range_m * sin)
    };
    let open = || (0..is_open.len()).filter(|&ray| is_open[ray]);
    let mut known: Option<(i16, usize, f64)> = None;
    for (ray, step) in open().flat_map(|ray| [(ray, 0.0), (ray, -1.0), (ray, 1.0)]) {
        let range_m = range_m + step * grid.cell_m();
        let value = grid.log_odds(grid.cell(at(ray, range_m)));
        if value > params.opaque && known.is_none_or(|(best, ..)| value > best) {
            known = Some((value, ray, range_m));
        }
    }
    let mut mark = |ray: usize, range_m: f64, hundredths: i16| {
        let cell = grid.cell(at(ray, range_m));
        grid.add(cell, hundredths);
        for step in [-2.0, -1.0, 1.0, 2.0] {
            let beside = grid.cell(at(ray, range_m + step * grid.cell_m()));
            if beside != cell {
                grid.fade(beside, cell, hundredths / 2);
            }
        }
    };
    if let Some((_, ray, range_m)) = known {
        return mark(ray, range_m, params.known);
    }
    #[expect(clippy::cast_possible_truncation, reason = "at most 60")]
    let hit = (params.arc_total / is_open.len() as f64).ceil() as i16;
    for ray in open() {
        mark(ray, range_m, hit);
    }
}

/// The rays of a cone, evenly spread, the outermost on its edges.
struct Fan {
    origin: Point,
    reach_m: f64,
    /// Rays: about as many as the cone is cells wide at its end, and one.
    count: usize,
    /// Cosine and sine of each ray's direction.
    directions: [(f64, f64); MAX_RAYS],
}

impl Fan {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
    fn new(map_from_sensor: Pose2, half_angle_rad: f64, reach_m: f64, cell_m: f64) -> Self {
        let wide = 2.0 * half_angle_rad * reach_m / cell_m;
        let steps = wide.ceil().clamp(0.0, (MAX_RAYS - 1) as f64);
        let first_rad = map_from_sensor.theta_rad - if steps > 0.0 { half_angle_rad } else { 0.0 };
        let (sin, cos) = libm::sincos(first_rad);
        let (sin_step, cos_step) = libm::sincos(2.0 * half_angle_rad / steps.max(1.0));
        let (mut directions, count) = ([(cos, sin); MAX_RAYS], steps as usize + 1);
        for ray in 1..count {
            let (cos, sin) = directions[ray - 1];
            directions[ray] = (cos * cos_step - sin * sin_step, sin * cos_step + cos * sin_step);
        }
        Self { origin: map_from_sensor.position(), reach_m, count, directions }
    }

    /// Clears along the rays; gives how many there are and which of them got all the way.
    fn clear(&self, grid: &mut OccupancyGrid, free: i16) -> (usize, [bool; MAX_RAYS]) {
        let count = self.count;
        let (mut ends_m, mut is_open) = ([f64::INFINITY; MAX_RAYS], [false; MAX_RAYS]);
        let mut spread = count.next_power_of_two();
        ends_m[0] = self.ray(grid, 0, 0.0, free);
        while spread > 1 {
            spread /= 2;
            // Rays of twice this spread are a cell apart here; before, they touch the same cells.
            let start_m = self.reach_m / (2 * spread) as f64;
            for ray in (spread..count).step_by(2 * spread) {
                let parent_m = ends_m[ray - spread];
                ends_m[ray] = if parent_m < start_m { parent_m } else { self.ray(grid, ray, start_m, free) };
            }
        }
        for (open, end_m) in is_open.iter_mut().zip(ends_m) {
            *open = end_m >= self.reach_m;
        }
        (count, is_open)
    }

    /// Clears along one ray from `start_m` on, and gives where it ends: at an occupied cell, else at infinity.
    fn ray(&self, grid: &mut OccupancyGrid, ray: usize, start_m: f64, free: i16) -> f64 {
        let params = *grid.params();
        let (cos, sin) = self.directions[ray];
        let first_m = start_m + 0.5 * grid.cell_m();
        let ray = grid.ray(self.origin, (cos, sin), first_m, self.reach_m);
        let Some((step, cell)) = grid.clear(ray, free, params.opaque) else { return f64::INFINITY };
        let against = match grid.normal(cell) {
            Some(WallNormal::X) if sin.abs() > params.sin_mirror => 0,
            Some(WallNormal::Y) if cos.abs() > params.sin_mirror => 0,
            Some(_) => params.wall_contradicted,
            None => params.contradicted,
        };
        grid.add(cell, against);
        first_m + f64::from(step) * grid.cell_m()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HERE: Pose2 = Pose2 { x_m: 0.02, y_m: 0.02, theta_rad: 0.0 };

    #[test]
    fn a_wall_is_marked_and_the_way_to_it_cleared() {
        let mut grid = OccupancyGrid::new(0.05);
        let point = Point::new(1.52, 0.02);
        for _ in 0..16 {
            integrate_beam(&mut grid, HERE, 0.2, 1.5, ReturnKind::Wall(point, WallNormal::X));
        }
        assert!(grid.log_odds(grid.cell(point)) > 300);
        assert!(grid.log_odds(grid.cell(Point::new(1.0, 0.02))) < -30);
        assert_eq!(grid.log_odds(grid.cell(Point::new(1.8, 0.02))), 0);
    }

    #[test]
    fn every_cell_of_a_cone_is_cleared() {
        let mut grid = OccupancyGrid::new(0.05);
        integrate_beam(&mut grid, HERE, 0.25, 3.0, ReturnKind::Something);
        for index in 0..1000 {
            let (distance_m, share) = (0.1 + 0.275 * f64::from(index / 100), f64::from(index % 100) / 50.0 - 1.0);
            let (sin, cos) = libm::sincos(0.95 * grid.params().cleared_part * 0.25 * share);
            let cell = grid.cell(Point::new(0.02 + distance_m * cos, 0.02 + distance_m * sin));
            assert!(grid.log_odds(cell) < 0, "{distance_m} m, {share}");
        }
    }

    #[test]
    fn silence_marks_nothing_and_does_not_see_through_walls() {
        let mut grid = OccupancyGrid::new(0.05);
        let wall = grid.cell(Point::new(1.02, 0.02));
        grid.add(wall, 400);
        integrate_beam(&mut grid, HERE, 0.0, 3.0, ReturnKind::Nothing);
        assert_eq!(grid.log_odds(grid.cell(Point::new(1.3, 0.02))), 0);
        assert!(grid.log_odds(wall) > 300);
        assert!(grid.log_odds(grid.cell(Point::new(0.5, 0.02))) < 0);
    }

    #[test]
    fn a_mirror_is_not_contradicted_from_the_side() {
        for (normal, is_contradicted) in [(WallNormal::X, true), (WallNormal::Y, false)] {
            let mut grid = OccupancyGrid::new(0.05);
            let wall = grid.cell(Point::new(1.02, 0.02));
            grid.add(wall, 400);
            grid.face(wall, normal);
            integrate_beam(&mut grid, HERE, 0.0, 2.0, ReturnKind::Something);
            assert_eq!(grid.log_odds(wall) < 400, is_contradicted, "{normal:?}");
        }
    }

    #[test]
    fn what_is_known_explains_a_return_and_the_rest_of_the_arc_stays_empty() {
        let mut grid = OccupancyGrid::new(0.05);
        let post = Point::new(1.525, 0.125);
        grid.add(grid.cell(post), 200);
        integrate_beam(&mut grid, HERE, 0.2, (post - HERE.position()).norm(), ReturnKind::Something);
        assert!(grid.log_odds(grid.cell(post)) > 200);
        assert_eq!(grid.log_odds(grid.cell(Point::new(1.525, -0.085))), 0);
    }

    #[test]
    fn a_noisy_surface_stays_thin() {
        let mut grid = OccupancyGrid::new(0.05);
        for index in 0..400 {
            // Most readings are right, one in five is a cell too far and one in five a cell too near.
            let range_m = 1.5 + 0.05 * [0.0, 0.0, 1.0, 0.0, -1.0][index % 5];
            integrate_beam(&mut grid, HERE, 0.0, range_m, ReturnKind::Something);
        }
        let value = |x: f64| grid.log_odds(grid.cell(Point::new(x, 0.02)));
        assert!(
            value(1.52) > 300 && value(1.57) < 62 && value(1.47) < 62,
            "{} {} {}",
            value(1.47),
            value(1.52),
            value(1.57)
        );
    }
}
