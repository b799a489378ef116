//! What moves in a home: doors by their timetables, people on their errands.

use super::Home;
use crate::random::Random;
use crate::route::RouteGrid;
use crate::world::World;
use slamd_core::Point;

/// Seconds in which a door opens or closes.
const SWING_S: f64 = 1.5;
/// A door holds while the robot's centre is within its width and this much of the hinge, metres.
const DOOR_DISTANCE_M: f64 = 0.3;
/// A person within this distance of a door opens it, metres.
const OPENS_AT_M: f64 = 1.0;
/// Walking speed, metres per second.
const WALK_M_S: f64 = 0.8;
/// Minimum distance between a person's centre and the robot's, metres.
const ROBOT_DISTANCE_M: f64 = 0.45;
/// A person who waits longer for the robot goes elsewhere, seconds.
const PATIENCE_S: f64 = 3.0;
/// Minimum and maximum rest at each goal, seconds.
const REST_S: (f64, f64) = (2.0, 25.0);

/// Moves the doors and people of one home.
#[derive(Clone, Debug)]
pub(crate) struct Life {
    grid: RouteGrid,
    walkers: Vec<Walker>,
    random: Random,
}

/// One person's errand.
#[derive(Clone, Debug, Default)]
struct Walker {
    route: Vec<Point>,
    next: usize,
    rest_until_s: f64,
    waits_s: f64,
}

impl Life {
    pub(crate) fn new(world: &World, home: &Home, random: Random) -> Self {
        Self { grid: RouteGrid::new(world), walkers: vec![Walker::default(); home.people.len()], random }
    }

    /// Moves everything by `step_s` seconds. Nothing moves into the robot.
    pub(crate) fn step(&mut self, home: &mut Home, robot: Point, now_s: f64, step_s: f64) {
        let Home { doors, people, .. } = home;
        for door in doors {
            let is_opened = people.iter().any(|person| (person - door.middle()).norm() < OPENS_AT_M);
            let wanted = if door.is_to_close(now_s) && !is_opened { 0.0 } else { 1.0 };
            if (robot - door.hinge).norm() > door.width_m + DOOR_DISTANCE_M {
                door.openness += (wanted - door.openness).clamp(-step_s / SWING_S, step_s / SWING_S);
            }
        }
        for (walker, person) in self.walkers.iter_mut().zip(people) {
            if now_s < walker.rest_until_s {
                continue;
            }
            let Some(&aim) = walker.route.get(walker.next) else {
                walker.choose(&self.grid, *person, &mut self.random);
                walker.rest_until_s = now_s + self.random.uniform(REST_S.0, REST_S.1);
                continue;
            };
            let offset = aim - *person;
            let way_m = WALK_M_S * step_s;
            if offset.norm() <= way_m {
                walker.next += 1;
                continue;
            }
            let there = *person + offset.normalize() * way_m;
            let (before_m, after_m) = ((*person - robot).norm(), (there - robot).norm());
            if after_m < ROBOT_DISTANCE_M && after_m < before_m {
                walker.waits_s += step_s;
                if walker.waits_s > PATIENCE_S {
                    walker.choose(&self.grid, *person, &mut self.random);
                }
            } else {
                *person = there;
                walker.waits_s = 0.0;
            }
        }
    }
}

impl Walker {
    /// Picks a goal that can be reached from `here`.
    fn choose(&mut self, grid: &RouteGrid, here: Point, random: &mut Random) {
        let routes = grid.routes(here);
        let goals = (0..30).map(|_| random.below(grid.len()));
        let goal = goals.filter(|&cell| routes.cost(cell).is_some_and(|cost| cost > 1_000)).last();
        let cells = goal.map_or_else(Vec::new, |goal| routes.route(goal));
        self.route = cells.into_iter().map(|cell| grid.middle(cell)).collect();
        (self.next, self.waits_s) = (0, 0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    #[test]
    fn people_walk_doors_swing_and_nothing_touches_the_robot() {
        let seed = (1..40).find(|&seed| {
            let home = World::random(seed).home.unwrap();
            !home.people.is_empty() && !home.doors.is_empty()
        });
        let world = World::random(seed.unwrap());
        let mut home = *world.home.clone().unwrap();
        let mut life = Life::new(&world, &home, Random::new(1, Stream::Life));
        let (mut walked_m, mut swung, mut nearest_m) = (0.0, 0.0, f64::INFINITY);
        for step in 0..40_000 {
            let before = home.clone();
            life.step(&mut home, world.start, f64::from(step) * 0.005, 0.005);
            walked_m += (home.people[0] - before.people[0]).norm();
            swung += (home.doors[0].openness - before.doors[0].openness).abs();
            nearest_m = home.people.iter().map(|person| (person - world.start).norm()).fold(nearest_m, f64::min);
        }
        assert!(walked_m > 20.0, "{walked_m} m");
        assert!(swung > 1.9, "{swung}");
        assert!(nearest_m > ROBOT_DISTANCE_M - 1e-9, "{nearest_m} m");
    }
}
