//! Where the robot drives: to the place not visited for longest, round everything in the way.
//!
//! This is a driver, not a part under test: it uses the truth.

use super::random::Random;
use super::robot::{BODY_RADIUS_M, Twist};
use super::route::RouteGrid;
use super::world::World;
use slamd_core::geometry::{Point, Pose2, wrap_angle};

/// Seconds between two commands.
pub const PERIOD_S: f64 = 0.05;
/// Cruising speed, metres per second.
const CRUISE_M_S: f64 = 0.3;
/// Fastest turn, radians per second.
const TURN_RAD_S: f64 = 1.0;
/// Farthest point of the way that is aimed at, metres.
const LOOK_AHEAD_M: f64 = 0.5;
/// Nearest that the body may come to a surface, metres.
const MARGIN_M: f64 = 0.03;
/// Places drawn when a new goal is chosen.
const CANDIDATES: usize = 40;
/// A visit counts for every place within this distance, metres.
const VISIT_M: f64 = 0.7;
/// Seconds after which a goal that was not reached is given up.
const PATIENCE_S: f64 = 120.0;

/// The driver.
#[derive(Clone, Debug)]
pub struct Explorer {
    grid: RouteGrid,
    /// Seconds at which each cell was last visited; negative for never.
    visited_s: Vec<f64>,
    /// The rest of the way, nearest place first.
    way: Vec<Point>,
    next: usize,
    chosen_s: f64,
    random: Random,
}

impl Explorer {
    /// A driver for `world`.
    #[must_use]
    pub fn new(world: &World, random: Random) -> Self {
        let grid = RouteGrid::new(world);
        let visited_s = vec![-1.0; grid.len()];
        Self { grid, visited_s, way: Vec::new(), next: 0, chosen_s: 0.0, random }
    }

    /// What to do for the next [`PERIOD_S`], at the true pose and `now_s` seconds into the drive.
    pub fn command(&mut self, world: &World, world_from_robot: Pose2, now_s: f64) -> Twist {
        let here = world_from_robot.position();
        self.visit(here, now_s);
        while self.next + 1 < self.way.len() && self.sees(world, here, self.way[self.next + 1]) {
            self.next += 1;
        }
        let arrived = self.way.last().is_none_or(|&goal| (goal - here).norm() < 0.15);
        if arrived || now_s > self.chosen_s + PATIENCE_S {
            self.choose(here, now_s);
        }
        self.way.get(self.next).map_or_else(Twist::default, |&aim| drive(world, world_from_robot, aim))
    }

    /// True where the body can go straight from `here` to the near point `aim`.
    fn sees(&self, world: &World, here: Point, aim: Point) -> bool {
        let steps = 5;
        (aim - here).norm() < LOOK_AHEAD_M
            && (1..=steps).all(|step| {
                let place = here + (aim - here) * (f64::from(step) / f64::from(steps));
                world.clearance(place) > BODY_RADIUS_M + 2.0 * MARGIN_M
            })
    }

    fn visit(&mut self, here: Point, now_s: f64) {
        for (cell, visited_s) in self.visited_s.iter_mut().enumerate() {
            if (self.grid.middle(cell) - here).norm_squared() < VISIT_M * VISIT_M {
                *visited_s = now_s;
            }
        }
    }

    /// Picks the next goal: of the places drawn the nearest that was never visited, else the one visited longest ago.
    fn choose(&mut self, here: Point, now_s: f64) {
        let routes = self.grid.routes(here);
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
        self.way = best.map_or_else(Vec::new, |(_, goal)| {
            routes.way(goal).into_iter().map(|cell| self.grid.middle(cell)).collect()
        });
        self.next = 0;
        self.chosen_s = now_s;
    }
}

/// Turns towards `aim` and drives there, slower the more it has to turn, and never into a surface.
fn drive(world: &World, world_from_robot: Pose2, aim: Point) -> Twist {
    let offset = aim - world_from_robot.position();
    let off_rad = wrap_angle(libm::atan2(offset.y, offset.x) - world_from_robot.theta_rad);
    let turn_rad_s = (2.5 * off_rad).clamp(-TURN_RAD_S, TURN_RAD_S);
    let share = (1.0 - off_rad.abs() / 0.7).max(0.0);
    // Where the robot would be before it could stop.
    let blocked =
        [0.05, 0.1].iter().any(|&way_m| world.clearance(world_from_robot.ahead(way_m)) < BODY_RADIUS_M + MARGIN_M);
    let forward_m_s = if blocked && off_rad.abs() > 0.1 { 0.0 } else { CRUISE_M_S * share };
    Twist { forward_m_s, turn_rad_s }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;
    use crate::robot::{Robot, STEP_S};

    /// The poses of a drive, ten a second.
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
    fn the_robot_never_touches_anything_and_never_rests_long() {
        let file = World::from_toml("corner", include_str!("../../../configs/worlds/corner.toml")).unwrap();
        let worlds = World::BUILT_IN.map(|name| World::named(name).unwrap());
        for world in worlds.iter().chain([&file]) {
            for seed in 0..3 {
                let poses = driven(world, seed, 300, [1.0, 3.0][usize::from(seed == 2)]);
                let nearest = poses.iter().map(|pose| world.clearance(pose.position())).fold(f64::INFINITY, f64::min);
                assert!(nearest > BODY_RADIUS_M, "{} seed {seed}: {nearest} m", world.name);
                // Within ten seconds it has moved on.
                let rests = poses.windows(100).filter(|w| (w[0].position() - w[99].position()).norm() < 0.02).count();
                assert!(rests < 20, "{} seed {seed}: {rests} rests", world.name);
            }
        }
    }

    #[test]
    fn the_flat_is_covered_in_ten_minutes() {
        let world = World::named("flat").unwrap();
        let poses = driven(&world, 1, 600, 1.0);
        for (x, y) in [(2.0, 2.0), (6.3, 2.0), (9.0, 2.0), (9.0, 5.0), (2.0, 6.7), (5.5, 7.0), (8.5, 7.0)] {
            let nearest = poses.iter().map(|p| (p.position() - Point::new(x, y)).norm()).fold(f64::INFINITY, f64::min);
            assert!(nearest < 1.0, "({x}, {y}) was never nearer than {nearest} m");
        }
    }
}
