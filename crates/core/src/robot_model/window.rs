//! The returns of the robot's latest metres, as the configured robot reports them.

use super::concentration::Arc;
use super::hypothesis::{RobotModel, Sensor, motion};
use super::params::Params;
use crate::geometry::{Pose2, Ring};
use crate::sweep::Sweep;
use std::collections::VecDeque;

/// The latest sweeps in which the robot moved.
#[derive(Clone, Debug)]
pub(super) struct Window {
    keys: VecDeque<Key>,
    returns: VecDeque<Return>,
    /// The reported motion since the last key.
    ds_m: f64,
    dtheta_rad: f64,
    /// Path of all keys, metres; a rotation counts as the way of the ring's rim.
    path_m: f64,
    next_sensor: usize,
    /// Since the last clear, older sweeps have left.
    is_full: bool,
    /// The farthest return of all, and the path of all, metres.
    farthest_m: f64,
    whole_path_m: f64,
}

/// One sweep of the window.
#[derive(Clone, Copy, Debug)]
struct Key {
    ds_m: f64,
    dtheta_rad: f64,
    path_m: f64,
    returns: usize,
}

/// One return: its sensor, how the configured robot had moved at its ping, and the range.
#[derive(Clone, Copy, Debug)]
struct Return {
    sensor: usize,
    moved: Pose2,
    range_m: f64,
}

impl Window {
    pub(super) fn new(params: &Params) -> Self {
        Self {
            keys: VecDeque::with_capacity(params.max_keys + 1),
            returns: VecDeque::with_capacity((params.max_keys + 1) * params.returns_per_key),
            ds_m: 0.0,
            dtheta_rad: 0.0,
            path_m: 0.0,
            next_sensor: 0,
            is_full: false,
            farthest_m: 0.0,
            whole_path_m: 0.0,
        }
    }

    /// True while the ranges may be in a wrong unit: then no geometry is right.
    fn is_unit_open(&self, params: &Params) -> bool {
        self.farthest_m < params.unit_range_m && self.whole_path_m < params.unit_path_m
    }

    /// The sweeps held.
    pub(super) fn len(&self) -> usize {
        self.keys.len()
    }

    /// How far apart the greatest and the least heading of the window are as the robot reports them, radians.
    pub(super) fn turned_rad(&self) -> f64 {
        let (mut heading_rad, mut least_rad, mut greatest_rad) = (0.0_f64, 0.0_f64, 0.0_f64);
        for key in &self.keys {
            heading_rad += key.dtheta_rad;
            (least_rad, greatest_rad) = (least_rad.min(heading_rad), greatest_rad.max(heading_rad));
        }
        greatest_rad - least_rad
    }

    pub(super) fn clear(&mut self) {
        self.keys.clear();
        self.returns.clear();
        (self.ds_m, self.dtheta_rad, self.path_m) = (0.0, 0.0, 0.0);
        self.is_full = false;
    }

    /// The returns held.
    pub(super) fn returns(&self) -> usize {
        self.returns.len()
    }

    /// True if it holds all that it can.
    pub(super) const fn is_full(&self) -> bool {
        self.is_full
    }

    /// Adds a sweep of the configured robot if it has moved since the last one. True if it was added and the window tells something.
    pub(super) fn add(
        &mut self,
        sweep: &Sweep,
        configured: &Ring,
        base_m: f64,
        is_trusted: impl Fn(usize) -> bool,
        params: &Params,
    ) -> bool {
        let (ds_m, dtheta_rad) = motion(sweep, base_m);
        (self.ds_m, self.dtheta_rad) = (self.ds_m + ds_m, self.dtheta_rad + dtheta_rad);
        let path_m = self.ds_m.abs() + params.rim_m * self.dtheta_rad.abs();
        if path_m < params.min_step_m {
            return false;
        }
        // The sensors take turns, so that a large ring costs no more than a small one.
        let (before, sensors) = (self.returns.len(), sweep.beams.len());
        for offset in 0..sensors {
            let sensor = (self.next_sensor + offset) % sensors;
            if self.returns.len() - before == params.returns_per_key {
                self.next_sensor = sensor;
                break;
            }
            let (Some(beam), Some(mounting)) = (sweep.beams.get(sensor), configured.mountings.get(sensor)) else {
                break;
            };
            if beam.has_range() && is_trusted(sensor) {
                self.farthest_m = self.farthest_m.max(beam.range_m);
                let moved = beam.robot_from_sensor * mounting.robot_from_sensor.inverse();
                self.returns.push_back(Return { sensor, moved, range_m: beam.range_m });
            }
        }
        let returns = self.returns.len() - before;
        self.keys.push_back(Key { ds_m: self.ds_m, dtheta_rad: self.dtheta_rad, path_m, returns });
        self.path_m += path_m;
        self.whole_path_m += path_m;
        (self.ds_m, self.dtheta_rad) = (0.0, 0.0);
        let is_long = |window: &Self| window.path_m > params.max_path_m && window.len() > params.min_keys;
        while self.len() > params.max_keys || is_long(self) {
            let Some(oldest) = self.keys.pop_front() else { break };
            self.is_full = true;
            self.path_m -= oldest.path_m;
            self.returns.drain(..oldest.returns);
        }
        !self.is_unit_open(params)
    }

    /// All returns as a robot lays them out, in the frame of its oldest pose and measured by the reported ranges: a smaller unit would
    /// make walls look sharper. `sensors` are that robot's, `heading_rad` is its first heading.
    pub(super) fn for_each_arc(
        &self,
        model: &RobotModel,
        sensors: &[Sensor],
        heading_rad: f64,
        mut each: impl FnMut(Arc),
    ) {
        let model = model.in_reported_ranges();
        let mut pose = Pose2::new(0.0, 0.0, heading_rad);
        let mut returns = self.returns.iter();
        for (index, key) in self.keys.iter().enumerate() {
            if index > 0 {
                pose = pose * model.moved(key.ds_m, key.dtheta_rad);
            }
            let (sin, cos) = libm::sincos(pose.theta_rad);
            for a_return in returns.by_ref().take(key.returns) {
                let Some(sensor) = sensors.get(a_return.sensor) else { continue };
                let moved = model.scaled(a_return.moved);
                let robot = compose((pose.x_m, pose.y_m), (cos, sin), (moved.x_m, moved.y_m));
                let heading = rotate((cos, sin), small_rotation(moved.theta_rad));
                let mounted = sensor.robot_from_sensor;
                let (x_m, y_m) = compose(robot, heading, (mounted.x_m, mounted.y_m));
                let theta_rad = pose.theta_rad + moved.theta_rad + mounted.theta_rad;
                each(Arc {
                    sensor: Pose2 { x_m, y_m, theta_rad },
                    axis: rotate(heading, sensor.axis),
                    opening: sensor.opening,
                    range_m: a_return.range_m,
                });
            }
        }
    }
}

/// A point of a frame with that origin and heading, given as cosine and sine.
fn compose(origin: (f64, f64), (cos, sin): (f64, f64), point: (f64, f64)) -> (f64, f64) {
    (origin.0 + cos * point.0 - sin * point.1, origin.1 + sin * point.0 + cos * point.1)
}

/// Cosine and sine of the sum of two angles.
fn rotate((cos, sin): (f64, f64), by: (f64, f64)) -> (f64, f64) {
    (cos * by.0 - sin * by.1, sin * by.0 + cos * by.1)
}

/// Cosine and sine of the rotation within a sweep by their series: below 0.001 off for a radian, and a search computes very many.
fn small_rotation(angle_rad: f64) -> (f64, f64) {
    let square = angle_rad * angle_rad;
    (1.0 - 0.5 * square * (1.0 - square / 12.0), angle_rad * (1.0 - square / 6.0 * (1.0 - square / 20.0)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sweep::Beam;

    fn sweep(ring: &Ring, step_m: f64) -> Sweep {
        let beam = |mounting: &crate::geometry::Mounting| Beam {
            range_m: 1.0,
            no_measurement: None,
            age_s: 0.0,
            robot_from_sensor: mounting.robot_from_sensor,
            half_angle_rad: 0.2,
        };
        Sweep { beams: ring.mountings.iter().map(beam).collect(), left_m: step_m, right_m: step_m, ..Sweep::default() }
    }

    #[test]
    fn a_window_holds_the_latest_metres_and_scales_them_by_the_model() {
        let (params, ring) = (Params::default(), Ring::circle(32, 0.1, 0.2, 1));
        let mut window = Window::new(&params);
        assert!(!window.add(&sweep(&ring, 0.0), &ring, 0.26, |_| true, &params), "a standing robot adds nothing");
        for _ in 0..1000 {
            window.add(&sweep(&ring, 0.02), &ring, 0.26, |_| true, &params);
        }
        assert!(window.len() <= params.max_keys && window.path_m <= params.max_path_m);
        let model = RobotModel { travel: 0.5, ..RobotModel::AS_CONFIGURED };
        let (mut farthest_m, mut sensors) = (0.0_f64, std::collections::BTreeSet::new());
        window.for_each_arc(&model, &Sensor::of(&ring), 0.0, |arc| {
            farthest_m = farthest_m.max(arc.sensor.x_m);
            sensors.insert(format!("{:.3}", arc.sensor.theta_rad));
        });
        assert!((farthest_m - 0.1 - 0.5 * 0.02 * (window.len() - 1) as f64).abs() < 0.02, "{farthest_m}");
        assert_eq!(sensors.len(), 32, "all sensors take their turn");
    }
}
