//! The explorer in small rooms whose sonars see everything within two metres.

#![allow(clippy::unwrap_used, clippy::indexing_slicing, reason = "a test may")]

use super::*;
use nalgebra::Matrix3;
use slamd_core::{Estimate, Point, Pose2, Raster, Timestamp};
use std::f64::consts::TAU;

const CELL_M: f64 = 0.05;
const VIEW_M: f64 = 2.0;
const STEP_S: f64 = 0.1;

/// A plan of one character per 0.25 m: `#` is a wall, `d` a door, `H` the start.
struct Room {
    rows: Vec<Vec<char>>,
    map: Raster,
    pose: Pose2,
    home: Point,
    now: Timestamp,
    /// The door is open.
    is_open: bool,
    /// The least distance of the robot's middle from a wall, metres.
    nearest_m: f64,
}

impl Room {
    fn new(plan: &str) -> Self {
        let mut rows: Vec<Vec<char>> = plan.split_whitespace().map(|row| row.chars().collect()).collect();
        rows.reverse();
        let (width, height) = (rows[0].len() * 5, rows.len() * 5);
        let map =
            Raster { width, height, cell_m: CELL_M, origin: Point::origin(), occupancy: vec![-1; width * height] };
        let row = rows.iter().position(|row| row.contains(&'H')).unwrap();
        let column = rows[row].iter().position(|&c| c == 'H').unwrap();
        let home = Point::new(0.25 * column as f64 + 0.125, 0.25 * row as f64 + 0.125);
        let pose = Pose2::new(home.x, home.y, 0.3);
        Self { rows, map, pose, home, now: Timestamp::default(), is_open: true, nearest_m: f64::INFINITY }
    }

    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "inside the plan")]
    fn is_wall(&self, point: Point) -> bool {
        match self.rows[(point.y / 0.25) as usize][(point.x / 0.25) as usize] {
            '#' => true,
            'd' => !self.is_open,
            _ => false,
        }
    }

    /// Draws what the robot sees, and gives the echoes.
    fn look(&mut self) -> Vec<Point> {
        let (here, mut echoes) = (self.pose.position(), Vec::new());
        for ray in 0..180 {
            let (sin, cos) = libm::sincos(self.pose.theta_rad + TAU * f64::from(ray) / 180.0);
            for step in 0..=80 {
                let way_m = VIEW_M * f64::from(step) / 80.0;
                let point = here + nalgebra::Vector2::new(cos, sin) * way_m;
                let is_wall = self.is_wall(point);
                let (column, row) = self.map.cell(point).unwrap();
                self.map.occupancy[row * self.map.width + column] = if is_wall { 100 } else { 0 };
                if is_wall {
                    self.nearest_m = self.nearest_m.min(way_m);
                    echoes.push(self.pose.inverse().transform(point));
                    break;
                }
            }
        }
        echoes
    }

    fn step(&mut self, explorer: &mut Explorer, sigma_m: f64, is_uncertain: bool) -> Command {
        let echoes = self.look();
        self.now = Timestamp::from_us(self.now.us() + 100_000);
        let estimate = Estimate {
            at: self.now,
            sweep: 0,
            pose: self.pose,
            covariance: Matrix3::from_diagonal_element(sigma_m * sigma_m),
            odometry: self.pose,
            nis: 1.0,
        };
        let map = explorer.wants_map(self.now).then_some(&self.map);
        let command = explorer.command(&Observation {
            at: self.now,
            estimate: Some(&estimate),
            is_uncertain,
            echoes: &echoes,
            map,
        });
        let (way_m, turn) = (command.twist.forward_m_s * STEP_S, command.twist.turn_rad_s * STEP_S);
        let there = self.pose.ahead(way_m);
        self.pose = Pose2::new(there.x, there.y, self.pose.theta_rad + turn);
        command
    }

    /// Explores for at most `seconds`; the report.
    fn explore(&mut self, explorer: &mut Explorer, seconds: u32) -> Option<Report> {
        for _ in 0..10 * seconds {
            self.step(explorer, 0.01, false);
            if let Some(report) = explorer.report() {
                return Some(report.clone());
            }
        }
        None
    }

    fn explorer(&self) -> Explorer {
        Explorer::new(Params::default(), self.home)
    }

    /// The cell of the map at a place of the plan, counted from its upper left.
    fn seen(&self, column: usize, row_from_top: usize) -> i8 {
        let row = self.rows.len() - 1 - row_from_top;
        self.map.occupancy[(5 * row + 2) * self.map.width + 5 * column + 2]
    }
}

const TWO_ROOMS: &str = "
    #########################
    #...........#...........#
    #...........#...........#
    #...........#...........#
    #..H....................#
    #.......................#
    #.......................#
    #.......................#
    #...........#...........#
    #...........#...........#
    #########################";

#[test]
fn two_rooms_are_explored_and_the_robot_comes_home() {
    let mut room = Room::new(TWO_ROOMS);
    let mut explorer = room.explorer();
    let report = room.explore(&mut explorer, 400).unwrap();
    assert!(report.is_home && report.unreachable.is_empty(), "{report}");
    assert!((room.pose.position() - room.home).norm() < 0.06);
    assert!(room.seen(22, 2) == 0 && room.seen(22, 8) == 0);
    assert!(room.nearest_m > 0.17, "{}", room.nearest_m);
    // 23 by 9 squares of a quarter metre, less the wall between the rooms.
    assert!((report.explored_m2 - 12.6).abs() < 1.5, "{report}");
    // It stays there.
    assert_eq!(room.step(&mut explorer, 0.01, false).twist, Twist::default());
}

#[test]
fn the_same_observations_give_the_same_commands() {
    let commands = || {
        let mut room = Room::new(TWO_ROOMS);
        let mut explorer = room.explorer();
        (0..600).map(|_| room.step(&mut explorer, 0.01, false)).collect::<Vec<Command>>()
    };
    assert_eq!(commands(), commands());
}

#[test]
fn it_drives_around_a_table_and_out_of_a_dead_end() {
    let mut room = Room::new(
        "
        ###########################
        #.........................#
        #.........................#
        #.........................#
        #.........................#
        #....H.......####.........#
        #............####.........#
        #............####.........#
        #.........................#
        #.........................#
        #.........................#
        #####.....#################
        ####.......################
        ####.......################
        ####.......################
        ####.......################
        ###########################",
    );
    let mut explorer = room.explorer();
    let report = room.explore(&mut explorer, 600).unwrap();
    assert!(report.is_home, "{report}");
    assert!(room.seen(24, 2) == 0 && room.seen(24, 9) == 0 && room.seen(7, 14) == 0);
    assert!(room.nearest_m > 0.17, "{}", room.nearest_m);
}

#[test]
fn a_pocket_too_narrow_for_the_body_is_left_out() {
    let mut room = Room::new(
        "
        ################
        #.......#......#
        #.......#......#
        #..H...........#
        #.......#......#
        #.......#......#
        #.......#......#
        ################",
    );
    let mut explorer = room.explorer();
    let report = room.explore(&mut explorer, 400).unwrap();
    assert!(report.is_home, "{report}");
    assert!(report.explored_m2 < 3.6, "{report}");
    assert!(room.pose.x_m < 2.0 && room.nearest_m > 0.17, "{}", room.nearest_m);
}

const DOOR: &str = "
    #########################
    #...........#...........#
    #...........#...........#
    #...........#...........#
    #..H........d...........#
    #...........d...........#
    #...........d...........#
    #...........d...........#
    #...........#...........#
    #...........#...........#
    #########################";

#[test]
fn a_door_that_closes_behind_the_robot_and_opens_again_does_not_end_the_way_home() {
    let mut room = Room::new(DOOR);
    let mut explorer = room.explorer();
    while room.pose.x_m < 4.0 {
        assert!(room.now.seconds() < 300.0, "it never went through the door");
        room.step(&mut explorer, 0.01, false);
    }
    room.is_open = false;
    assert_eq!(room.explore(&mut explorer, 60), None, "it cannot be home");
    assert!(room.nearest_m > 0.17, "{}", room.nearest_m);
    room.is_open = true;
    let report = room.explore(&mut explorer, 400).unwrap();
    assert!(report.is_home, "{report}");
}

#[test]
fn without_a_reliable_pose_it_stands_and_then_drives_by_its_echoes() {
    let mut room = Room::new(TWO_ROOMS);
    let mut explorer = room.explorer();
    for _ in 0..100 {
        room.step(&mut explorer, 0.01, false);
    }
    let doubt: Vec<Command> = (0..60).map(|_| room.step(&mut explorer, 0.01, true)).collect();
    assert!(doubt.iter().all(|command| !command.uses_pose && command.status == Status::FindingPose));
    assert!(doubt[..15].iter().all(|command| command.twist == Twist::default()));
    assert!(doubt[30..].iter().all(|command| command.twist != Twist::default()));
    assert!(room.nearest_m > 0.17, "{}", room.nearest_m);
}

#[test]
fn it_returns_to_known_walls_when_the_pose_becomes_uncertain_on_a_long_way() {
    let mut room = Room::new(TWO_ROOMS);
    let mut explorer = Explorer::new(Params { revisit_way_m: 1.0, ..Params::default() }, room.home);
    let statuses: Vec<Status> = (0..900).map(|_| room.step(&mut explorer, 0.2, false).status).collect();
    assert!(statuses.contains(&Status::Revisiting));
}

#[test]
fn the_report_is_a_sentence() {
    let place = |x| Point::new(x, 2.0);
    let report = |unreachable| Report { explored_m2: 61.2, unreachable, is_home: true }.to_string();
    assert_eq!(report(Vec::new()), "explored 61 m2");
    assert_eq!(
        report(vec![place(1.0), place(-3.25)]),
        "explored 61 m2, two places not reachable: (1.0, 2.0), (-3.2, 2.0)"
    );
}
