//! Maps of one building from different starts find each other; maps of different buildings say that they do not know.

#![allow(clippy::unwrap_used, reason = "a test may")]

mod drives;

use drives::Drive;
use slamd_core::{Pose2, wrap_angle};
use slamd_fleet::align::{Alignment, Doubt, align, axis};
use slamd_fleet::fleet_file::FleetFile;
use slamd_fleet::merge::{Merged, Newest, Placement};
use slamd_fleet::site::{Place, Site};
use slamd_fleet::wire::Grid;

/// A building's map in the world's frame, from one drive.
fn known(drive: Drive) -> Merged {
    let (grid, world_from_map) = drive.map();
    let mut merged = Merged::new(grid.cell_um);
    merged.add(&grid, &Placement::new(world_from_map));
    merged
}

/// Metres and degrees from the truth, at the robot's start.
fn error(alignment: &Alignment, grid: &Grid, world_from_map: Pose2) -> (f64, f64) {
    let start = grid.start.pose().position();
    let apart = alignment.site_from_map.transform(start) - world_from_map.transform(start);
    (apart.norm(), wrap_angle(alignment.site_from_map.theta_rad - world_from_map.theta_rad).abs().to_degrees())
}

/// Lays drives onto a first one; how many are placed. None may be placed wrongly.
fn placed(world: &'static str, seconds: f64, starts: &[(f64, f64)]) -> usize {
    let site = known(Drive { world, seed: 1, seconds, at: None });
    let mut placed = 0;
    for (seed, &at) in (10..).zip(starts) {
        let (grid, world_from_map) = Drive { world, seed, seconds, at: Some(at) }.map();
        match align(&site, &grid) {
            Ok(alignment) => {
                let (metres, degrees) = error(&alignment, &grid, world_from_map);
                println!("{world} from {at:?}: {alignment:?}, off by {metres:.2} m, {degrees:.1} degrees");
                assert!(metres < 0.2 && degrees < 3.0);
                placed += 1;
            }
            Err(doubt) => println!("{world} from {at:?}: {doubt}"),
        }
    }
    placed
}

#[test]
fn drives_in_one_flat_find_each_other() {
    assert_eq!(placed("flat", 150.0, &[(6.3, 2.0), (2.0, 4.9), (8.5, 6.8)]), 3);
}

/// Its rooms are alike: it takes longer, and from other starts it is not said.
#[test]
fn drives_in_one_office_find_each_other() {
    assert_eq!(placed("office", 420.0, &[(10.0, 6.0)]), 1);
}

#[test]
fn another_building_is_not_taken_for_this_one() {
    let flat = known(Drive { world: "flat", seed: 1, seconds: 150.0, at: None });
    for (world, seed) in [("furnished", 21), ("home", 22), ("office", 23), ("room", 24)] {
        let (grid, _) = Drive { world, seed, seconds: 120.0, at: None }.map();
        let doubt = align(&flat, &grid).unwrap_err();
        println!("{world} on the flat: {doubt}");
    }
}

#[test]
fn too_little_says_nothing() {
    let flat = known(Drive { world: "flat", seed: 1, seconds: 20.0, at: None });
    let (mut grid, _) = Drive { world: "flat", seed: 2, seconds: 20.0, at: None }.map();
    grid.tiles.clear();
    assert_eq!(align(&flat, &grid), Err(Doubt::TooFewWalls));
}

#[test]
fn the_axis_turns_with_the_map() {
    let (grid, _) = Drive { world: "flat", seed: 3, seconds: 60.0, at: None }.map();
    for degrees in [0.0f64, 10.0, -20.0, 40.0, 100.0] {
        let mut turned = Merged::new(grid.cell_um);
        turned.add(&grid, &Placement::new(Pose2::new(0.3, -0.2, degrees.to_radians())));
        let off = (axis(&turned.raster().unwrap()).unwrap().to_degrees() - degrees + 45.0).rem_euclid(90.0) - 45.0;
        assert!(off.abs() < 1.5, "{degrees}: off by {off}");
    }
}

#[test]
fn a_site_places_whom_it_knows_and_finds_the_others() {
    let (first, world_from_first) = Drive { world: "flat", seed: 1, seconds: 150.0, at: None }.map();
    let (second, _) = Drive { world: "flat", seed: 13, seconds: 150.0, at: Some((8.5, 6.8)) }.map();
    let (stranger, _) = Drive { world: "office", seed: 23, seconds: 60.0, at: None }.map();
    let start = world_from_first * first.start.pose();
    let text = format!(
        "[robots.known]\nstart = {{ x_m = {:?}, y_m = {:?}, heading_deg = {:?} }}\n[robots.lost]\n[robots.found]\n[robots.late]",
        start.x_m,
        start.y_m,
        // Written down by eye.
        start.theta_rad.to_degrees() + 6.0
    );
    let fleet = FleetFile::from_toml(&text).unwrap();
    let mut newest = Newest::default();
    for (name, grid) in [("lost", stranger), ("found", second), ("known", first)] {
        newest.take(&name.parse().unwrap(), grid);
    }
    let site = Site::assemble(&fleet, &newest);
    let place = |name: &str| &site.places[&name.parse().unwrap()];
    println!("{}\n{}\n{}", place("known"), place("found"), place("lost"));
    let Place::Known(pose) = place("known") else { panic!("{}", place("known")) };
    assert!(wrap_angle(pose.theta_rad - world_from_first.theta_rad).abs() < 0.02, "the eye's error is gone");
    assert!(matches!(place("found"), Place::Found(_)));
    assert!(matches!(place("lost"), Place::Unknown(_)) && *place("late") == Place::NoMap);
    // Without any known start the first by name is the frame.
    let fleet = FleetFile::from_toml("[robots.found]\n[robots.known]").unwrap();
    let site = Site::assemble(&fleet, &newest);
    let place = |name: &str| &site.places[&name.parse().unwrap()];
    assert!(*place("found") == Place::Frame && matches!(place("known"), Place::Found(_)), "{}", place("known"));
}
