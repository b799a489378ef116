//! Walls out of the filter: it holds only so many, and the building may have any number.
//!
//! A wall far from the robot leaves the filter with its offset and variance; its correlations are dropped. It returns uncorrelated
//! when the robot comes near. The distances differ so that a wall does not go in and out.

use super::ekf_slam::{EkfSlam, WallLandmark};
use super::filter::MAX_WALLS;
use super::params::InactiveParams;
use crate::geometry::{Point, Pose2};
use nalgebra::SVector;

/// A wall out of the filter, with its last offset and variance.
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
    /// Indices of the walls that the robot may come near to within `lookahead_m`, and the position that they were searched from.
    nearby: Vec<usize>,
    searched_from: Option<Point>,
    params: InactiveParams,
}

impl InactiveLandmarks {
    /// These walls.
    pub(super) fn new(params: InactiveParams, walls: Vec<InactiveLandmark>) -> Self {
        Self { walls, params, ..Self::default() }
    }

    /// All of them.
    pub(super) fn iter(&self) -> impl Iterator<Item = &InactiveLandmark> {
        self.walls.iter()
    }

    /// Sets their variances to zero.
    pub(super) fn freeze(&mut self) {
        self.walls.iter_mut().for_each(|inactive| inactive.variance = 0.0);
    }

    fn add(&mut self, inactive: InactiveLandmark) {
        self.nearby.push(self.walls.len());
        self.walls.push(inactive);
    }

    /// Takes out a wall that the robot has come near to.
    fn take_near(&mut self, pose: Pose2) -> Option<InactiveLandmark> {
        let InactiveParams { reactivate_m, lookahead_m, .. } = self.params;
        let is_far = |from: Point| (pose.position() - from).norm() > lookahead_m;
        if self.searched_from.is_none_or(is_far) {
            let within = |inactive: &InactiveLandmark| inactive.distance_m(pose) < reactivate_m + lookahead_m;
            let nearby = self.walls.iter().enumerate().filter(|(_, inactive)| within(inactive));
            self.nearby.clear();
            self.nearby.extend(nearby.map(|(index, _)| index));
            self.searched_from = Some(pose.position());
        }
        let index = *self.nearby.iter().find(|&&index| self.walls[index].distance_m(pose) < reactivate_m)?;
        self.searched_from = None;
        Some(self.walls.swap_remove(index))
    }
}

impl InactiveLandmark {
    fn distance_m(&self, pose: Pose2) -> f64 {
        self.wall.distance_m(self.offset_m, pose)
    }
}

impl EkfSlam {
    /// Keeps slots free in the filter: far walls leave it, and return when the robot does.
    pub(super) fn swap_landmarks(&mut self) {
        let pose = self.filter.pose();
        let InactiveParams { spare, deactivate_m, .. } = self.params.inactive;
        if self.walls.len() < MAX_WALLS - spare
            && let Some(inactive) = self.inactive.take_near(pose)
            && self.filter.add(inactive.offset_m, &SVector::zeros(), inactive.variance).is_some()
        {
            self.walls.push(inactive.wall);
        }
        if self.walls.len() <= MAX_WALLS - spare {
            return;
        }
        let distance_m = |index: usize| self.walls[index].distance_m(self.filter.offset_m(index), pose);
        let farthest = (0..self.walls.len()).max_by(|&a, &b| distance_m(a).total_cmp(&distance_m(b)));
        if let Some(index) = farthest.filter(|&index| distance_m(index) > deactivate_m) {
            let offset_m = self.filter.offset_m(index);
            let variance = self.filter.wall_variance(index);
            self.filter.remove(index);
            self.inactive.add(InactiveLandmark { wall: self.walls.swap_remove(index), offset_m, variance });
        }
    }
}

impl WallLandmark {
    /// Distance from the robot to the nearest observed part of the wall, metres.
    fn distance_m(&self, offset_m: f64, pose: Pose2) -> f64 {
        let (across_m, along_m) = self.side.split(pose.position());
        let beyond_m = (self.lo_m - along_m).max(along_m - self.hi_m).max(0.0);
        ((offset_m - across_m).powi(2) + beyond_m.powi(2)).sqrt()
    }
}
