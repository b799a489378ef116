//! What a reading says about a pose: rays across the beam are followed through the map, and their ends compared with the range.
//!
//! | outcome | the map at this pose |
//! |---|---|
//! | explained | holds a surface on the arc at the range |
//! | through | holds a surface before it that reflects the sound: by one ray, by two, by three or more |
//! | in free space | is free up to the range and on all of the arc |
//! | silent | holds a surface that reflects the sound of three rays or more, and nothing was heard |
//! | unknown | does not tell |

use super::params::Params;
use crate::geometry::Pose2;
use crate::mapping::grid::{OccupancyGrid, Reader, WallNormal};
use crate::position::beam_model::POINT_RAD;

/// How a reading and the map agree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Outcome {
    Explained,
    Unknown,
    InFree,
    Through1,
    Through2,
    Through3,
    Silent,
}

/// What one ray meets.
#[derive(Clone, Copy, Debug, Default)]
struct RayEnd {
    /// The range of the first surface, metres.
    hit_m: Option<f64>,
    /// That surface is well known and reflects the sound back.
    reflects: bool,
    /// The ray's last part, around the range, is known to be free.
    is_free: bool,
}

/// Compares a reading, none for no echo, with the map.
pub(super) fn outcome(
    grid: &OccupancyGrid,
    map_from_sensor: Pose2,
    half_angle_rad: f64,
    range_m: Option<f64>,
    max_range_m: f64,
    params: &Params,
) -> Outcome {
    let spread_rad = half_angle_rad.max(params.min_spread_rad);
    let is_point = half_angle_rad < POINT_RAD;
    let reach_m = range_m.map_or(max_range_m - params.silent_margin_m, |range_m| range_m + params.near_m);
    let (mut through, mut open, mut free) = (0, 0, 0);
    let mut reader = grid.reader();
    for offset in params.rays {
        let ray = map_from_sensor * Pose2::new(0.0, 0.0, spread_rad * offset);
        let end = follow(grid, &mut reader, ray, reach_m, range_m, is_point, params);
        match (end.hit_m, range_m) {
            (Some(hit_m), Some(range_m)) if (hit_m - range_m).abs() <= params.near_m => return Outcome::Explained,
            (Some(hit_m), Some(range_m)) => {
                through += i32::from(end.reflects && hit_m < range_m - params.through_m);
            }
            (Some(_), None) => through += i32::from(end.reflects),
            (None, _) => {
                open += 1;
                free += i32::from(end.is_free);
            }
        }
    }
    match (range_m, through) {
        (None, 3..) => Outcome::Silent,
        (None, _) => Outcome::Unknown,
        (Some(_), 3..) => Outcome::Through3,
        (Some(_), 2) => Outcome::Through2,
        (Some(_), 1) => Outcome::Through1,
        (Some(range_m), _) if is_on_arc(grid, &mut reader, map_from_sensor, spread_rad, range_m, params) => {
            Outcome::Explained
        }
        _ if open > 0 && free == open => Outcome::InFree,
        _ => Outcome::Unknown,
    }
}

/// Follows a ray to the first surface.
fn follow(
    grid: &OccupancyGrid,
    reader: &mut Reader<'_>,
    ray: Pose2,
    reach_m: f64,
    range_m: Option<f64>,
    is_point: bool,
    params: &Params,
) -> RayEnd {
    let (sin, cos) = libm::sincos(ray.theta_rad);
    let start_m = params.start_m;
    let around_m = range_m.unwrap_or(reach_m) - params.around_m;
    let mut end = RayEnd { is_free: true, ..RayEnd::default() };
    for (step, cell) in grid.ray(ray.position(), (cos, sin), start_m, reach_m).enumerate() {
        let log_odds = reader.log_odds(cell);
        let here_m = start_m + step as f64 * grid.cell_m();
        if log_odds >= params.occupied {
            let cos_incidence = match reader.normal(cell) {
                Some(WallNormal::X) => cos.abs(),
                Some(WallNormal::Y) => sin.abs(),
                None => 1.0,
            };
            end.hit_m = Some(here_m);
            end.reflects = log_odds >= params.solid && (is_point || cos_incidence > params.min_cos_incidence);
            return end;
        }
        end.is_free &= here_m < around_m || log_odds <= params.free;
    }
    end
}

/// True if a cell on the arc is occupied: something small that no ray met.
fn is_on_arc(
    grid: &OccupancyGrid,
    reader: &mut Reader<'_>,
    map_from_sensor: Pose2,
    spread_rad: f64,
    range_m: f64,
    params: &Params,
) -> bool {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an arc of some cells")]
    let steps = (2.0 * spread_rad * range_m / grid.cell_m()).ceil().clamp(1.0, 64.0) as u32;
    (0..=steps).any(|step| {
        let offset_rad = spread_rad * (2.0 * f64::from(step) / f64::from(steps) - 1.0);
        let ray = map_from_sensor * Pose2::new(0.0, 0.0, offset_rad);
        [0.0, -1.0, 1.0].into_iter().any(|cells: f64| {
            let point = ray.ahead(range_m + cells * grid.cell_m());
            reader.log_odds(grid.cell(point)) >= params.occupied
        })
    })
}
