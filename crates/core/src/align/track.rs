//! Wheel odometry: the robot's pose from the encoders alone at any instant of the last seconds.
//!
//! Encoder counts arrive with each `SONAR` group (latched at its trigger) and each `ENCODER` message, not always in the order of
//! their stamps. Between two samples the pose lies on the arc that the wheels rolled.

use super::params::Params;
use super::trouble::WheelTrouble;
use super::wheel_steps::WheelSteps;
use crate::geometry::Pose2;
use crate::time::DeviceTime;
use std::collections::VecDeque;

/// Metres of travel per encoder tick, and the wheel base.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wheels {
    /// Metres the left and the right wheel roll per tick.
    pub metres_per_tick: [f64; 2],
    /// Metres between the wheels.
    pub base_m: f64,
}

/// Travel of both wheels since the track began, metres.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Travel {
    /// Left wheel.
    pub left_m: f64,
    /// Right wheel.
    pub right_m: f64,
}

#[derive(Clone, Copy, Debug)]
struct Sample {
    at: DeviceTime,
    travel: Travel,
    pose: Pose2,
}

/// The last encoder samples, in order of time.
#[derive(Clone, Debug)]
pub(crate) struct Track {
    samples: VecDeque<Sample>,
    steps: WheelSteps,
    params: Params,
}

impl Track {
    /// A track without samples, of a robot whose highest speed is `max_speed_m_s`.
    #[must_use]
    pub(crate) fn new(max_speed_m_s: f64, params: Params) -> Self {
        Self { samples: VecDeque::new(), steps: WheelSteps::new(max_speed_m_s, params), params }
    }

    /// Adds absolute encoder counts latched at `at`. Counts older than every kept sample are ignored.
    pub(crate) fn add(&mut self, at: DeviceTime, left_ticks: i32, right_ticks: i32, wheels: Wheels) {
        let [left, right] = self.steps.add(at, [left_ticks, right_ticks], wheels.metres_per_tick);
        let travel = Travel {
            left_m: left as f64 * wheels.metres_per_tick[0],
            right_m: right as f64 * wheels.metres_per_tick[1],
        };
        let index = self.samples.partition_point(|sample| sample.at <= at);
        let mut before = index.checked_sub(1).and_then(|before| self.samples.get(before)).copied();
        if before.is_none() && !self.samples.is_empty() {
            return;
        }
        self.samples.insert(index, Sample { at, travel, pose: Pose2::default() });
        for sample in self.samples.iter_mut().skip(index) {
            if let Some(before) = before {
                sample.pose = before.rolled_to(sample.travel, wheels);
            }
            before = Some(*sample);
        }
        if self.samples.len() > self.params.track_samples {
            self.samples.pop_front();
        }
    }

    /// Pose in the odom frame and travel at an instant; none before the first sample.
    #[must_use]
    pub(crate) fn at(&self, at: DeviceTime, wheels: Wheels) -> Option<(Pose2, Travel)> {
        let after = self.samples.partition_point(|sample| sample.at <= at);
        let up_to = |last: usize| Some((self.samples.get(last.checked_sub(1)?)?, self.samples.get(last)?));
        // After the newest sample the last two give the velocity.
        let Some((a, b)) = up_to(after).or_else(|| up_to(after.checked_sub(1)?)) else {
            return self.samples.front().map(|first| (first.pose, first.travel));
        };
        let span_s = b.at.seconds_since(a.at);
        if span_s <= 0.0 {
            return Some((b.pose, b.travel));
        }
        let part = (at.seconds_since(a.at) / span_s).min(1.0 + self.params.extrapolate_s / span_s);
        let travel = Travel {
            left_m: a.travel.left_m + part * (b.travel.left_m - a.travel.left_m),
            right_m: a.travel.right_m + part * (b.travel.right_m - a.travel.right_m),
        };
        Some((a.rolled_to(travel, wheels), travel))
    }

    /// Flips the sign of one encoder's counts from now on; 0 is the left one.
    pub(crate) fn reverse(&mut self, wheel: usize) {
        self.steps.reverse(wheel);
    }

    /// What was wrong with the counts.
    pub(crate) fn take_trouble(&mut self) -> Option<WheelTrouble> {
        self.steps.take_trouble()
    }

    /// Steps across a wrap at 16 bits, and steps that were not rolled.
    #[must_use]
    pub(crate) fn step_counts(&self) -> (u64, u64) {
        self.steps.counts()
    }

    /// The board restarted with unknown counts: the track continues from the newest pose.
    pub(crate) fn restart(&mut self) {
        if let Some(mut newest) = self.samples.pop_back() {
            newest.at = DeviceTime::default();
            self.samples.clear();
            self.samples.push_back(newest);
        }
        self.steps.restart();
    }
}

impl Sample {
    fn rolled_to(&self, travel: Travel, wheels: Wheels) -> Pose2 {
        self.pose.rolled(travel.left_m - self.travel.left_m, travel.right_m - self.travel.right_m, wheels.base_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHEELS: Wheels = Wheels { metres_per_tick: [0.001; 2], base_m: 0.3 };

    fn track() -> Track {
        Track::new(0.6, Params::default())
    }

    #[test]
    fn between_samples_lies_on_the_arc() {
        let mut track = track();
        track.add(DeviceTime::from_us(0), 100, 100, WHEELS);
        track.add(DeviceTime::from_us(100_000), 140, 160, WHEELS);
        let (pose, travel) = track.at(DeviceTime::from_us(50_000), WHEELS).unwrap();
        assert_eq!(pose, Pose2::default().rolled(0.02, 0.03, 0.3));
        assert!((travel.right_m - 0.03).abs() < 1e-12);
    }

    #[test]
    fn order_of_arrival_does_not_matter() {
        let samples = [(0, 0, 0), (20_000, 5, 9), (40_000, 12, 14), (60_000, 20, 30)];
        let mut in_order = track();
        let mut late = track();
        samples.iter().for_each(|&(t, l, r)| in_order.add(DeviceTime::from_us(t), l, r, WHEELS));
        [0, 2, 1, 3].iter().map(|&i| samples[i]).for_each(|(t, l, r)| late.add(DeviceTime::from_us(t), l, r, WHEELS));
        let end = DeviceTime::from_us(60_000);
        assert_eq!(in_order.at(end, WHEELS), late.at(end, WHEELS));
    }

    #[test]
    fn a_reversed_encoder_goes_on_from_where_it_was() {
        let mut track = track();
        let at = |ms: u64| DeviceTime::from_us(1_000 * ms);
        for (ms, left, right) in [(0, 0, 0), (20, 10, -10)] {
            track.add(at(ms), left, right, WHEELS);
        }
        track.reverse(1);
        track.add(at(40), 20, -20, WHEELS);
        let (_, travel) = track.at(at(40), WHEELS).unwrap();
        assert!((travel.left_m - 0.02).abs() < 1e-12 && travel.right_m.abs() < 1e-12, "{travel:?}");
    }

    #[test]
    fn counters_wrap_and_restart_without_a_jump() {
        let mut track = track();
        track.add(DeviceTime::from_us(1_000), i32::MAX, i32::MAX, WHEELS);
        track.add(DeviceTime::from_us(2_000), i32::MIN + 9, i32::MIN + 9, WHEELS);
        let (before, _) = track.at(DeviceTime::from_us(2_000), WHEELS).unwrap();
        assert!((before.x_m - 0.01).abs() < 1e-12);
        track.restart();
        track.add(DeviceTime::from_us(500), 77, 77, WHEELS);
        let (after, _) = track.at(DeviceTime::from_us(500), WHEELS).unwrap();
        assert_eq!(before, after);
    }
}
