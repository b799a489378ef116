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
    /// No way leads into its view: the robot goes as near as it can, in case a door opens.
    pub(crate) is_beyond: bool,
}

/// The frontier of the greatest utility: near, long, ahead. Those that cannot be seen from anywhere come last.
pub(crate) fn best(
    map: &Costmap,
    reach: &Reach,
    frontiers: &[Frontier],
    pose: Pose2,
    is_wanted: impl Fn(Point) -> bool,
    params: &Params,
) -> Option<Choice> {
    let wanted = frontiers.iter().filter(|frontier| is_wanted(map.centre(frontier.middle)));
    let choices = wanted.filter_map(|frontier| stand(map, reach, frontier, params));
    let loss = |choice: &Choice| {
        let there = map.centre(choice.stand);
        let toward = if (there - pose.position()).norm() > params.arrived_m { there } else { choice.frontier };
        let beyond = if choice.is_beyond { 1e3 } else { 0.0 };
        beyond + choice.cost_m - params.gain_m * choice.length_m + params.ahead_m_rad * bearing(pose, toward).abs()
    };
    choices.min_by(|a, b| loss(a).total_cmp(&loss(b)))
}

/// The cheapest place from which a frontier is in view.
fn stand(map: &Costmap, reach: &Reach, frontier: &Frontier, params: &Params) -> Option<Choice> {
    let middle = map.centre(frontier.middle);
    let length_m = frontier.cells.len() as f64 * map.cell_m();
    let choice = |stand, cost_m, is_beyond| Choice { frontier: middle, length_m, stand, cost_m, is_beyond };
    let open = |radius_m: f64| {
        let cells = map.disc(middle, radius_m).into_iter().filter(|&cell| map.is_open(cell));
        cells.filter_map(|cell| Some((cell, reach.cost_m(cell)?, (map.centre(cell) - middle).norm())))
    };
    // Nearer shows more: half a metre nearer is worth half a metre of way.
    let mut seen: Vec<(usize, f64, f64)> = open(params.view_m).collect();
    seen.sort_by(|a, b| (a.1 + a.2).total_cmp(&(b.1 + b.2)));
    let is_clear = |cell: usize| map.kind(cell) == Kind::Free;
    let view = seen.into_iter().find(|&(cell, ..)| map.line(map.centre(cell), middle, is_clear));
    if let Some((cell, cost_m, _)) = view {
        return Some(choice(cell, cost_m, false));
    }
    if length_m < params.told_m {
        return None;
    }
    let nearest = open(params.beyond_m).min_by(|a, b| a.2.total_cmp(&b.2));
    nearest.map(|(cell, cost_m, _)| choice(cell, cost_m, true))
}
