//! The built-in worlds: `flat`, `office`, `furnished`, `home` and `room`.

use super::floor_plan::{FloorPlan, Rectangle, box_faces};
use super::world::World;
use slamd_core::Point;

impl World {
    /// Largest world file that is read, bytes.
    pub const MAX_FILE_BYTES: u64 = 1 << 20;

    /// The names of the built-in worlds.
    pub const BUILT_IN: [&'static str; 5] = ["flat", "office", "furnished", "home", "room"];

    /// The built-in world of that name, if there is one. Its start heading comes from the seed.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        match name {
            "flat" => Some(flat()),
            "office" => Some(office()),
            "furnished" => Some(furnished()),
            "home" => Some(home()),
            "room" => Some(room()),
            _ => None,
        }
    }
}

/// A home of 10 x 8 m: three rooms on either side of a hall, walls 0.1 m thick, doors 0.8-0.9 m wide.
fn flat() -> World {
    const ROOMS: [Rectangle; 7] = [
        [0.0, 0.0, 4.9, 4.2],
        [5.0, 0.0, 7.6, 4.2],
        [7.7, 0.0, 10.0, 4.2],
        [0.0, 4.3, 10.0, 5.5],
        [0.0, 5.6, 3.8, 8.0],
        [3.9, 5.6, 7.0, 8.0],
        [7.1, 5.6, 10.0, 8.0],
    ];
    const DOORS: [Rectangle; 7] = [
        [1.2, 4.2, 2.1, 4.3],
        [4.9, 1.4, 5.0, 2.3],
        [6.1, 4.2, 6.95, 4.3],
        [8.5, 4.2, 9.3, 4.3],
        [2.5, 5.5, 3.35, 5.6],
        [4.5, 5.5, 5.35, 5.6],
        [7.9, 5.5, 8.75, 5.6],
    ];
    let free = [&ROOMS[..], &DOORS].concat();
    // A chimney breast and a wardrobe break two of the long walls.
    let blocks = [[2.0, 0.0, 3.0, 0.35], [0.0, 7.4, 1.6, 8.0]];
    World::new("flat", FloorPlan { free: &free, blocks: &blocks }.faces(), Point::new(2.4, 2.2), None)
}

/// 30 x 20 m: a corridor 2 m wide around a core of two halls, with offices outside. The corner
/// offices open into their neighbours.
fn office() -> World {
    const CORRIDORS: [Rectangle; 4] =
        [[5.0, 5.0, 25.0, 7.0], [5.0, 13.0, 25.0, 15.0], [5.0, 5.0, 7.0, 15.0], [23.0, 5.0, 25.0, 15.0]];
    const CORE: [Rectangle; 2] = [[7.1, 7.1, 13.0, 12.9], [16.5, 7.1, 22.9, 12.9]];
    const SOUTH: [Rectangle; 6] = [
        [0.0, 0.0, 4.9, 4.9],
        [5.0, 0.0, 9.4, 4.9],
        [9.5, 0.0, 14.9, 4.9],
        [15.0, 0.0, 20.4, 4.9],
        [20.5, 0.0, 24.9, 4.9],
        [25.0, 0.0, 30.0, 4.9],
    ];
    const NORTH: [Rectangle; 5] = [
        [0.0, 15.1, 4.9, 20.0],
        [5.0, 15.1, 11.4, 20.0],
        [11.5, 15.1, 18.4, 20.0],
        [18.5, 15.1, 24.9, 20.0],
        [25.0, 15.1, 30.0, 20.0],
    ];
    const SIDES: [Rectangle; 4] =
        [[0.0, 5.0, 4.9, 9.4], [0.0, 9.5, 4.9, 15.0], [25.1, 5.0, 30.0, 10.4], [25.1, 10.5, 30.0, 15.0]];
    const DOORS: [Rectangle; 17] = [
        [9.0, 7.0, 9.9, 7.1],
        [20.0, 12.9, 20.9, 13.0],
        [7.6, 4.9, 8.5, 5.0],
        [10.2, 4.9, 11.1, 5.0],
        [18.9, 4.9, 19.8, 5.0],
        [21.0, 4.9, 21.9, 5.0],
        [4.9, 2.0, 5.0, 2.9],
        [24.9, 2.0, 25.0, 2.9],
        [9.8, 15.0, 10.7, 15.1],
        [14.5, 15.0, 15.4, 15.1],
        [19.2, 15.0, 20.1, 15.1],
        [4.9, 17.0, 5.0, 17.9],
        [24.9, 17.0, 25.0, 17.9],
        [4.9, 8.0, 5.0, 8.9],
        [4.9, 10.2, 5.0, 11.1],
        [25.0, 9.0, 25.1, 9.9],
        [25.0, 11.5, 25.1, 12.4],
    ];
    let free = [&CORRIDORS[..], &CORE, &SOUTH, &NORTH, &SIDES, &DOORS].concat();
    // Columns, and a copier in the corridor.
    let blocks = [[11.0, 9.7, 11.4, 10.1], [19.4, 9.8, 19.8, 10.2], [14.0, 14.4, 15.2, 15.0], [24.4, 8.0, 25.0, 8.8]];
    World::new("office", FloorPlan { free: &free, blocks: &blocks }.faces(), Point::new(8.0, 6.0), None)
}

/// A room of 8 x 6 m with axis-aligned furniture and three obstacles turned by 30 degrees.
fn furnished() -> World {
    const FURNITURE: [Rectangle; 6] = [
        [0.4, 0.0, 2.4, 0.9],
        [0.0, 3.6, 0.45, 5.2],
        [6.4, 4.0, 8.0, 6.0],
        [7.4, 0.6, 8.0, 2.2],
        [3.6, 5.55, 5.0, 6.0],
        [4.6, 0.0, 5.4, 0.5],
    ];
    let mut faces = FloorPlan { free: &[[0.0, 0.0, 8.0, 6.0]], blocks: &FURNITURE }.faces();
    let turn = 30_f64.to_radians();
    faces.extend(box_faces(Point::new(4.0, 3.0), [1.2, 0.8], turn));
    faces.extend(box_faces(Point::new(1.7, 4.4), [0.5, 0.5], turn));
    faces.extend(box_faces(Point::new(6.0, 1.6), [0.7, 0.4], turn));
    World::new("furnished", faces, Point::new(2.2, 2.2), None)
}

/// A flat of 12 x 10 m: four rooms and a bath around a hall. Published results for homes of this
/// size can be compared with it.
fn home() -> World {
    const ROOMS: [Rectangle; 6] = [
        [0.0, 0.0, 5.4, 4.4],
        [5.5, 0.0, 8.6, 4.4],
        [8.7, 0.0, 12.0, 4.4],
        [0.0, 4.5, 12.0, 5.9],
        [0.0, 6.0, 6.9, 10.0],
        [7.0, 6.0, 12.0, 10.0],
    ];
    const DOORS: [Rectangle; 6] = [
        [3.6, 4.4, 4.5, 4.5],
        [5.4, 2.6, 5.5, 3.5],
        [6.6, 4.4, 7.5, 4.5],
        [9.4, 4.4, 10.3, 4.5],
        [1.5, 5.9, 2.4, 6.0],
        [8.2, 5.9, 9.1, 6.0],
    ];
    let free = [&ROOMS[..], &DOORS].concat();
    let blocks = [[0.0, 1.4, 0.9, 3.2], [10.8, 0.0, 12.0, 0.6], [3.0, 9.4, 5.0, 10.0], [11.4, 7.4, 12.0, 8.8]];
    World::new("home", FloorPlan { free: &free, blocks: &blocks }.faces(), Point::new(2.6, 2.2), None)
}

/// One empty room of 4.8 x 3.4 m. Most sensors have a wall in range everywhere in it.
fn room() -> World {
    let faces = FloorPlan { free: &[[0.0, 0.0, 4.8, 3.4]], blocks: &[] }.faces();
    World::new("room", faces, Point::new(1.6, 1.5), None)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn built_in_worlds_have_the_stated_size_and_a_clear_start() {
        for (name, width, height) in [
            ("flat", 10.0, 8.0),
            ("office", 30.0, 20.0),
            ("furnished", 8.0, 6.0),
            ("home", 12.0, 10.0),
            ("room", 4.8, 3.4),
        ] {
            let world = World::named(name).unwrap();
            let (low, high) = world.bounds();
            assert_eq!((low, high), (Point::origin(), Point::new(width, height)), "{name}");
            assert!(world.clearance(world.start) > 0.5, "{name}");
        }
        assert_eq!(World::named("moon"), None);
    }

    #[test]
    fn only_the_turned_obstacles_are_not_axis_aligned() {
        let oblique = |name| {
            let world = World::named(name).unwrap();
            world.segments.iter().filter(|s| s.normal().x.abs().min(s.normal().y.abs()) > 1e-9).count()
        };
        assert_eq!(World::BUILT_IN.map(oblique), [0, 0, 12, 0, 0]);
    }
}
