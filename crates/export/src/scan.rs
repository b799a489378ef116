//! A sweep as other programs take a laser's: one ray per sensor, and the points that returned the sound.

use super::message::{BASE, Stamp, with_header};
use slamd_core::{Beam, Point};
use std::f64::consts::{PI, TAU};

/// Rays of a scan: one per degree.
const RAYS: usize = 360;
/// Bytes of a point: x, y, z.
const POINT_STEP: usize = 12;
const FLOAT32: u8 = 7;

/// `sensor_msgs/msg/LaserScan` in `base_link`: the ray in whose direction a sensor's echo lies has its distance from the robot's
/// middle, infinity where the sensor hears nothing; all others are NaN. `is_faulty` says which sensors measure nothing.
#[expect(clippy::cast_possible_truncation, reason = "the message has them in single precision")]
pub(super) fn laser_scan(
    at: Stamp,
    beams: &[Beam],
    is_faulty: impl Fn(usize) -> bool,
    max_range_m: f64,
    period_s: f64,
) -> Vec<u8> {
    let mut rays = vec![f32::NAN; RAYS];
    let mut farthest_m = max_range_m;
    for (_, beam) in beams.iter().enumerate().filter(|(sensor, _)| !is_faulty(*sensor)) {
        let (point, is_clear) = match beam.endpoint() {
            Some(point) => (point, false),
            None if beam.is_clear() => (beam.robot_from_sensor.transform(Point::new(max_range_m, 0.0)), true),
            None => continue,
        };
        let distance_m = point.coords.norm();
        farthest_m = farthest_m.max(distance_m);
        let ray = &mut rays[ray_of(libm::atan2(point.y, point.x))];
        let range = if is_clear { f32::INFINITY } else { distance_m as f32 };
        // The nearest of two echoes in one direction; a missing echo only where there is none.
        *ray = if ray.is_nan() { range } else { ray.min(range) };
    }
    let mut cdr = with_header(at, BASE);
    let step = TAU / RAYS as f64;
    for value in [-PI, PI - step, step, 0.0, period_s, 0.0, farthest_m] {
        cdr.f32(value as f32);
    }
    cdr.count(RAYS);
    rays.into_iter().for_each(|range| cdr.f32(range));
    // No intensities.
    cdr.count(0);
    cdr.finish()
}

/// The ray that is nearest to a direction.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a whole number below the count of rays")]
fn ray_of(bearing_rad: f64) -> usize {
    ((bearing_rad + PI) / TAU * RAYS as f64).round().max(0.0) as usize % RAYS
}

/// `sensor_msgs/msg/PointCloud2` in `base_link`: the echoes of a sweep, on the axes of their beams.
#[expect(clippy::cast_possible_truncation, reason = "the message has them in single precision")]
pub(super) fn point_cloud(at: Stamp, beams: &[Beam], is_faulty: impl Fn(usize) -> bool) -> Vec<u8> {
    let echoes =
        beams.iter().enumerate().filter(|(sensor, _)| !is_faulty(*sensor)).filter_map(|(_, beam)| beam.endpoint());
    let points: Vec<[f32; 3]> = echoes.map(|point| [point.x as f32, point.y as f32, 0.0]).collect();
    let mut cdr = with_header(at, BASE);
    cdr.count(1);
    cdr.count(points.len());
    cdr.count(3);
    for (offset, name) in (0u32..).step_by(4).zip(["x", "y", "z"]) {
        cdr.text(name);
        cdr.u32(offset);
        cdr.u8(FLOAT32);
        cdr.u32(1);
    }
    cdr.u8(0);
    cdr.count(POINT_STEP);
    cdr.count(POINT_STEP * points.len());
    cdr.count(POINT_STEP * points.len());
    points.iter().flatten().flat_map(|value| value.to_le_bytes()).for_each(|byte| cdr.u8(byte));
    cdr.u8(1);
    cdr.finish()
}

#[cfg(test)]
mod tests {
    use super::*;
    use slamd_core::Pose2;

    fn beam(bearing_rad: f64, range_m: f64) -> Beam {
        let (sin, cos) = libm::sincos(bearing_rad);
        let robot_from_sensor = Pose2::new(0.15 * cos, 0.15 * sin, bearing_rad);
        Beam { range_m, no_measurement: None, age_s: 0.0, robot_from_sensor, half_angle_rad: 0.2 }
    }

    #[test]
    fn each_sensor_has_its_ray() {
        let beams = [beam(0.0, 1.0), beam(0.5 * PI, f64::INFINITY), beam(PI, f64::NAN), beam(-0.5 * PI, 2.0)];
        let bytes = laser_scan(Stamp(0), &beams, |sensor| sensor == 3, 3.0, 0.1);
        let values: Vec<f32> = bytes[bytes.len() - 4 - 4 * RAYS..bytes.len() - 4]
            .as_chunks()
            .0
            .iter()
            .map(|four| f32::from_le_bytes(*four))
            .collect();
        assert!((values[180] - 1.15).abs() < 1e-6 && values[270].is_infinite());
        assert_eq!(values.iter().filter(|value| value.is_nan()).count(), RAYS - 2);
        assert_eq!((ray_of(-PI), ray_of(PI), ray_of(0.0)), (0, 0, 180));
    }

    #[test]
    fn a_cloud_holds_the_echoes_alone() {
        let beams = [beam(0.0, 1.0), beam(1.0, f64::INFINITY), beam(2.0, 0.5)];
        let one = point_cloud(Stamp(0), &beams[..1], |_| false);
        assert_eq!(point_cloud(Stamp(0), &beams, |_| false).len(), one.len() + POINT_STEP);
        assert_eq!(point_cloud(Stamp(0), &beams, |sensor| sensor == 2), one);
    }
}
