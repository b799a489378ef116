//! The whole site: the pose of every robot's newest map, and the merged map.
//!
//! It is a pure function of the fleet file and the maps, so hub and offline union give the same result,
//! bit for bit.

use crate::align::{Alignment, align};
use crate::fleet_file::FleetFile;
use crate::merge::{Merged, Newest, Placement};
use crate::name::Name;
use crate::wire::Grid;
use slamd_core::{Pose2, nearest_quarter};
use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;
use std::fmt;

/// The placement of a robot's map.
#[derive(Clone, Debug, PartialEq)]
pub enum Place {
    /// The robot has no map yet.
    NoMap,
    /// The fleet file gives its start.
    Known(Pose2),
    /// No robot's start is known, so this robot's map defines the site's frame.
    Frame,
    /// Its map was aligned with the others'.
    Found(Alignment),
    /// Its map is not merged, for this reason.
    Unknown(String),
}

/// The placement of every robot's map, and the merged map.
#[derive(Clone, Debug, PartialEq)]
pub struct Site {
    /// The sum.
    pub merged: Merged,
    /// By robot.
    pub places: BTreeMap<Name, Place>,
}

/// Maximum heading error of a start in the fleet file, radians. Within it, the map's rotation is a
/// multiple of 90 degrees, because maps and site are along the walls.
const NEAR_RAD: f64 = 15.0 * std::f64::consts::PI / 180.0;

impl Site {
    /// Puts the maps together.
    #[must_use]
    pub fn assemble(fleet: &FleetFile, newest: &Newest) -> Self {
        let mut site = Self { merged: Merged::new(fleet.cell_um()), places: BTreeMap::new() };
        let is_any_known = fleet.robots().values().any(|robot| robot.start.is_some());
        let frame = fleet.robots().keys().next().filter(|_| !is_any_known);
        let mut open = Vec::new();
        for (name, robot) in fleet.robots() {
            match (newest.get(name), robot.start) {
                (None, _) => drop(site.places.insert(name.clone(), Place::NoMap)),
                (Some(grid), Some(start)) => {
                    let pose = site_from_map(start.pose(), grid);
                    site.put(name, grid, pose, Place::Known(pose));
                }
                (Some(grid), None) if Some(name) == frame => site.put(name, grid, Pose2::default(), Place::Frame),
                (Some(grid), None) => open.push((name, grid)),
            }
        }
        // Each merged map makes the others easier to align, so they are tried again, in the order of
        // names.
        while let Some((index, alignment)) = open.iter().enumerate().find_map(|(index, (_, grid))| {
            if site.merged.is_empty() { None } else { Some((index, align(&site.merged, grid).ok()?)) }
        }) {
            let (name, grid) = open.remove(index);
            site.put(name, grid, alignment.site_from_map, Place::Found(alignment));
        }
        for (name, grid) in open {
            let why = match site.merged.is_empty() {
                true => "no robot whose start is known has a map yet".into(),
                false => align(&site.merged, grid).map_or_else(|doubt| doubt.to_string(), |_| String::new()),
            };
            site.places.insert(name.clone(), Place::Unknown(why));
        }
        site
    }

    fn put(&mut self, name: &Name, grid: &Grid, site_from_map: Pose2, place: Place) {
        self.merged.add(grid, &Placement::new(site_from_map));
        self.places.insert(name.clone(), place);
    }
}

/// Where a map lies whose robot began at `start` on the site. Its turn is a whole number of quarters where that is near.
fn site_from_map(start: Pose2, grid: &Grid) -> Pose2 {
    let began = grid.start.pose();
    let (quarter, beyond_rad) = nearest_quarter(start.theta_rad - began.theta_rad);
    let is_near = beyond_rad.abs() <= NEAR_RAD;
    let theta_rad = if is_near { quarter as f64 * FRAC_PI_2 } else { start.theta_rad - began.theta_rad };
    let turn = Pose2::new(0.0, 0.0, theta_rad);
    let moved = start.position() - turn.transform(began.position());
    Pose2::new(moved.x, moved.y, theta_rad)
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoMap => f.write_str("no map yet"),
            Self::Known(_) => f.write_str("placed by its start"),
            Self::Frame => f.write_str("its map is the site's frame: no start is known"),
            Self::Found(Alignment { site_from_map, score, second }) => write!(
                f,
                "found at {:.2}, {:.2} m, {:.0} degrees: score {score:.2}, the second best {second:.2}",
                site_from_map.x_m,
                site_from_map.y_m,
                site_from_map.theta_rad.to_degrees()
            ),
            Self::Unknown(why) => write!(f, "not in the map: {why}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::SessionId;
    use crate::wire::Start;

    #[test]
    fn a_start_that_is_roughly_known_turns_by_whole_quarters() {
        let start = |x_m, y_m, degrees: f64| Pose2::new(x_m, y_m, degrees.to_radians());
        let began = Start::new(start(0.02, 0.0, 30.0));
        let grid = Grid { session: SessionId::default(), seq: 1, start: began, cell_um: 50_000, tiles: Vec::new() };
        // The robot looks 30 degrees off the walls in its map, and 127 degrees by the file: the map is turned by 90, not by 97.
        let pose = site_from_map(start(2.0, 3.0, 127.0), &grid);
        assert!((pose.theta_rad - FRAC_PI_2).abs() < 1e-12, "{pose:?}");
        assert!((pose.transform(began.pose().position()) - start(2.0, 3.0, 0.0).position()).norm() < 1e-9);
        let slanted = site_from_map(start(0.0, 0.0, 75.0), &grid);
        assert!((slanted.theta_rad.to_degrees() - 45.0).abs() < 1e-3, "{slanted:?}");
    }
}
