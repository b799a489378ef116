use super::*;

const CELL_M: f64 = 0.05;

/// A raster from a picture: `#` is a wall, a dot is free, anything else is unknown. Each letter is 4 cells by 4, 0.2 m.
fn raster(rows: &[&str]) -> Raster {
    let letters: Vec<Vec<char>> = rows.iter().rev().map(|row| row.chars().collect()).collect();
    let (width, height) = (4 * letters[0].len(), 4 * letters.len());
    let occupancy = (0..width * height)
        .map(|index| match letters[index / width / 4][index % width / 4] {
            '#' => 100,
            '.' => 0,
            _ => Raster::UNKNOWN,
        })
        .collect();
    Raster { width, height, cell_m: CELL_M, origin: Point::origin(), occupancy }
}

/// The middle of a letter, counted from the left and from below.
fn at(column: usize, row: usize) -> Point {
    Point::new(0.2 * (column as f64 + 0.5), 0.2 * (row as f64 + 0.5))
}

const HOME: &[&str] = &[
    "  #####################         ",
    "  #.........#.........#         ",
    "  #.........#.........#         ",
    "  #.........#.........#         ",
    "  #.........#.........#         ",
    "  #.........#.........#         ",
    "  #...................#         ",
    "  #...................#......   ",
    "  #...................#......   ",
    "  #.........#................   ",
    "  #.........#................   ",
    "  #.........#.........#......   ",
    "  #.........#.........#......   ",
    "  #####################         ",
];

#[test]
fn rooms_have_the_areas_between_their_walls() {
    let raster = raster(HOME);
    let plan = Plan::new(&raster, std::iter::once([at(5, 2), at(5, 6), at(16, 6)].as_slice()));
    let areas: Vec<f64> = plan.rooms.iter().map(|room| room.area_m2).collect();
    // 9 by 12 letters each. The wall's line passes through the middle of the thick wall, so the door's half belongs to each.
    let expected = 9.0 * 12.0 * 0.04;
    assert_eq!(areas.len(), 2, "{plan:?}");
    assert!(areas.iter().all(|area| (area - expected).abs() < 0.5), "{areas:?} for {expected}");
    assert!((plan.floor_m2() - areas.iter().sum::<f64>()).abs() < 1e-9);
}

#[test]
fn what_is_seen_through_a_gap_is_outside() {
    let raster = raster(HOME);
    let plan = Plan::new(&raster, std::iter::once([at(5, 2), at(5, 6), at(16, 6)].as_slice()));
    let place = |point| raster.cell(point).map(|(x, y)| plan.place(y * raster.width + x));
    assert_eq!(place(at(16, 3)), Some(Place::Inside));
    assert_eq!(place(at(25, 3)), Some(Place::Outside), "beyond the gap that the robot did not pass");
    assert_eq!(plan.gaps.len(), 1, "{:?}", plan.gaps);
    let driven = Plan::new(&raster, std::iter::once([at(5, 6), at(16, 6), at(16, 3), at(25, 3)].as_slice()));
    assert_eq!(driven.rooms.len(), 3);
    assert!(driven.gaps.is_empty(), "{:?}", driven.gaps);
}

#[test]
fn walls_are_as_long_as_they_are() {
    let raster = raster(HOME);
    let plan = Plan::new(&raster, std::iter::once([at(5, 2), at(5, 6), at(16, 6)].as_slice()));
    // Two walls of 21 letters along x; from the outer edge to the outer edge, to a cell of the thick walls.
    let long: Vec<f64> = plan.walls.iter().filter(|wall| wall.is_along_x).map(Wall::length_m).collect();
    assert_eq!(long.len(), 2, "{:?}", plan.walls);
    assert!(long.iter().all(|length_m| (length_m - 4.2).abs() < 0.11), "{long:?}");
    let outer = plan.walls.iter().filter(|wall| wall.is_outside_at_the_lower_side).count();
    assert!(outer >= 2, "the lower and the left wall: {:?}", plan.walls);
}

#[test]
fn where_the_robot_was_nowhere_everything_is_shown() {
    let raster = raster(HOME);
    let plan = Plan::new(&raster, std::iter::empty());
    assert!(plan.rooms.is_empty() && plan.place(0) == Place::Inside);
    assert!(!plan.walls.is_empty());
    assert_eq!(Plan::new(&Raster::default(), std::iter::empty()).walls, []);
}
