//! The truth: the floor that the robot can reach, and what it touched.

use slamd_core::{Point, Pose2, Raster};
use slamd_sim::robot::BODY_RADIUS_M;
use slamd_sim::route::RouteGrid;
use slamd_sim::world::World;

/// The floor that the robot's middle can reach from the start, doors open.
#[derive(Debug)]
pub(super) struct Floor {
    cells: Vec<Point>,
}

impl Floor {
    pub(super) fn of(world: &World) -> Self {
        let grid = RouteGrid::new(world);
        let routes = grid.routes(world.start);
        let cells = (0..grid.len()).filter(|&cell| routes.cost(cell).is_some());
        Self { cells: cells.map(|cell| grid.middle(cell)).collect() }
    }

    /// The share of it that a map tells of, 0 to 1.
    pub(super) fn seen(&self, map: &Raster, world_from_map: Option<Pose2>) -> f64 {
        let Some(world_from_map) = world_from_map else { return 0.0 };
        let map_from_world = world_from_map.inverse();
        let is_seen = |point: &&Point| {
            let cell = map.cell(map_from_world.transform(**point));
            let value = cell.and_then(|(column, row)| map.occupancy.get(row * map.width + column));
            value.is_some_and(|&value| value != Raster::UNKNOWN)
        };
        self.cells.iter().filter(is_seen).count() as f64 / self.cells.len().max(1) as f64
    }
}

/// When the body touched something.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Contacts {
    pub(super) count: u32,
    /// The greatest speed at the beginning of a contact, metres per second.
    pub(super) speed_m_s: f64,
    is_touching: bool,
}

/// A contact is over when the body is so far away, metres.
const APART_M: f64 = 0.01;

impl Contacts {
    pub(super) fn take(&mut self, clearance_m: f64, [left, right]: [f64; 2]) {
        if clearance_m > BODY_RADIUS_M + APART_M {
            self.is_touching = false;
        } else if clearance_m < BODY_RADIUS_M && !self.is_touching {
            self.is_touching = true;
            self.count += 1;
            self.speed_m_s = self.speed_m_s.max((0.5 * (left + right)).abs());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_contact_counts_once_until_the_body_is_apart() {
        let mut contacts = Contacts::default();
        for (clearance_m, speed) in [(0.3, 0.2), (0.169, 0.1), (0.168, 0.3), (0.175, 0.1), (0.16, 0.1), (0.2, 0.2)] {
            contacts.take(clearance_m, [speed; 2]);
        }
        assert_eq!(contacts.count, 1);
        assert!((contacts.speed_m_s - 0.1).abs() < 1e-12);
        contacts.take(0.1, [-0.2; 2]);
        assert_eq!(contacts.count, 2);
        assert!((contacts.speed_m_s - 0.2).abs() < 1e-12);
    }

    #[test]
    fn an_empty_map_tells_of_nothing() {
        let floor = Floor::of(&World::random(1));
        assert!(floor.cells.len() > 500, "{}", floor.cells.len());
        assert!(floor.seen(&Raster::default(), Some(Pose2::default())) == 0.0);
    }
}
