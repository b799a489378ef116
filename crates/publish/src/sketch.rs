//! What the picture shows of a run's poses, gathered as they come; it can be drawn at any time.

use super::picture::{self, Scene, Stretch};
use super::track::Track;
use slamd_core::{Estimate, LocalizationEvent, Point, Pose2, Raster, Ring, SensorState, Timestamp};
use std::io;

/// The path so far, in bounded memory.
#[derive(Clone, Debug, Default)]
pub struct Sketch {
    path: Track,
    odometry: Track,
    map_from_odom: Option<Pose2>,
    pose: Pose2,
    /// The intervals whose poses were uncertain, in order.
    uncertain: Vec<(Timestamp, Timestamp)>,
    /// Since when poses are uncertain, while they are.
    uncertain_since: Option<Timestamp>,
}

/// More intervals count as one with the last.
const MAX_INTERVALS: usize = 1_000;

/// What else is in the picture.
#[derive(Clone, Copy)]
pub struct Surroundings<'a> {
    /// The map.
    pub raster: &'a Raster,
    /// Where the sensors sit.
    pub ring: &'a Ring,
    /// The sensors' states, by id.
    pub states: &'a [SensorState],
    /// The robot's name.
    pub robot_name: &'a str,
    /// What is doubtful, one sentence each; they stand below the legend.
    pub doubts: &'a [String],
}

impl Sketch {
    /// The robot's newest pose.
    pub fn estimate(&mut self, estimate: &Estimate) {
        let map_from_odom = *self.map_from_odom.get_or_insert_with(|| estimate.pose * estimate.odometry.inverse());
        self.path.push(estimate.at, estimate.pose.position());
        self.odometry.push(estimate.at, (map_from_odom * estimate.odometry).position());
        self.pose = estimate.pose;
    }

    /// Forgets the path in a discarded map; poses that are uncertain now are so from here on.
    pub(super) fn begin_anew(&mut self, at: Timestamp) {
        let uncertain_since = self.uncertain_since.map(|_| at);
        *self = Self { uncertain_since, ..Self::default() };
    }

    /// The pose became uncertain, from an earlier instant on, or known again.
    pub fn localization(&mut self, event: &LocalizationEvent) {
        self.set_uncertain(event.is_lost(), if event.is_lost() { event.since } else { event.at });
    }

    /// Poses from `at` on are uncertain, or known again. The path is dashed where they are uncertain.
    pub fn set_uncertain(&mut self, is_uncertain: bool, at: Timestamp) {
        if is_uncertain {
            self.uncertain_since.get_or_insert(at);
        } else if let Some(since) = self.uncertain_since.take() {
            let is_full = self.uncertain.len() >= MAX_INTERVALS;
            match self.uncertain.last_mut() {
                Some((_, end)) if is_full => *end = at,
                _ => self.uncertain.push((since, at)),
            }
        }
    }

    /// The length of the whole path, metres.
    pub(super) const fn path_m(&self) -> f64 {
        self.path.length_m()
    }

    /// The time of the newest pose.
    pub(super) fn last_at(&self) -> Option<Timestamp> {
        self.path.last_at()
    }

    /// The picture as a PNG file, like `map.png`.
    ///
    /// # Errors
    /// Where the picture is too large for the format.
    pub fn draw(&self, around: Surroundings<'_>) -> io::Result<Vec<u8>> {
        self.draw_with_truth(around, &[], None)
    }

    /// The same with the true path in the map frame, and how far off ours is, metres; empty and none where it is unknown.
    pub(super) fn draw_with_truth(
        &self,
        around: Surroundings<'_>,
        truth: &[Point],
        ate_m: Option<f64>,
    ) -> io::Result<Vec<u8>> {
        picture::draw(&self.scene(around, &self.stretches(), &self.odometry.points(), truth, ate_m))
    }

    /// A picture without a map, with the reason in words.
    pub(super) fn draw_reason(&self, around: Surroundings<'_>, reason: &str) -> io::Result<Vec<u8>> {
        picture::draw_reason(&self.scene(around, &[], &[], &[], None), reason)
    }

    fn scene<'a>(
        &self,
        around: Surroundings<'a>,
        path: &'a [Stretch],
        odometry: &'a [Point],
        truth: &'a [Point],
        ate_m: Option<f64>,
    ) -> Scene<'a> {
        Scene {
            raster: around.raster,
            path,
            path_m: self.path_m(),
            odometry,
            truth,
            ate_m,
            pose: self.pose,
            ring: around.ring,
            states: around.states,
            robot_name: around.robot_name,
            doubts: around.doubts,
        }
    }

    /// The path, cut where it becomes uncertain or certain. Neighbours share a point; the step between them is uncertain.
    fn stretches(&self) -> Vec<Stretch> {
        let mut stretches: Vec<Stretch> = Vec::new();
        let mut intervals = self.uncertain.iter().copied();
        let open = self.uncertain_since.map(|since| (since, Timestamp::from_us(u64::MAX)));
        let mut interval = intervals.next().or(open);
        for (at, point) in self.path.timed() {
            while interval.is_some_and(|(_, end)| end <= at) {
                interval = intervals.next().or(open);
            }
            let is_uncertain = interval.is_some_and(|(since, _)| since <= at);
            match stretches.last_mut() {
                Some(last) if last.is_uncertain == is_uncertain => last.points.push(point),
                Some(last) if last.is_uncertain => {
                    last.points.push(point);
                    stretches.push(Stretch { is_uncertain, points: vec![point] });
                }
                Some(last) => {
                    let joint = last.points.last().copied();
                    stretches.push(Stretch { is_uncertain, points: joint.into_iter().chain([point]).collect() });
                }
                None => stretches.push(Stretch { is_uncertain, points: vec![point] }),
            }
        }
        stretches
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;
    use slamd_core::LocalizationChange;

    #[test]
    fn the_path_is_cut_where_it_is_uncertain() {
        let at = |s: u64| Timestamp::from_us(1_000_000 * s);
        let mut sketch = Sketch::default();
        for s in 0..10u32 {
            let pose = Pose2::new(f64::from(s), 0.0, 0.0);
            let (sweep, covariance) = (u64::from(s), Matrix3::zeros());
            sketch.estimate(&Estimate { at: at(sweep), sweep, pose, covariance, odometry: pose, nis: 1.0 });
            if s == 4 {
                let change = LocalizationChange::Lost;
                sketch.localization(&LocalizationEvent { at: at(4), since: at(3), change });
            } else if s == 6 {
                let change = LocalizationChange::Regained { moved_m: 1.0, turned_rad: 0.0 };
                sketch.localization(&LocalizationEvent { at: at(6), since: at(3), change });
            } else if s == 8 {
                sketch.localization(&LocalizationEvent { at: at(8), since: at(8), change: LocalizationChange::Lost });
            }
        }
        let cut: Vec<(bool, f64, f64)> = sketch
            .stretches()
            .iter()
            .map(|stretch| (stretch.is_uncertain, stretch.points[0].x, stretch.points[stretch.points.len() - 1].x))
            .collect();
        assert_eq!(cut, [(false, 0.0, 2.0), (true, 2.0, 6.0), (false, 6.0, 7.0), (true, 7.0, 9.0)]);
    }
}
