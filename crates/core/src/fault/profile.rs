//! How badly a motion between two sweeps explains the change of their ranges.
//!
//! Each endpoint of the earlier sweep is carried along by the motion and compared with what the sensor that now looks there hears. That needs
//! neither map nor pose. Walls hide behind each other and cones are wide, so single misfits say little; their mean tells motions apart
//! that differ by more than the angle between two sensors.

use super::params::Params;
use crate::geometry::{Point, Pose2, Ring, wrap_angle};
use crate::sweep::Sweep;
use std::f64::consts::TAU;

/// The ring's geometry, ready for comparing.
#[derive(Clone, Debug)]
pub(super) struct Comparer {
    sensors: Vec<Sensor>,
    /// By direction: the sensor that looks there.
    looking: [Option<usize>; DIRECTIONS],
}

#[derive(Clone, Copy, Debug)]
struct Sensor {
    pose: Pose2,
    cos: f64,
    sin: f64,
}

/// One sweep's endpoints in the robot's frame, those of trusted sensors that heard something.
pub(super) type Endpoints = Vec<Point>;

/// Directions told apart: 5 degrees each.
const DIRECTIONS: usize = 72;

impl Comparer {
    pub(super) fn new(ring: &Ring, params: &Params) -> Self {
        let pose = |mounting: &crate::geometry::Mounting| mounting.robot_from_sensor;
        let sensors: Vec<Sensor> = ring.mountings.iter().map(pose).map(Sensor::at).collect();
        let looking = std::array::from_fn(|direction| {
            let bearing_rad = TAU * (direction as f64 + 0.5) / DIRECTIONS as f64;
            let aside_rad = |sensor: &usize| wrap_angle(sensors[*sensor].pose.theta_rad - bearing_rad).abs();
            let nearest = (0..sensors.len()).min_by(|a, b| aside_rad(a).total_cmp(&aside_rad(b)));
            nearest.filter(|sensor| aside_rad(sensor) < params.endpoint_aside_rad)
        });
        Self { sensors, looking }
    }

    /// Room for the endpoints of any sweep.
    pub(super) fn room(&self) -> Endpoints {
        Vec::with_capacity(self.sensors.len())
    }

    /// Takes a sweep's endpoints. Sensors are where they are mounted: both sweeps fire in the same order, and the board's counts, which
    /// would tell how the robot moved between two groups, are what is in doubt.
    pub(super) fn endpoints(&self, sweep: &Sweep, is_trusted: impl Fn(usize) -> bool, into: &mut Endpoints) {
        into.clear();
        for (index, (sensor, beam)) in self.sensors.iter().zip(&sweep.beams).enumerate() {
            if beam.has_range() && is_trusted(index) {
                let (x_m, y_m) = (sensor.pose.x_m, sensor.pose.y_m);
                into.push(Point::new(x_m + beam.range_m * sensor.cos, y_m + beam.range_m * sensor.sin));
            }
        }
    }

    /// Mean cost per endpoint, from 0 to 4, of a sweep after the wheels have rolled by `rolled_m` since `before`; none where too few
    /// endpoints can be compared.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the directions")]
    pub(super) fn cost(
        &self,
        before: &Endpoints,
        sweep: &Sweep,
        is_trusted: impl Fn(usize) -> bool,
        rolled_m: [f64; 2],
        base_m: f64,
        params: &Params,
    ) -> Option<f64> {
        let motion = Pose2::default().rolled(rolled_m[0], rolled_m[1], base_m);
        let (sin, cos) = libm::sincos(motion.theta_rad);
        let (mut sum, mut compared) = (0.0, 0.0);
        for point in before {
            let (dx, dy) = (point.x - motion.x_m, point.y - motion.y_m);
            let (x_m, y_m) = (cos * dx + sin * dy, cos * dy - sin * dx);
            let turn = libm::atan2(y_m, x_m) / TAU;
            let direction = (turn.rem_euclid(1.0) * DIRECTIONS as f64) as usize;
            let Some(index) = self.looking[direction.min(DIRECTIONS - 1)] else { continue };
            let range_m = sweep.beams.get(index).map_or(f64::NAN, |beam| beam.range_m);
            if !range_m.is_finite() || !is_trusted(index) {
                continue;
            }
            let Sensor { pose, cos, sin } = self.sensors[index];
            let expected_m = (x_m - pose.x_m) * cos + (y_m - pose.y_m) * sin;
            let off = (range_m - expected_m) / params.endpoint_sigma_m;
            sum += (0.5 * off * off).min(params.max_cost);
            compared += 1.0;
        }
        (compared >= params.min_compared).then(|| sum / compared)
    }
}

impl Sensor {
    fn at(pose: Pose2) -> Self {
        let (sin, cos) = libm::sincos(pose.theta_rad);
        Self { pose, cos, sin }
    }
}
