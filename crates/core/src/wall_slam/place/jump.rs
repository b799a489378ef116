//! Do most readings change at once although the wheels hardly move? Then the robot was lifted or carried. Do half of them change while the
//! wheels stand? Then it was pushed.

use super::params::Params;
use crate::geometry::Pose2;
use crate::sweep::Sweep;
use crate::time::Timestamp;

/// What hands did to the robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::wall_slam) enum Hands {
    /// Moved it a little: it stands near where the filter believes it is.
    Pushed,
    /// Carried it: it may be anywhere.
    Carried,
}

/// Compares the readings of two sweeps in a row.
#[derive(Clone, Debug)]
pub(in crate::wall_slam) struct JumpDetector {
    /// The range of each sensor in the last sweep, metres: infinite without an echo, none without a measurement.
    ranges_m: Vec<Option<f64>>,
    /// The same when the wheels came to rest.
    rest_m: Vec<Option<f64>>,
    /// Sweeps in a row in which the readings differ from those.
    shifted: u32,
    /// The last sweep before these.
    before: (u64, Timestamp),
    range_sigma_m: f64,
    params: Params,
}

impl JumpDetector {
    pub(in crate::wall_slam) fn new(sensors: usize, params: &Params) -> Self {
        let (ranges_m, rest_m) = (vec![None; sensors], vec![None; sensors]);
        Self { ranges_m, rest_m, shifted: 0, before: (0, Timestamp::default()), range_sigma_m: 0.0, params: *params }
    }

    /// The last sweep before hands moved the robot.
    pub(in crate::wall_slam) const fn before(&self) -> (u64, Timestamp) {
        self.before
    }

    /// Takes the noise of the readings, metres.
    pub(in crate::wall_slam) fn set_range_sigma(&mut self, range_sigma_m: f64) {
        self.range_sigma_m = range_sigma_m;
    }

    /// Adds a sweep after the robot moved by `step`, as its wheels say. Tells what hands did to it meanwhile, if the readings
    /// show any.
    pub(in crate::wall_slam) fn add(
        &mut self,
        sweep: &Sweep,
        step: Pose2,
        is_trusted: impl Fn(usize) -> bool,
    ) -> Option<Hands> {
        let params = self.params;
        let jump_m = params.jump_m.max(params.jump_sigmas * self.range_sigma_m);
        let (mut compared, mut changed) = (0usize, 0usize);
        for (sensor, (beam, before)) in sweep.beams.iter().zip(&mut self.ranges_m).enumerate() {
            let is_read = is_trusted(sensor) && (beam.has_range() || beam.is_clear());
            let now = is_read.then_some(beam.range_m);
            let (Some(old_m), Some(new_m)) = (std::mem::replace(before, now), now) else { continue };
            let nearer_m = old_m.min(new_m);
            if nearer_m.is_finite() {
                compared += 1;
                let farther_m = old_m.max(new_m);
                let is_lost = farther_m.is_infinite() && nearer_m < params.jump_heard_m;
                let is_far = farther_m.is_finite() && farther_m - nearer_m > jump_m;
                changed += usize::from(is_lost || is_far);
            }
        }
        let (way_m, turn_rad) = (step.position().coords.norm(), step.theta_rad.abs());
        let has_jumped = |beams: usize, share: f64| changed >= beams && changed as f64 >= share * compared as f64;
        let is_slow = way_m < params.jump_way_m && turn_rad < params.jump_turn_rad;
        let is_still = way_m < params.still_m && turn_rad < params.still_rad;
        if !is_still {
            self.rest_m.clone_from(&self.ranges_m);
            self.shifted = 0;
        }
        if self.shifted == 0 {
            self.before = (sweep.index, sweep.at);
        }
        let shifted = if is_still { self.shifted() } else { None };
        let is_carried = (is_still && has_jumped(params.still_beams, params.still_share))
            || (is_slow && has_jumped(params.jump_beams, params.jump_share));
        if is_carried { Some(Hands::Carried) } else { shifted }
    }

    /// Once the readings have differed for some sweeps from those at the beginning of the rest: by how much.
    fn shifted(&mut self) -> Option<Hands> {
        let params = &self.params;
        let shift_m = params.shift_m.max(params.shift_sigmas * self.range_sigma_m);
        let (mut compared, mut changed, mut far) = (0usize, 0usize, 0usize);
        for (before, now) in self.rest_m.iter().zip(&self.ranges_m) {
            let (Some(before_m), Some(now_m)) = (before, now) else { continue };
            let apart_m = (before_m - now_m).abs();
            compared += usize::from(apart_m.is_finite());
            changed += usize::from(apart_m.is_finite() && apart_m > shift_m);
            far += usize::from(apart_m.is_finite() && apart_m > params.search.near_m);
        }
        let is_shifted = changed >= params.shift_beams && changed as f64 >= params.shift_share * compared as f64;
        self.shifted = if is_shifted { self.shifted + 1 } else { 0 };
        if self.shifted < params.shift_sweeps {
            return None;
        }
        self.rest_m.clone_from(&self.ranges_m);
        self.shifted = 0;
        Some(if 2 * far > changed { Hands::Carried } else { Hands::Pushed })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sweep::Beam;

    fn sweep(ranges_m: [f64; 8]) -> Sweep {
        let beam = |range_m| Beam {
            range_m,
            no_measurement: None,
            age_s: 0.0,
            robot_from_sensor: Pose2::default(),
            half_angle_rad: 0.2,
        };
        let beams = ranges_m.map(beam);
        Sweep { beams: beams.to_vec(), ..Sweep::default() }
    }

    /// Whether the second sweep is a jump from the first, after so much way.
    fn jumps(from: [f64; 8], to: [f64; 8], way_m: f64) -> bool {
        let mut detector = JumpDetector::new(8, &Params::default());
        assert_eq!(detector.add(&sweep(from), Pose2::default(), |_| true), None);
        detector.add(&sweep(to), Pose2::new(way_m, 0.0, 0.0), |_| true) == Some(Hands::Carried)
    }

    const HERE: [f64; 8] = [1.0, 1.1, 1.2, f64::INFINITY, 2.5, 0.7, 0.8, 2.0];

    #[test]
    fn a_carried_robot_jumps() {
        let there = [2.0, 0.4, f64::INFINITY, f64::INFINITY, 1.0, 1.3, 0.8, 0.9];
        assert!(jumps(HERE, there, 0.0) && jumps(HERE, there, 0.03));
        assert!(!jumps(HERE, there, 0.2), "who drives fast hears something else");
    }

    #[test]
    fn a_robot_that_is_pushed_aside_while_it_stands_is_noticed() {
        let pushed = |way_m: f64| {
            let mut detector = JumpDetector::new(8, &Params::default());
            detector.add(&sweep(HERE), Pose2::new(0.03, 0.0, 0.0), |_| true);
            let aside = |by_m: f64| [1.0, 1.1 + by_m, 1.2 + by_m, f64::INFINITY, 2.5, 0.7 - by_m, 0.8 - by_m, 2.0];
            (1..=8).any(|step| {
                let by_m = 0.05 * f64::from(step).min(5.0);
                detector.add(&sweep(aside(by_m)), Pose2::new(way_m, 0.0, 0.0), |_| true) == Some(Hands::Pushed)
            })
        };
        assert!(pushed(0.0) && !pushed(0.02));
    }

    #[test]
    fn a_person_and_an_echo_that_fails_are_no_jump() {
        let mut there = HERE;
        (there[0], there[1], there[4]) = (0.5, 0.6, f64::INFINITY);
        assert!(!jumps(HERE, there, 0.0) && !jumps(HERE, HERE, 0.0));
        let untrusted = JumpDetector::new(8, &Params::default()).add(&sweep(HERE), Pose2::default(), |_| false);
        assert_eq!(untrusted, None);
    }
}
