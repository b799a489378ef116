//! Pairs estimates with true poses of the same instant, from two streams in the order of time.
//!
//! The truth is interpolated to the estimate's time. Estimates before the first truth are left out.

use slamd_core::{Pose2, Timestamp, wrap_angle};
use std::collections::VecDeque;

/// An estimate and the true pose at its time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair<T> {
    /// The estimate's time.
    pub at: Timestamp,
    /// The estimate.
    pub estimate: T,
    /// The true pose, `world_from_robot`.
    pub truth: Pose2,
}

/// Pairs estimates of any kind with true poses, in bounded memory.
#[derive(Clone, Debug)]
pub struct Pairing<T> {
    truth: VecDeque<(Timestamp, Pose2)>,
    /// Estimates that wait for a later truth.
    waiting: VecDeque<(Timestamp, T)>,
}

impl<T> Default for Pairing<T> {
    fn default() -> Self {
        Self { truth: VecDeque::new(), waiting: VecDeque::new() }
    }
}

impl<T> Pairing<T> {
    /// Adds an estimate.
    pub fn estimate(&mut self, at: Timestamp, estimate: T) {
        push_bounded(&mut self.waiting, (at, estimate));
    }

    /// Adds a true pose, `world_from_robot`.
    pub fn truth(&mut self, at: Timestamp, pose: Pose2) {
        push_bounded(&mut self.truth, (at, pose));
    }

    /// The next estimate whose true pose is known. Call it until `None` after each input.
    pub fn next_pair(&mut self) -> Option<Pair<T>> {
        loop {
            let (&(at, _), &(latest, _)) = (self.waiting.front()?, self.truth.back()?);
            if at > latest {
                return None;
            }
            let (at, estimate) = self.waiting.pop_front()?;
            while self.truth.get(1).is_some_and(|&(next, _)| next <= at) {
                self.truth.pop_front();
            }
            if let Some(before) = self.truth.front().filter(|(earlier, _)| *earlier <= at).copied() {
                let after = self.truth.get(1).copied().unwrap_or(before);
                return Some(Pair { at, estimate, truth: between(before, after, at) });
            }
        }
    }
}

fn push_bounded<T>(queue: &mut VecDeque<T>, item: T) {
    if queue.len() == MAX_QUEUE {
        queue.pop_front();
    }
    queue.push_back(item);
}

fn between((t0, a): (Timestamp, Pose2), (t1, b): (Timestamp, Pose2), at: Timestamp) -> Pose2 {
    let span_s = t1.seconds_since(t0);
    let part = if span_s > 0.0 { at.seconds_since(t0) / span_s } else { 0.0 };
    let turn = wrap_angle(b.theta_rad - a.theta_rad);
    Pose2::new(a.x_m + part * (b.x_m - a.x_m), a.y_m + part * (b.y_m - a.y_m), a.theta_rad + part * turn)
}

/// Maximum number of poses kept while one stream is ahead: 40 s of truth at 100 Hz.
const MAX_QUEUE: usize = 4096;

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(ms: u64) -> Timestamp {
        Timestamp::from_us(ms * 1000)
    }

    #[test]
    fn the_truth_is_interpolated_and_earlier_estimates_are_left_out() {
        let mut pairing = Pairing::default();
        for (at, name) in [(5, "early"), (15, "between"), (20, "on"), (21, "late")] {
            pairing.estimate(ms(at), name);
        }
        pairing.truth(ms(10), Pose2::new(1.0, 0.0, 0.0));
        assert_eq!(pairing.next_pair(), None);
        pairing.truth(ms(20), Pose2::new(3.0, 0.0, 0.0));
        let pairs: Vec<_> = std::iter::from_fn(|| pairing.next_pair()).map(|p| (p.estimate, p.truth.x_m)).collect();
        assert_eq!(pairs, [("between", 2.0), ("on", 3.0)]);
    }

    #[test]
    fn headings_are_interpolated_across_half_a_turn() {
        let middle = between((ms(0), Pose2::new(0.0, 0.0, 3.1)), (ms(2), Pose2::new(2.0, 0.0, -3.1)), ms(1));
        assert!(middle.theta_rad.abs() > 3.1 && (middle.x_m - 1.0).abs() < 1e-12);
    }
}
