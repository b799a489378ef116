//! What a beam must hear, by the map.
//!
//! Rays across the beam are followed to the first cell where anything may stand. A ray *ends* where that is well known, and what it ends
//! at *answers* where it is met within 30 degrees of its normal or is no wall: a corner, a leg. The two shares of the rays tell how
//! surely a healthy sensor hears something. In the simulator's worlds, alike in all, it is silent nearly half the time where none
//! answers, in 2 % of the sweeps where a third do, in 1 % or less where half do and in less than 0.1 % where all do. Where the
//! others do not end, the map has a gap, and it is silent four times as often as where they do.

use crate::fault::evidence::Expected;
use crate::geometry::Pose2;
use crate::mapping::grid::{OccupancyGrid, WallNormal};
use crate::position::beam_model::POINT_RAD;

/// Where the rays lie between the axis and the beam's edges; where none of the first ends, the view is open.
const PLACES: [f64; 5] = [0.0, -1.0, 1.0, -0.5, 0.5];
const ENOUGH: usize = 3;
/// The rays spread at least this far to either side: the heading is not known better, radians.
const MIN_SPREAD_RAD: f64 = 0.05;
/// From these log-odds on a cell is well known, hundredths.
const WELL_KNOWN: i16 = 200;
/// Cosine of the incidence up to which a wall answers: 30 degrees.
const COS_ANSWERS: f64 = 0.866;
/// What is nearer to the farthest range than this may well be missed, metres.
const MARGIN_M: f64 = 0.25;

/// What the beam of a sensor at `map_from_sensor` must hear; none where nothing in it answers.
#[must_use]
pub(super) fn expected(
    grid: &OccupancyGrid,
    map_from_sensor: Pose2,
    half_angle_rad: f64,
    max_range_m: f64,
) -> Option<Expected> {
    let spread_rad = half_angle_rad.max(MIN_SPREAD_RAD);
    let (mut ended, mut answered, mut nearest_m) = (0.0, 0.0, f64::INFINITY);
    for (count, place) in PLACES.into_iter().enumerate() {
        if count == ENOUGH && ended == 0.0 {
            return None;
        }
        let ray = map_from_sensor * Pose2::new(0.0, 0.0, spread_rad * place);
        let Some(Met { range_m, cos_incidence }) = follow(grid, ray, max_range_m - MARGIN_M) else { continue };
        ended += 1.0;
        // A point beam hears whatever it meets.
        if half_angle_rad < POINT_RAD || cos_incidence > COS_ANSWERS {
            answered += 1.0;
            nearest_m = nearest_m.min(range_m);
        }
    }
    let rays = PLACES.len() as f64;
    let detection_probability = answered / rays * (ended / rays).powi(2);
    (answered > 0.0).then_some(Expected { range_m: nearest_m, detection_probability })
}

/// Where a ray ends.
struct Met {
    range_m: f64,
    /// 1 where the surface has no direction.
    cos_incidence: f64,
}

/// Follows a ray to the first cell where anything may stand; none where that is not well known.
fn follow(grid: &OccupancyGrid, ray: Pose2, reach_m: f64) -> Option<Met> {
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
            return (log_odds >= WELL_KNOWN).then_some(Met { range_m: f64::from(step) * grid.cell_m(), cos_incidence });
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
        expected(grid, pose, half_angle_rad, 3.0).map_or(0.0, |expected| expected.detection_probability)
    }

    #[test]
    fn a_wall_that_fills_the_beam_must_be_heard_and_one_that_mirrors_the_sound_away_need_not() {
        let wall = wall(2.0);
        assert!((detection_probability(&wall, 0.0, HALF_RAD) - 1.0).abs() < 1e-9);
        assert!((0.1..0.9).contains(&detection_probability(&wall, 35.0, HALF_RAD)));
        assert!(detection_probability(&wall, 45.0, HALF_RAD) < 1e-9);
        assert!((detection_probability(&wall, 45.0, 0.0) - 1.0).abs() < 1e-9, "a point beam hears it");
        assert!((expected(&wall, Pose2::default(), HALF_RAD, 3.0).unwrap().range_m - 1.5).abs() < 0.06);
    }

    #[test]
    fn the_more_of_the_beam_is_open_the_less_is_sure() {
        let [whole, most, half] = [2.0, 0.2, 0.0].map(|until_m| detection_probability(&wall(until_m), 0.0, HALF_RAD));
        assert!(whole > most && most > 2.0 * half && half > 0.0, "{whole} {most} {half}");
    }

    #[test]
    fn what_is_too_far_or_hardly_known_promises_nothing() {
        let pose = Pose2::new(-1.4, 0.0, 0.0);
        assert!(expected(&wall(2.0), pose, HALF_RAD, 3.0).is_none());
        let mut once = OccupancyGrid::new(0.05);
        mark_wall(&mut once, Point::new(1.52, 0.0), WallNormal::X);
        assert!(expected(&once, Pose2::default(), HALF_RAD, 3.0).is_none());
    }
}
