use super::*;
use slamd_core::FaultKind;

/// No rooms.
static PLAN: std::sync::LazyLock<Plan> = std::sync::LazyLock::new(Plan::default);

#[test]
fn an_empty_map_is_still_a_picture() {
    let (raster, ring) = (Raster::default(), Ring::default());
    let png = draw(&scene(&raster, &ring, &[], &[])).unwrap();
    assert!(png.starts_with(b"\x89PNG"));
}

#[test]
fn a_point_is_drawn_in_its_cell() {
    let mut occupancy = vec![0; 12];
    occupancy[7] = 100;
    let raster = Raster { width: 4, height: 3, cell_m: 0.5, origin: Point::new(-1.0, -1.0), occupancy };
    let floor = Floor::new(&raster, std::iter::empty());
    assert_eq!(floor.size(), (1200, 900));
    let (x, y) = floor.pixel(Point::new(0.75, -0.25));
    assert!((x - 1050.0).abs() < 1e-9 && (y - 450.0).abs() < 1e-9, "the middle of column 3 and row 1 from below");
}

#[test]
fn faulty_sensors_change_the_picture() {
    let raster = Raster { width: 40, height: 40, cell_m: 0.1, origin: Point::origin(), occupancy: vec![0; 1600] };
    let ring = Ring::circle(8, 0.15, 0.2, 1);
    let good = draw(&scene(&raster, &ring, &[], &[])).unwrap();
    let bad = draw(&scene(&raster, &ring, &[SensorState::Faulty(FaultKind::Stuck)], &[])).unwrap();
    assert_ne!(good, bad);
}

fn scene<'a>(raster: &'a Raster, ring: &'a Ring, states: &'a [SensorState], path: &'a [Stretch]) -> Scene<'a> {
    Scene {
        raster,
        plan: &PLAN,
        drive: Drive::default(),
        path,
        path_m: 0.0,
        odometry: &[],
        truth: &[],
        ate_m: None,
        pose: Pose2::default(),
        ring,
        states,
        robot_name: "robot",
        doubts: &[],
    }
}
