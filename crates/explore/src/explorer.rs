//! The strategy.

use super::choice::{Choice, best};
use super::costmap::{Costmap, Kind};
use super::follow::{Twist, aim, bearing, towards};
use super::frontier::{Frontier, frontiers};
use super::goal::{Goal, Purpose};
use super::memory::Memory;
use super::params::Params;
use super::plan::{Reach, way};
use super::reaction::{Outcome, Reaction, seconds};
use super::report::{Command, Report, Status};
use slamd_core::{Beam, Estimate, Point, Pose2, Raster, Timestamp};

/// What the estimator knows now.
#[derive(Clone, Copy, Debug)]
pub struct Observation<'a> {
    /// Session time.
    pub at: Timestamp,
    /// The newest pose; none before the first.
    pub estimate: Option<&'a Estimate>,
    /// The pose cannot be relied on.
    pub is_uncertain: bool,
    /// Where the healthy sensors' newest echoes came from, metres in the robot frame.
    pub echoes: &'a [Point],
    /// The map, where [`Explorer::wants_map`] asked for it.
    pub map: Option<&'a Raster>,
}

/// Explores a building by its own map.
#[derive(Debug)]
pub struct Explorer {
    params: Params,
    home: Point,
    memory: Memory,
    reaction: Reaction,
    map: Option<(Costmap, Vec<Frontier>, Timestamp)>,
    goal: Option<Goal>,
    uncertain_since: Option<Timestamp>,
    /// The way at the last return to known walls, metres.
    revisited_m: f64,
    home_tries: u32,
    /// No goal before this time: nothing leads home now.
    pause_until: Timestamp,
    report: Option<Report>,
}

impl Explorer {
    /// An explorer that ends at `home`, map frame; the map's origin is where the robot started.
    #[must_use]
    pub fn new(params: Params, home: Point) -> Self {
        Self {
            params,
            home,
            memory: Memory::default(),
            reaction: Reaction::default(),
            map: None,
            goal: None,
            uncertain_since: None,
            revisited_m: 0.0,
            home_tries: 0,
            pause_until: Timestamp::default(),
            report: None,
        }
    }

    /// The next observation shall have the map.
    #[must_use]
    pub fn wants_map(&self, at: Timestamp) -> bool {
        self.report.is_none()
            && self.map.as_ref().is_none_or(|(.., drawn)| at.seconds_since(*drawn) >= self.params.map_period_s)
    }

    /// What was explored, at the end.
    #[must_use]
    pub const fn report(&self) -> Option<&Report> {
        self.report.as_ref()
    }

    /// The strategy. Without a reliable pose the robot stands, then looks around slowly by its echoes alone. With one it looks at the
    /// frontiers of its map one after the other: the near, the long, those ahead first. It drives there on the cheapest way through a
    /// costmap, by pure pursuit. What stands in the way makes it slower, stop, wait, back off and plan anew; a frontier that it failed to
    /// reach several times is given up. After a long way with a growing error it returns to walls that it knows well before it goes on.
    /// When no frontier is left it goes home and says what it explored.
    pub fn command(&mut self, now: &Observation<'_>) -> Command {
        let Some((estimate, pose)) = self.reliable_pose(now) else { return self.find_pose(now) };
        self.memory.been(pose);
        self.take_map(now);
        if self.report.is_some() {
            return stand(Status::Done);
        }
        if now.at < self.pause_until {
            let twist = self.reaction.wander(now.at, now.echoes, &self.params);
            return Command { twist, uses_pose: true, status: Status::LeavingTrap };
        }
        if self.goal.is_none() {
            self.goal = self.choose(now.at, pose, sigma_m(estimate));
        }
        let wanted = self.pursue(now.at, pose);
        self.react(now, pose, wanted)
    }

    fn reliable_pose<'a>(&mut self, now: &Observation<'a>) -> Option<(&'a Estimate, Pose2)> {
        let estimate = now.estimate.filter(|_| !now.is_uncertain)?;
        self.uncertain_since = None;
        Some((estimate, estimate.pose))
    }

    /// Stands where the pose has just become uncertain, then looks around.
    fn find_pose(&mut self, now: &Observation<'_>) -> Command {
        self.goal = None;
        let since = *self.uncertain_since.get_or_insert(now.at);
        let is_new = now.estimate.is_some() && now.at.seconds_since(since) < self.params.uncertain_s;
        let twist = if is_new { Twist::default() } else { self.reaction.wander(now.at, now.echoes, &self.params) };
        Command { twist, uses_pose: false, status: Status::FindingPose }
    }

    /// Draws the costmap. A goal whose frontier is no longer there is reached; ways are planned anew.
    fn take_map(&mut self, now: &Observation<'_>) {
        let Some(raster) = now.map.filter(|raster| !raster.occupancy.is_empty()) else { return };
        let blocks = self.memory.blocks(now.at);
        let map = Costmap::new(raster, &blocks, &self.memory.trail, &self.params);
        let found = frontiers(&map, self.params.min_frontier, self.params.max_frontier);
        if let Some(goal) = &mut self.goal {
            goal.way.clear();
            let stays = |middle: Point| {
                let near = |&cell: &usize| (map.centre(cell) - middle).norm() < self.params.stay_m;
                found.iter().any(|frontier| frontier.cells.iter().any(near))
            };
            if goal.frontier().is_some_and(|middle| !stays(middle)) || goal.purpose == Purpose::Home {
                self.goal = None;
            }
        }
        self.map = Some((map, found, now.at));
    }

    /// The next goal; none while the robot waits for one.
    fn choose(&mut self, at: Timestamp, pose: Pose2, sigma_m: f64) -> Option<Goal> {
        let (map, found, _) = self.map.as_ref()?;
        let reach = Reach::new(map, map.cell(pose.position())?, self.params.escape_m);
        let until = |cost_m: f64| at + seconds(self.params.patience_s + 4.0 * cost_m / self.params.speed_m_s);
        if sigma_m > self.params.revisit_sigma_m && self.memory.way_m > self.revisited_m + self.params.revisit_way_m {
            self.revisited_m = self.memory.way_m;
            return Some(Goal::new(Purpose::Revisit, self.home, until(self.memory.way_m)));
        }
        let wants = |frontier| self.memory.wants(frontier, at, &self.params);
        if let Some(Choice { frontier: middle, stand, cost_m, .. }) =
            best(map, &reach, found, pose, wants, &self.params)
        {
            return Some(Goal::new(Purpose::Frontier(middle), map.centre(stand), until(cost_m)));
        }
        let wants_later = |frontier| self.memory.wants_later(frontier, &self.params);
        if best(map, &reach, found, pose, wants_later, &self.params).is_some() {
            return None;
        }
        Some(Goal::new(Purpose::Home, self.place_near_home(map, &reach), until(self.memory.way_m)))
    }

    /// Home, or the place nearest to it where it is taken.
    fn place_near_home(&self, map: &Costmap, reach: &Reach) -> Point {
        let nearest = reach.nearest(map, self.home, self.params.near_home_m).map(|cell| map.centre(cell));
        nearest.filter(|place| (place - self.home).norm() > map.cell_m()).unwrap_or(self.home)
    }

    /// The velocity that leads to the goal, without regard to what is in the way now.
    fn pursue(&mut self, at: Timestamp, pose: Pose2) -> Twist {
        let (Some(goal), Some((map, ..))) = (&mut self.goal, &self.map) else { return Twist::default() };
        let params = &self.params;
        let here = pose.position();
        if let (true, Some(frontier)) = (goal.is_looking, goal.frontier()) {
            let off_rad = bearing(pose, frontier);
            if goal.faced.is_none() && off_rad.abs() > 0.15 {
                let turn_rad_s = (params.turn_gain * off_rad).clamp(-params.turn_rad_s, params.turn_rad_s);
                return Twist { forward_m_s: 0.0, turn_rad_s };
            }
            let since = *goal.faced.get_or_insert(at);
            if at.seconds_since(since) > params.look_s {
                self.end_look();
            }
            return Twist::default();
        }
        let arrived_m = if goal.purpose == Purpose::Home { params.home_m } else { params.arrived_m };
        if (goal.stand - here).norm() < arrived_m {
            self.arrive();
            return Twist::default();
        }
        if at > goal.until {
            self.fail(at);
            return Twist::default();
        }
        if goal.way.is_empty() {
            let ends = map.cell(here).zip(nearest_open(map, goal.stand, params));
            goal.way = ends.and_then(|(start, end)| way(map, start, end, params.escape_m)).unwrap_or_default();
            if let Some(last) = goal.way.last_mut().filter(|last| (**last - goal.stand).norm() < map.cell_m()) {
                *last = goal.stand;
            }
        }
        match aim(map, &goal.way, here, params) {
            Some(point) => towards(pose, point, goal.way.last().copied().unwrap_or(point), params),
            None => {
                self.fail(at);
                Twist::default()
            }
        }
    }

    /// What the echoes permit of the wanted velocity.
    fn react(&mut self, now: &Observation<'_>, pose: Pose2, wanted: Twist) -> Command {
        let status = self.goal.as_ref().map_or(Status::Waiting, Goal::status);
        let command = |twist, status| Command { twist, uses_pose: true, status };
        match self.reaction.react(now.at, pose, wanted, now.echoes, &self.params) {
            Outcome::Drive(twist) => command(twist, status),
            Outcome::BackingOff(twist) => command(twist, Status::BackingOff),
            Outcome::Blocked(twist) => {
                self.look_from_here(pose);
                command(twist, Status::Waiting)
            }
            Outcome::GaveUp(echo) => {
                self.memory.block(pose.transform(echo), now.at + seconds(self.params.block_s));
                let is_over = self.goal.as_mut().is_some_and(|goal| {
                    goal.blocks += 1;
                    goal.way.clear();
                    goal.blocks > self.params.max_blocks
                });
                if is_over {
                    self.fail(now.at);
                }
                self.forget_map();
                command(Twist::default(), Status::BackingOff)
            }
        }
    }

    /// Where something is in the way, the frontier may be in view already.
    fn look_from_here(&mut self, pose: Pose2) {
        let (Some(goal), Some((map, ..))) = (&mut self.goal, &self.map) else { return };
        let is_clear = |cell: usize| map.kind(cell) == Kind::Free;
        let in_view = |frontier: Point| {
            (frontier - pose.position()).norm() < self.params.view_m && map.line(pose.position(), frontier, is_clear)
        };
        if goal.frontier().is_some_and(in_view) {
            goal.is_looking = true;
        }
    }

    fn arrive(&mut self) {
        let Some(goal) = &mut self.goal else { return };
        match goal.purpose {
            Purpose::Frontier(_) => goal.is_looking = true,
            Purpose::Revisit => self.goal = None,
            Purpose::Home => self.end(true),
        }
    }

    fn end_look(&mut self) {
        match self.goal.take().map(|goal| goal.purpose) {
            Some(Purpose::Frontier(middle)) => self.memory.looked(middle),
            Some(Purpose::Revisit | Purpose::Home) | None => {}
        }
    }

    fn fail(&mut self, at: Timestamp) {
        match self.goal.take().map(|goal| goal.purpose) {
            Some(Purpose::Frontier(middle)) => self.memory.failed(middle, at, &self.params),
            Some(Purpose::Home) => {
                self.home_tries += 1;
                self.pause_until = at + seconds(self.params.pause_s);
                if self.home_tries > self.params.max_blocks {
                    self.end(false);
                }
            }
            Some(Purpose::Revisit) | None => {}
        }
    }

    fn end(&mut self, is_home: bool) {
        let Some((map, found, _)) = &self.map else { return };
        let start = map.cell(self.memory.trail.last().copied().unwrap_or(self.home));
        let reach = start.map(|start| Reach::new(map, start, self.params.escape_m));
        let floor = (0..map.len()).filter(|&cell| map.kind(cell) == Kind::Free);
        let is_seen = |cell: &usize| reach.as_ref().is_some_and(|reach| reach.is_beside(map, *cell, &self.params));
        let given_up = found.iter().map(|frontier| map.centre(frontier.middle));
        let given_up: Vec<Point> = given_up.filter(|middle| self.memory.is_given_up(*middle, &self.params)).collect();
        let mut unreachable: Vec<Point> = Vec::new();
        for place in given_up {
            if unreachable.iter().all(|other| (other - place).norm() > self.params.view_m) {
                unreachable.push(place);
            }
        }
        let explored_m2 = floor.filter(is_seen).count() as f64 * map.cell_m() * map.cell_m();
        self.report = Some(Report { explored_m2, unreachable, is_home });
        self.goal = None;
    }

    fn forget_map(&mut self) {
        if let Some((.., drawn)) = &mut self.map {
            *drawn = Timestamp::default();
        }
    }
}

/// Where a beam's echo came from, metres in the robot frame; what is too close to measure counts as at the sensor. None without an echo.
#[must_use]
pub fn echo(beam: &Beam) -> Option<Point> {
    let is_too_close = beam.range_m.is_infinite() && beam.range_m < 0.0;
    beam.endpoint().or_else(|| is_too_close.then(|| beam.robot_from_sensor.position()))
}

fn stand(status: Status) -> Command {
    Command { twist: Twist::default(), uses_pose: false, status }
}

/// The cell nearest to a place where the robot's middle may be.
fn nearest_open(map: &Costmap, place: Point, params: &Params) -> Option<usize> {
    let off = |cell: &usize| (map.centre(*cell) - place).norm();
    let cells = map.disc(place, params.escape_m).into_iter().filter(|&cell| map.is_passable(cell));
    cells.min_by(|a, b| off(a).total_cmp(&off(b))).or_else(|| map.cell(place))
}

/// One standard deviation of the position, metres.
fn sigma_m(estimate: &Estimate) -> f64 {
    let [x, y] = [0, 1].map(|axis| estimate.covariance.get((axis, axis)).copied().unwrap_or(0.0));
    (x + y).max(0.0).sqrt()
}
