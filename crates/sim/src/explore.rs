//! The simulated driver: drives to the location that was not visited for the longest time and
//! avoids obstacles.
//!
//! It is not under test, so it may use the true world and pose.

use super::random::Random;
use super::robot::{BODY_RADIUS_M, Twist};
use super::route::RouteGrid;
use super::world::World;
use slamd_core::{Point, Pose2, wrap_angle};

/// Seconds between two commands.
pub const PERIOD_S: f64 = 0.05;
/// Cruising speed, metres per second.
const CRUISE_M_S: f64 = 0.3;
/// Maximum turn rate, radians per second.
const TURN_RAD_S: f64 = 1.0;
/// Maximum distance of the point on the route that the robot aims at, metres.
const LOOK_AHEAD_M: f64 = 0.5;
/// Minimum distance between the body and a surface, metres.
const MARGIN_M: f64 = 0.03;
/// Number of random candidates for a new goal.
const CANDIDATES: usize = 40;
/// Every cell within this distance of the robot counts as visited, metres.
const VISIT_M: f64 = 0.7;
/// A robot that moved less than this for [`STANDS_S`] looks for another way, metres and seconds. Only in a
/// home: nothing else moves.
const STANDS_M: f64 = 0.05;
const STANDS_S: f64 = 4.0;
/// Minimum distance between the body and what moves, metres.
const MOVING_MARGIN_M: f64 = 0.08;
/// Seconds after which the driver gives up a goal.
const PATIENCE_S: f64 = 120.0;

/// A driver that visits every part of the world again and again.
#[derive(Clone, Debug)]
pub struct Explorer {
    grid: RouteGrid,
    /// Time of the last visit of each cell, seconds; negative: never visited.
    visited_s: Vec<f64>,
    /// The route to the goal, nearest point first.
    route: Vec<Point>,
    next: usize,
    chosen_s: f64,
    /// Where and when the robot last moved.
    moved: (Point, f64),
    random: Random,
}

impl Explorer {
    /// A driver for `world`.
    #[must_use]
    pub fn new(world: &World, random: Random) -> Self {
        let grid = RouteGrid::new(world);
        let visited_s = vec![-1.0; grid.len()];
        Self { grid, visited_s, route: Vec::new(), next: 0, chosen_s: 0.0, moved: (world.start, 0.0), random }
    }

    /// Gives up the current goal, as after the robot was carried away.
    pub fn forget(&mut self) {
        self.route.clear();
        self.next = 0;
    }

    /// The command for the next [`PERIOD_S`], given the true pose at `now_s` seconds.
    pub fn command(&mut self, world: &World, world_from_robot: Pose2, now_s: f64) -> Twist {
        let here = world_from_robot.position();
        self.visit(here, now_s);
        while self.next + 1 < self.route.len() && self.can_reach(world, here, self.route[self.next + 1]) {
            self.next += 1;
        }
        let arrived = self.route.last().is_none_or(|&goal| (goal - here).norm() < 0.15);
        if arrived || now_s > self.chosen_s + PATIENCE_S || self.stands(world, here, now_s) {
            self.choose(world, here, now_s);
        }
        self.route.get(self.next).map_or_else(Twist::default, |&aim| drive(world, world_from_robot, aim))
    }

    /// True if something in a home has kept the robot from moving.
    fn stands(&mut self, world: &World, here: Point, now_s: f64) -> bool {
        let is_moving = (here - self.moved.0).norm() > STANDS_M;
        let stands = now_s > self.moved.1 + STANDS_S;
        if is_moving || stands {
            self.moved = (here, now_s);
        }
        world.home.is_some() && stands && !is_moving
    }

    /// True if the body can move straight from `here` to `aim`, at most [`LOOK_AHEAD_M`] away.
    fn can_reach(&self, world: &World, here: Point, aim: Point) -> bool {
        let steps = 5;
        (aim - here).norm() < LOOK_AHEAD_M
            && (1..=steps).all(|step| {
                let point = here + (aim - here) * (f64::from(step) / f64::from(steps));
                world.clearance(point) > BODY_RADIUS_M + 2.0 * MARGIN_M
            })
    }

    fn visit(&mut self, here: Point, now_s: f64) {
        for (cell, visited_s) in self.visited_s.iter_mut().enumerate() {
            if (self.grid.middle(cell) - here).norm_squared() < VISIT_M * VISIT_M {
                *visited_s = now_s;
            }
        }
    }

    /// Picks the next goal among random cells: the nearest that was never visited, or else the one
    /// with the oldest visit.
    fn choose(&mut self, world: &World, here: Point, now_s: f64) {
        let routes = match world.home {
            Some(_) => self.grid.with_moving(world).routes(here),
            None => self.grid.routes(here),
        };
        let mut best: Option<((i64, u32), usize)> = None;
        for _ in 0..CANDIDATES {
            let cell = self.random.below(self.grid.len());
            if let Some(cost) = routes.cost(cell).filter(|&cost| cost > 500) {
                #[expect(clippy::cast_possible_truncation, reason = "seconds of one session")]
                let rank = (self.visited_s[cell] as i64, cost);
                if best.is_none_or(|(least, _)| rank < least) {
                    best = Some((rank, cell));
                }
            }
        }
        self.route = best.map_or_else(Vec::new, |(_, goal)| {
            routes.route(goal).into_iter().map(|cell| self.grid.middle(cell)).collect()
        });
        self.next = 0;
        self.chosen_s = now_s;
    }
}

/// The command that turns towards `aim` and drives there: the larger the turn, the slower. It stops
/// before a surface.
fn drive(world: &World, world_from_robot: Pose2, aim: Point) -> Twist {
    let offset = aim - world_from_robot.position();
    let off_rad = wrap_angle(libm::atan2(offset.y, offset.x) - world_from_robot.theta_rad);
    let turn_rad_s = (2.5 * off_rad).clamp(-TURN_RAD_S, TURN_RAD_S);
    let share = (1.0 - off_rad.abs() / 0.7).max(0.0);
    // The poses that the robot reaches before it can stop.
    let blocked =
        [0.05, 0.1].iter().any(|&way_m| world.clearance(world_from_robot.ahead(way_m)) < BODY_RADIUS_M + MARGIN_M);
    let is_held = is_held(world, world_from_robot);
    let forward_m_s = if is_held || blocked && off_rad.abs() > 0.1 { 0.0 } else { CRUISE_M_S * share };
    Twist { forward_m_s, turn_rad_s }
}

/// True if the robot would come too near a door leaf or a person.
fn is_held(world: &World, world_from_robot: Pose2) -> bool {
    let here_m = world.moving_clearance(world_from_robot.position());
    here_m < 1.0
        && [0.05, 0.1, 0.2].iter().any(|&way_m| {
            let there_m = world.moving_clearance(world_from_robot.ahead(way_m));
            there_m < BODY_RADIUS_M + MOVING_MARGIN_M && there_m < here_m
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;
    use crate::robot::{Robot, STEP_S};

    /// The poses of a drive, ten per second.
    fn driven(world: &World, seed: u64, seconds: u32, odometry_errors: f64) -> Vec<Pose2> {
        let start = Pose2::new(world.start.x, world.start.y, world.start_heading_rad.unwrap_or(0.3));
        let mut robot = Robot::new(start, odometry_errors, Random::new(seed, Stream::Robot));
        let mut explorer = Explorer::new(world, Random::new(seed, Stream::Explore));
        let mut twist = Twist::default();
        let mut poses = Vec::new();
        for step in 0..seconds * 200 {
            if step % 10 == 0 {
                twist = explorer.command(world, robot.pose(1.0), f64::from(step) * STEP_S);
            }
            robot.step(twist);
            if step % 20 == 0 {
                poses.push(robot.pose(1.0));
            }
        }
        poses
    }

    #[test]
    fn the_robot_touches_nothing_and_keeps_moving() {
        let file = World::from_toml("corner", include_str!("../../../configs/worlds/corner.toml")).unwrap();
        let worlds = World::BUILT_IN.map(|name| World::named(name).unwrap());
        for world in worlds.iter().chain([&file]) {
            for seed in 0..3 {
                let poses = driven(world, seed, 300, [1.0, 3.0][usize::from(seed == 2)]);
                let nearest = poses.iter().map(|pose| world.clearance(pose.position())).fold(f64::INFINITY, f64::min);
                assert!(nearest > BODY_RADIUS_M, "{} seed {seed}: {nearest} m", world.name);
                // A rest: less than 2 cm in ten seconds.
                let rests = poses.windows(100).filter(|w| (w[0].position() - w[99].position()).norm() < 0.02).count();
                assert!(rests < 20, "{} seed {seed}: {rests} rests", world.name);
            }
        }
    }

    #[test]
    fn the_drive_covers_the_flat_in_ten_minutes() {
        let world = World::named("flat").unwrap();
        let poses = driven(&world, 1, 600, 1.0);
        for (x, y) in [(2.0, 2.0), (6.3, 2.0), (9.0, 2.0), (9.0, 5.0), (2.0, 6.7), (5.5, 7.0), (8.5, 7.0)] {
            let nearest = poses.iter().map(|p| (p.position() - Point::new(x, y)).norm()).fold(f64::INFINITY, f64::min);
            assert!(nearest < 1.0, "({x}, {y}) was never nearer than {nearest} m");
        }
    }
}
