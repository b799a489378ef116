//! Draws a corrected sweep into the occupancy grid.

use super::params::Params;
use super::stages::Stages;
use super::step::Corrected;
use super::tracking::LearningPermit;
use crate::geometry::{Placement, Point};
use crate::mapping::cone::{self, ReturnKind};
use crate::mapping::grid::WallNormal;
use crate::position::beam_model::observe_wall;
use crate::position::ekf_slam::{Association, EkfSlam, WallLandmark};
use crate::sweep::Beam;

impl Stages {
    /// Draws the trusted beams. Each marks what it hit in every sweep, and clears its cone in one of several.
    pub(super) fn update_map(&mut self, corrected: &Corrected<'_>, _permit: LearningPermit) {
        let Corrected { robot, sweep } = corrected;
        let ekf = &robot.ekf;
        if ekf.is_frozen() {
            return;
        }
        let pose = Placement::from(ekf.filter.pose());
        self.grid.revise();
        self.mark_map(sweep);
        for (sensor, (beam, association)) in sweep.beams.iter().zip(ekf.associations()).enumerate() {
            let clears = (sweep.index + sensor as u64).is_multiple_of(self.params.clearing_sweeps);
            let (range_m, kind) = match association {
                Association::Wall(_) | Association::Unexplained => match wall_hit(ekf, pose, beam, &self.params) {
                    Some((point, normal)) if !clears => {
                        cone::mark_wall(&mut self.grid, point, normal);
                        continue;
                    }
                    Some((point, normal)) => (beam.range_m, ReturnKind::Wall(point, normal)),
                    None => (beam.range_m, ReturnKind::Something),
                },
                Association::Unused if clears && beam.is_clear() && self.detector.is_trusted(sensor) => {
                    (self.max_range_m, ReturnKind::Nothing)
                }
                Association::Unused => continue,
            };
            cone::integrate_beam(&mut self.grid, pose * beam.robot_from_sensor, beam.half_angle_rad, range_m, kind);
        }
    }
}

/// The point of a known wall that a return may come from: on the wall's line, within its extent or a little beyond.
fn wall_hit(ekf: &EkfSlam, pose: Placement, beam: &Beam, params: &Params) -> Option<(Point, WallNormal)> {
    let observation = observe_wall(&ekf.params().beam, pose, beam)?;
    let off_m = |(index, _): &(usize, &WallLandmark)| (ekf.filter.offset_m(*index) - observation.offset_m()).abs();
    // A square hit beyond the wall's end would be the end itself, somewhere in the cone.
    let beyond_m = if observation.oblique_rad > 0.0 { params.beyond_wall_end_m } else { 0.0 };
    let walls = ekf.walls().iter().enumerate().filter(|(_, wall)| {
        wall.side == observation.side && (wall.lo_m - beyond_m..wall.hi_m + beyond_m).contains(&observation.along_m)
    });
    let nearest = walls.min_by(|a, b| off_m(a).total_cmp(&off_m(b))).filter(|wall| off_m(wall) < params.on_wall_m)?;
    let normal = if observation.side.axis() == 0 { WallNormal::X } else { WallNormal::Y };
    Some((observation.side.join(ekf.filter.offset_m(nearest.0), observation.along_m), normal))
}
