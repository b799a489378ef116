//! Walls out of the filter's observe_wall: it holds only so many, and the building may have any number.

use super::ekf_slam::{EkfSlam, WallLandmark};
use super::filter::MAX_WALLS;
use crate::geometry::{Point, Pose2};
use nalgebra::SVector;

/// A wall out of the filter's observe_wall, with its offset and variance as they were.
#[derive(Clone, Copy, Debug)]
pub(super) struct InactiveLandmark {
    pub(super) wall: WallLandmark,
    pub(super) offset_m: f64,
    pub(super) variance: f64,
}

/// All of them.
#[derive(Clone, Debug, Default)]
pub(super) struct InactiveLandmarks {
    walls: Vec<InactiveLandmark>,
    /// Those that may come into observe_wall within the next metre, by their place above, and from where that was seen.
    coming: Vec<usize>,
    seen_from: Option<Point>,
}

/// Walls farther than this leave the filter when it is full, and come back when nearer.
const DEACTIVATE_M: f64 = 6.0;
const REACTIVATE_M: f64 = 4.5;
/// All walls are looked at once per so many metres only: there may be thousands.
const AHEAD_M: f64 = 1.0;
/// Walls that many places must stay free for.
const SPARE: usize = 12;

impl InactiveLandmarks {
    /// A inactive with these walls.
    pub(super) fn with(walls: Vec<InactiveLandmark>) -> Self {
        Self { walls, ..Self::default() }
    }

    /// The walls in it.
    pub(super) fn iter(&self) -> impl Iterator<Item = &InactiveLandmark> {
        self.walls.iter()
    }

    /// Takes them as they are.
    pub(super) fn freeze(&mut self) {
        self.walls.iter_mut().for_each(|inactive| inactive.variance = 0.0);
    }

    fn add(&mut self, inactive: InactiveLandmark) {
        self.coming.push(self.walls.len());
        self.walls.push(inactive);
    }

    /// Takes a wall out that the robot has come near to.
    fn take_near(&mut self, pose: Pose2) -> Option<InactiveLandmark> {
        let is_far = |from: Point| (pose.position() - from).norm() > AHEAD_M;
        if self.seen_from.is_none_or(is_far) {
            let within = |inactive: &InactiveLandmark| inactive.distance_m(pose) < REACTIVATE_M + AHEAD_M;
            let coming = self.walls.iter().enumerate().filter(|(_, inactive)| within(inactive));
            self.coming.clear();
            self.coming.extend(coming.map(|(index, _)| index));
            self.seen_from = Some(pose.position());
        }
        let index = *self.coming.iter().find(|&&index| self.walls[index].distance_m(pose) < REACTIVATE_M)?;
        self.seen_from = None;
        Some(self.walls.swap_remove(index))
    }
}

impl InactiveLandmark {
    fn distance_m(&self, pose: Pose2) -> f64 {
        self.wall.distance_m(self.offset_m, pose)
    }
}

impl EkfSlam {
    /// Keeps places free in the filter: far walls leave it, and come back when the robot does.
    pub(super) fn swap_landmarks(&mut self) {
        let pose = self.filter.pose();
        if self.walls.len() < MAX_WALLS - SPARE
            && let Some(inactive) = self.inactive.take_near(pose)
            && self.filter.add(inactive.offset_m, &SVector::zeros(), inactive.variance).is_some()
        {
            self.walls.push(inactive.wall);
        }
        if self.walls.len() <= MAX_WALLS - SPARE {
            return;
        }
        let distance_m = |index: usize| self.walls[index].distance_m(self.filter.offset_m(index), pose);
        let farthest = (0..self.walls.len()).max_by(|&a, &b| distance_m(a).total_cmp(&distance_m(b)));
        if let Some(index) = farthest.filter(|&index| distance_m(index) > DEACTIVATE_M) {
            let offset_m = self.filter.offset_m(index);
            let variance = self.filter.wall_variance(index);
            self.filter.remove(index);
            self.inactive.add(InactiveLandmark { wall: self.walls.swap_remove(index), offset_m, variance });
        }
    }
}

impl WallLandmark {
    /// Distance from the robot to the nearest seen part of the wall, metres.
    fn distance_m(&self, offset_m: f64, pose: Pose2) -> f64 {
        let (across_m, along_m) = self.side.split(pose.position());
        let beyond_m = (self.lo_m - along_m).max(along_m - self.hi_m).max(0.0);
        ((offset_m - across_m).powi(2) + beyond_m.powi(2)).sqrt()
    }
}
