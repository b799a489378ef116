//! What the explorer remembers: where it has been, where something stood in the way, which frontiers it has done with.

use super::params::Params;
use slamd_core::{Point, Pose2, Timestamp};

/// A frontier that could not be reached.
#[derive(Clone, Copy, Debug)]
struct Failure {
    at: Point,
    tries: u32,
    last: Timestamp,
}

/// What the explorer remembers.
#[derive(Clone, Debug, Default)]
pub(crate) struct Memory {
    /// Where the robot's middle has been, every few centimetres.
    pub(crate) trail: Vec<Point>,
    /// The way since the start, metres.
    pub(crate) way_m: f64,
    /// Where something stood in the way, and until when that counts.
    blocks: Vec<(Point, Timestamp)>,
    /// Frontiers that stayed although the robot looked at them from near.
    looked: Vec<Point>,
    failures: Vec<Failure>,
}

/// Way between two points of the trail, metres.
const TRAIL_M: f64 = 0.08;

impl Memory {
    pub(crate) fn been(&mut self, pose: Pose2) {
        let here = pose.position();
        let way_m = self.trail.last().map_or(f64::INFINITY, |last| (here - last).norm());
        if way_m > TRAIL_M {
            self.way_m += if way_m.is_finite() { way_m } else { 0.0 };
            self.trail.push(here);
        }
    }

    pub(crate) fn block(&mut self, at: Point, until: Timestamp) {
        self.blocks.push((at, until));
    }

    /// The blocks that still count.
    pub(crate) fn blocks(&mut self, now: Timestamp) -> Vec<Point> {
        self.blocks.retain(|(_, until)| *until > now);
        self.blocks.iter().map(|(at, _)| *at).collect()
    }

    pub(crate) fn looked(&mut self, frontier: Point) {
        self.looked.push(frontier);
    }

    /// A try to reach a frontier failed.
    pub(crate) fn failed(&mut self, frontier: Point, now: Timestamp, params: &Params) {
        match self.failures.iter_mut().find(|known| (known.at - frontier).norm() < params.looked_m) {
            Some(known) => (known.tries, known.last) = (known.tries + 1, now),
            None => self.failures.push(Failure { at: frontier, tries: 1, last: now }),
        }
    }

    /// The robot shall go there now.
    pub(crate) fn wants(&self, frontier: Point, now: Timestamp, params: &Params) -> bool {
        let near = |point: Point| (point - frontier).norm() < params.looked_m;
        let is_failing = |known: &Failure| {
            near(known.at) && (known.tries >= params.max_tries || now.seconds_since(known.last) < params.retry_s)
        };
        !self.looked.iter().copied().any(near) && !self.failures.iter().any(is_failing)
    }

    /// The robot shall go there later: something was in the way.
    pub(crate) fn wants_later(&self, frontier: Point, params: &Params) -> bool {
        let near = |point: Point| (point - frontier).norm() < params.looked_m;
        let is_over = |known: &Failure| near(known.at) && known.tries >= params.max_tries;
        let is_failing = self.failures.iter().any(|known| near(known.at));
        is_failing && !self.looked.iter().copied().any(near) && !self.failures.iter().any(is_over)
    }

    /// It was given up.
    pub(crate) fn is_given_up(&self, frontier: Point, params: &Params) -> bool {
        let near = |known: &&Failure| (known.at - frontier).norm() < params.looked_m;
        self.failures.iter().filter(near).any(|known| known.tries >= params.max_tries)
    }
}
