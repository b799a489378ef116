//! The robot with its ring of beams: green where a sensor is used, red with a cross where it is not.

use super::surface::{Ink, Pen, Pixel, Surface};
use slamd_core::{Point, Pose2, Ring, SensorState};

/// How the robot is drawn.
pub(super) struct RobotMark<'a> {
    pub(super) ring: &'a Ring,
    /// By sensor id; sensors without a state are healthy.
    pub(super) states: &'a [SensorState],
    /// Length of the beams from the body's edge, pixels.
    pub(super) beam_px: f64,
    /// The body's radius, pixels.
    pub(super) body_px: f64,
}

impl RobotMark<'_> {
    /// Draws the robot at `centre`, looking along `heading_rad` counter-clockwise from the right.
    pub(super) fn draw(&self, canvas: &mut dyn Surface, centre: Pixel, heading_rad: f64) {
        let outward = |bearing_rad: f64, distance_px: f64| {
            let (sin, cos) = libm::sincos(heading_rad + bearing_rad);
            (centre.0 + distance_px * cos, centre.1 - distance_px * sin)
        };
        let far_px = self.body_px + self.beam_px;
        for (sensor, mounting) in self.ring.mountings.iter().enumerate() {
            let faulty = matches!(self.states.get(sensor), Some(SensorState::Faulty(_)));
            let bearing_rad = mounting.robot_from_sensor.theta_rad;
            let opening_rad = mounting.half_angle_rad.max(MIN_HALF_ANGLE_RAD);
            let edge = |part: f64| outward(bearing_rad + part * opening_rad, far_px);
            let cone = [outward(bearing_rad, self.body_px), edge(-0.8), edge(-0.4), edge(0.0), edge(0.4), edge(0.8)];
            canvas.polygon(&cone, if faulty { FAULTY_CONE } else { HEALTHY_CONE });
            let pen = Pen::solid(if faulty { FAULTY } else { HEALTHY }, (0.03 * far_px).clamp(1.0, 2.0));
            canvas.polyline(&[outward(bearing_rad, self.body_px), outward(bearing_rad, far_px)], pen);
        }
        for (sensor, mounting) in self.ring.mountings.iter().enumerate() {
            if matches!(self.states.get(sensor), Some(SensorState::Faulty(_))) {
                let at = outward(mounting.robot_from_sensor.theta_rad, far_px);
                canvas.cross(at, (0.07 * far_px).clamp(3.0, 5.0), Pen::solid(FAULTY, 2.2));
            }
        }
        canvas.disc(centre, self.body_px, BODY);
        let nose =
            [outward(0.0, 0.72 * self.body_px), outward(2.4, 0.6 * self.body_px), outward(-2.4, 0.6 * self.body_px)];
        canvas.polygon(&nose, NOSE);
    }
}

/// The robot's radius: the farthest sensor from the axle's middle, metres.
pub(super) fn body_m(ring: &Ring) -> f64 {
    let far = |pose: Pose2| (pose.position() - Point::origin()).norm();
    ring.mountings.iter().map(|mounting| far(mounting.robot_from_sensor)).fold(MIN_BODY_M, f64::max)
}

pub(super) const HEALTHY: Ink = [62, 150, 110, 255];
const HEALTHY_CONE: Ink = [62, 150, 110, 26];
pub(super) const FAULTY: Ink = [206, 52, 52, 255];
const FAULTY_CONE: Ink = [206, 52, 52, 56];
const BODY: Ink = [33, 74, 128, 255];
const NOSE: Ink = [255, 255, 255, 235];
/// Point beams are drawn this wide.
const MIN_HALF_ANGLE_RAD: f64 = 0.02;
const MIN_BODY_M: f64 = 0.12;
