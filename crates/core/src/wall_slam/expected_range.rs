//! The range that a beam must measure, by the map.
//!
//! Rays across the beam are followed to the first cell that may be occupied. A ray *ends* if that cell is well known. Its end
//! *reflects* the sound back if the surface is met within 30 degrees of its normal, or has no normal: a corner, a leg. The two
//! shares of the rays give the detection probability. In the simulator's worlds, alike in all, a healthy sensor is silent nearly half the
//! time if no ray is reflected, in 2 % of the sweeps if a third are, in 1 % or less if half are and in less than 0.1 % if all are.
//! If the other rays do not end, the map has a gap, and the sensor is silent four times as often as if they do.

use super::params::Params;
use crate::fault::evidence::Expected;
use crate::geometry::Pose2;
use crate::mapping::grid::{OccupancyGrid, WallNormal};
use crate::position::beam_model::POINT_RAD;

/// What the beam of a sensor at `map_from_sensor` must measure; none if nothing in it reflects.
#[must_use]
pub(super) fn expected(
    grid: &OccupancyGrid,
    map_from_sensor: Pose2,
    half_angle_rad: f64,
    max_range_m: f64,
    params: &Params,
) -> Option<Expected> {
    let spread_rad = half_angle_rad.max(params.min_ray_spread_rad);
    let (mut ended, mut reflected, mut nearest_m) = (0.0, 0.0, f64::INFINITY);
    for (count, offset) in params.ray_offsets.into_iter().enumerate() {
        if count == params.rays_for_open_view && ended == 0.0 {
            return None;
        }
        let ray = map_from_sensor * Pose2::new(0.0, 0.0, spread_rad * offset);
        let Some(RayEnd { range_m, cos_incidence }) = follow(grid, ray, max_range_m - params.range_margin_m, params)
        else {
            continue;
        };
        ended += 1.0;
        // A point beam measures whatever it meets.
        if half_angle_rad < POINT_RAD || cos_incidence > params.min_cos_incidence {
            reflected += 1.0;
            nearest_m = nearest_m.min(range_m);
        }
    }
    let rays = params.ray_offsets.len() as f64;
    let detection_probability = reflected / rays * (ended / rays).powi(2);
    (reflected > 0.0).then_some(Expected { range_m: nearest_m, detection_probability })
}

/// Where a ray ends.
struct RayEnd {
    range_m: f64,
    /// 1 if the surface has no normal.
    cos_incidence: f64,
}

/// Follows a ray to the first cell that may be occupied; none if that is not well known.
fn follow(grid: &OccupancyGrid, ray: Pose2, reach_m: f64, params: &Params) -> Option<RayEnd> {
    let (sin, cos) = libm::sincos(ray.theta_rad);
    let mut reader = grid.reader();
    for (step, cell) in (1..).zip(grid.ray(ray.position(), (cos, sin), grid.cell_m(), reach_m)) {
        let log_odds = reader.log_odds(cell);
        if log_odds > 0 {
            let cos_incidence = match reader.normal(cell) {
                Some(WallNormal::X) => cos.abs(),
                Some(WallNormal::Y) => sin.abs(),
                None => 1.0,
            };
            let range_m = f64::from(step) * grid.cell_m();
            return (log_odds >= params.well_known_log_odds).then_some(RayEnd { range_m, cos_incidence });
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Point;
    use crate::mapping::cone::mark_wall;
    use std::f64::consts::PI;

    const HALF_RAD: f64 = 12.5 / 180.0 * PI;

    /// A wall across x, 1.5 m ahead, from −2 to `until_m`.
    fn wall(until_m: f64) -> OccupancyGrid {
        let mut grid = OccupancyGrid::new(0.05);
        for step in 0..400 {
            let along_m = 0.01 * f64::from(step) - 2.0;
            if along_m < until_m {
                (0..20).for_each(|_| mark_wall(&mut grid, Point::new(1.52, along_m), WallNormal::X));
            }
        }
        grid
    }

    fn detection_probability(grid: &OccupancyGrid, heading_deg: f64, half_angle_rad: f64) -> f64 {
        let pose = Pose2::new(0.01, 0.0, heading_deg.to_radians());
        expected(grid, pose, half_angle_rad, 3.0, &Params::default())
            .map_or(0.0, |expected| expected.detection_probability)
    }

    #[test]
    fn a_wall_that_fills_the_beam_is_expected_unless_it_mirrors_the_sound_away() {
        let wall = wall(2.0);
        assert!((detection_probability(&wall, 0.0, HALF_RAD) - 1.0).abs() < 1e-9);
        assert!((0.1..0.9).contains(&detection_probability(&wall, 35.0, HALF_RAD)));
        assert!(detection_probability(&wall, 45.0, HALF_RAD) < 1e-9);
        assert!((detection_probability(&wall, 45.0, 0.0) - 1.0).abs() < 1e-9, "a point beam measures it");
        assert!(
            (expected(&wall, Pose2::default(), HALF_RAD, 3.0, &Params::default()).unwrap().range_m - 1.5).abs() < 0.06
        );
    }

    #[test]
    fn the_detection_probability_falls_with_the_open_part_of_the_beam() {
        let [whole, most, half] = [2.0, 0.2, 0.0].map(|until_m| detection_probability(&wall(until_m), 0.0, HALF_RAD));
        assert!(whole > most && most > 2.0 * half && half > 0.0, "{whole} {most} {half}");
    }

    #[test]
    fn nothing_is_expected_of_cells_that_are_too_far_or_hardly_known() {
        let pose = Pose2::new(-1.4, 0.0, 0.0);
        assert!(expected(&wall(2.0), pose, HALF_RAD, 3.0, &Params::default()).is_none());
        let mut once = OccupancyGrid::new(0.05);
        mark_wall(&mut once, Point::new(1.52, 0.0), WallNormal::X);
        assert!(expected(&once, Pose2::default(), HALF_RAD, 3.0, &Params::default()).is_none());
    }
}
