//! Which frontier is next, and where the robot stands to see it.

use super::costmap::{Costmap, Kind};
use super::follow::bearing;
use super::frontier::Frontier;
use super::params::Params;
use super::plan::Reach;
use slamd_core::{Point, Pose2};

/// A frontier and the cell to see it from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Choice {
    /// The middle of the frontier.
    pub(crate) frontier: Point,
    /// Length of the frontier, metres.
    pub(crate) length_m: f64,
    /// Where to stand.
    pub(crate) stand: usize,
    /// Cost of the way there, metres.
    pub(crate) cost_m: f64,
}

/// The frontier of the greatest utility: near, long, ahead. Those into which the body fits come first, then gaps that it can look through: a
/// door may be behind a gap that the map draws too narrow.
pub(crate) fn best(
    map: &Costmap,
    reach: &Reach,
    frontiers: &[Frontier],
    pose: Pose2,
    is_wanted: impl Fn(Point) -> bool,
    params: &Params,
) -> Option<Choice> {
    let surely = best_of(map, reach, frontiers, pose, (params.min_frontier, 1), &is_wanted, params);
    surely.or_else(|| best_of(map, reach, frontiers, pose, (0, params.min_gap), &is_wanted, params))
}

/// The same among the frontiers with at least so many cells that the robot's body can reach, and so many in all.
fn best_of(
    map: &Costmap,
    reach: &Reach,
    frontiers: &[Frontier],
    pose: Pose2,
    least: (usize, usize),
    is_wanted: impl Fn(Point) -> bool,
    params: &Params,
) -> Option<Choice> {
    let wanted = frontiers.iter().filter(|frontier| is_wanted(map.centre(frontier.middle)));
    let choices = wanted.filter_map(|frontier| stand(map, reach, frontier, least, params));
    let loss = |choice: &Choice| {
        let there = map.centre(choice.stand);
        let toward = if (there - pose.position()).norm() > params.arrived_m { there } else { choice.frontier };
        choice.cost_m - params.gain_m * choice.length_m + params.ahead_m_rad * bearing(pose, toward).abs()
    };
    choices.min_by(|a, b| loss(a).total_cmp(&loss(b)))
}

/// The cheapest place from which a frontier is in view.
fn stand(map: &Costmap, reach: &Reach, frontier: &Frontier, least: (usize, usize), params: &Params) -> Option<Choice> {
    let entered = frontier.cells.iter().filter(|&&cell| map.is_open(cell) && reach.cost_m(cell).is_some()).count();
    if entered < least.0 || frontier.cells.len() < least.1 {
        return None;
    }
    let (middle, length_m) = (map.centre(frontier.middle), frontier.cells.len() as f64 * map.cell_m());
    let open = map.disc(middle, params.view_m).into_iter().filter(|&cell| map.is_open(cell));
    let places = open.filter_map(|cell| Some((cell, reach.cost_m(cell)?, (map.centre(cell) - middle).norm())));
    // Nearer shows more.
    let mut places: Vec<(usize, f64, f64)> = places.collect();
    places.sort_by(|a, b| (a.1 + params.near_gain * a.2).total_cmp(&(b.1 + params.near_gain * b.2)));
    let is_clear = |cell: usize| map.kind(cell) == Kind::Free;
    let view = places.into_iter().find(|&(cell, ..)| map.line(map.centre(cell), middle, is_clear));
    view.map(|(stand, cost_m, _)| Choice { frontier: middle, length_m, stand, cost_m })
}
