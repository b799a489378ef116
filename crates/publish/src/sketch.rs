//! What the picture shows of a run's poses, gathered as they come; it can be drawn at any time.

use super::picture::{self, Scene};
use super::track::Track;
use slamd_core::{Estimate, Point, Pose2, Raster, Ring, SensorState};
use std::io;

/// The path so far, in bounded memory.
#[derive(Clone, Debug, Default)]
pub struct Sketch {
    path: Track,
    odometry: Track,
    map_from_odom: Option<Pose2>,
    pose: Pose2,
}

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
}

impl Sketch {
    /// The robot's newest pose.
    pub fn estimate(&mut self, estimate: &Estimate) {
        let map_from_odom = *self.map_from_odom.get_or_insert_with(|| estimate.pose * estimate.odometry.inverse());
        self.path.push(estimate.pose.position());
        self.odometry.push((map_from_odom * estimate.odometry).position());
        self.pose = estimate.pose;
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
        picture::draw(&Scene {
            raster: around.raster,
            path: &self.path.points(),
            path_m: self.path.length_m(),
            odometry: &self.odometry.points(),
            truth,
            ate_m,
            pose: self.pose,
            ring: around.ring,
            states: around.states,
            robot_name: around.robot_name,
        })
    }
}
