//! The map that a lost robot draws from the place where it was lost, in a frame of its own, until it can be laid out on the map before.
//!
//! It is a whole [`WallSlam`], so its walls stay sharp over any way. Each metre or so it is matched with the map before as a whole.

use super::place::field::Field;
use super::place::map_match::{Join, MapMatch};
use super::place::search::PlaceSearch;
use super::stages::Stages;
use super::{Mode, WallSlam};
use crate::event::Event;
use crate::geometry::Pose2;
use crate::mapping::grid::OccupancyGrid;
use crate::sweep::Sweep;

/// The map since the loss.
#[derive(Debug)]
pub(super) struct LocalMap {
    slam: WallSlam,
    matching: Option<MapMatch>,
    /// The last match, and the way at its end, metres.
    finished: Option<(MapMatch, f64)>,
    /// The map shows too little to be matched.
    is_sparse: bool,
    /// The place that the last match found.
    last: Option<Join>,
    /// How many places the last match found alike, and whether it was told that they are several.
    places: usize,
    has_told: bool,
    /// The next match begins at this way of the robot, metres.
    next_m: f64,
    /// The way at which the robot was last found in this map, metres.
    tracked_m: f64,
    scratch: Vec<Event>,
}

impl LocalMap {
    /// An empty map; none for a robot that is lost in such a map itself.
    pub(super) fn begin(stages: &Stages) -> Option<Box<Self>> {
        let stages = stages.for_local_map()?;
        let way_m = stages.trail.way_m();
        let slam = WallSlam { stages, mode: Mode::default() };
        let next_m = way_m + slam.stages.place_params.join.every_m;
        Some(Box::new(Self {
            slam,
            matching: None,
            finished: None,
            is_sparse: true,
            last: None,
            places: 0,
            has_told: false,
            next_m,
            tracked_m: way_m,
            scratch: Vec::new(),
        }))
    }

    /// Draws a sweep and matches a little farther. The join of the maps, once one is sure.
    pub(super) fn update(&mut self, sweep: &Sweep, search: &PlaceSearch, stages: &Stages) -> Option<Join> {
        let (params, way_m) = (&stages.place_params.join, stages.trail.way_m());
        self.slam.update(sweep, &mut self.scratch);
        // Poses in this map's frame, and its changes, mean nothing outside.
        self.scratch.clear();
        if matches!(self.slam.mode, Mode::Tracking(_) | Mode::Initializing(_)) {
            self.tracked_m = way_m;
        } else if way_m > self.tracked_m + params.new_map_after_m {
            if let Some(fresh) = Self::begin(stages) {
                *self = *fresh;
            }
            return None;
        }
        let old = search.field();
        if let Some(mut matching) = self.matching.take() {
            let Some(matched) = matching.step(old, params) else {
                self.matching = Some(matching);
                return None;
            };
            self.places = matched.places;
            let is_tracking = self.is_tracking();
            let found = matched.best.filter(|_| matched.is_sure);
            let last = std::mem::replace(&mut self.last, found);
            self.finished = Some((matching, way_m));
            return found.filter(|found| {
                is_tracking
                    && self.is_on_floor(*found, old, stages)
                    && last.is_some_and(|last| last.is_near(found, params.same_join_cells))
            });
        }
        if way_m >= self.next_m && self.is_tracking() {
            self.next_m = way_m + params.every_m;
            self.matching = MapMatch::new(old, &Field::new(&self.slam.stages.grid, &stages.place_params), params);
            self.is_sparse = self.matching.is_none();
        }
        None
    }

    /// Whether a robot at `pose` of the map before may be in this map where it is: the join of the maps, or none if they do not fit so, or
    /// fit elsewhere as well. The outer option is none while that is open.
    #[expect(clippy::option_option, reason = "no answer yet, and no")]
    pub(super) fn confirm(&mut self, pose: Pose2, search: &PlaceSearch, stages: &Stages) -> Option<Option<Join>> {
        let (params, way_m) = (&stages.place_params.join, stages.trail.way_m());
        let local = self.pose().filter(|_| self.is_tracking())?;
        let is_fresh = |(_, ended_m): &&(MapMatch, f64)| way_m < ended_m + params.every_m;
        let Some((matching, _)) = self.finished.as_ref().filter(is_fresh) else {
            self.next_m = way_m;
            return None;
        };
        let old = search.field();
        let join = Join::between(pose, local, stages.grid.cell_m(), params);
        Some(join.and_then(|join| matching.confirm(old, join, params)))
    }

    /// True if the robot stands on free floor of the map before.
    fn is_on_floor(&self, join: Join, old: &Field, stages: &Stages) -> bool {
        let pose = self.pose().map(|pose| join.transform(stages.grid.cell_m()) * pose);
        pose.is_some_and(|pose| old.is_floor(pose.position()))
    }

    /// True while the map shows too little to tell places apart.
    pub(super) const fn is_sparse(&self) -> bool {
        self.is_sparse
    }

    const fn is_tracking(&self) -> bool {
        matches!(self.slam.mode, Mode::Tracking(_))
    }

    /// How many places look like this map, if several do and that was not told yet.
    pub(super) fn ambiguity(&mut self) -> Option<usize> {
        let is_ambiguous = self.places > 1;
        let is_new = is_ambiguous && !self.has_told;
        // A single match between two ambiguous ones is no news.
        self.has_told |= is_ambiguous;
        is_new.then_some(self.places)
    }

    /// The robot in this map.
    pub(super) fn pose(&self) -> Option<Pose2> {
        self.slam.pose()
    }

    /// What was drawn.
    pub(super) const fn grid(&self) -> &OccupancyGrid {
        &self.slam.stages.grid
    }
}
