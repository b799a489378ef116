//! Localise only: the robot's place in a building that is known, from a start that is not.
//!
//! 1. While the place is unknown the walls method makes a small map of its own, as it always does: its frame is the building's but
//!    for a quarter turn and a translation.
//! 2. Every half metre the small map is laid onto the known one ([`search`]): four headings, all translations.
//! 3. The best place is believed when it explains nearly all of what was heard, when no other place does so nearly as well, and when
//!    the search before said the same. Until then the position is unknown, and the robot says so instead of guessing.
//! 4. From there on the walls method follows the robot among the known walls; map and walls stay as they are.

mod known_map;
pub mod search;

use crate::config::Config;
use crate::event::{
    Calibration, Event, KnownMapSearch, LocalizationChange, LocalizationEvent, SearchState, SensorState, Verdict,
};
use crate::geometry::{Pose2, Ring, Segment, wrap_angle};
use crate::mapping::grid::{MapChange, OccupancyGrid};
use crate::mapping::raster::Raster;
use crate::pipeline::Estimator;
use crate::position::ekf_slam::Association;
use crate::saved_state::{InvalidState, SavedState};
use crate::sweep::Sweep;
use crate::time::Timestamp;
use crate::wall_slam::WallSlam;
use search::{Found, Place, Searcher};

/// The method at work.
#[derive(Debug)]
pub struct Localizer {
    config: Config,
    ring: Ring,
    memory: Box<SavedState>,
    known: Raster,
    searcher: Searcher,
    walls: Box<WallSlam>,
    is_found: bool,
    /// The place that the last search believed in.
    before: Option<Place>,
    driven_s: f64,
    moved_m: f64,
    has_begun: bool,
    has_complained: bool,
    /// Start of the current search.
    searching_since: Timestamp,
    /// The running share of sweeps that recognised a wall.
    recognised: f64,
    scratch: Vec<Event>,
}

/// From one search to the next, metres; a radian of turning counts as half a metre.
const SEARCH_M: f64 = 0.5;
const M_PER_RAD: f64 = 0.5;
/// A map that is wider is not searched: 200 m by 200 m of 5 cm cells, for which the search takes 270 MB.
const MAX_CELLS: usize = 1 << 24;
/// A new map with fewer solid cells says nothing yet: three metres of wall.
const MIN_SOLID: usize = 60;
/// The least fit that is believed, and how far the second best place must stay behind.
const MIN_FIT: f64 = 0.55;
const MARGIN: f64 = 0.15;
/// Two searches agree within this.
const AGREE_M: f64 = 0.25;
/// How well the place found is known, metres.
const FOUND_SIGMA_M: f64 = 0.08;
/// After so much driving without a place somebody is told.
const PATIENCE_S: f64 = 60.0;
/// Below this share of recognising sweeps, over the last hundred or so, the place is lost.
const LOST_SHARE: f64 = 0.1;
const FORGET: f64 = 0.02;
/// A sweep that rolled less than this stood still, metres.
const STILL_M: f64 = 1e-3;

impl Localizer {
    /// A robot anywhere in the remembered building.
    ///
    /// # Errors
    /// Where the memory holds what cannot be.
    pub fn new(config: &Config, ring: &Ring, memory: &SavedState) -> Result<Self, InvalidState> {
        let known = OccupancyGrid::restore(&memory.map)?.raster();
        if known.occupancy.len() > MAX_CELLS {
            return Err(InvalidState("the map is too wide to be searched for the robot"));
        }
        let mut config = config.clone();
        // Both maps have cells of one size, and the wheels are those of the last drive.
        config.map.cell_m = memory.map.cell_m;
        let walls = WallSlam::new(&config, ring);
        WallSlam::new(&config, ring).localized(memory, Pose2::default(), FOUND_SIGMA_M)?;
        Ok(Self {
            ring: ring.clone(),
            memory: Box::new(memory.clone()),
            searcher: Searcher::new(&known),
            known,
            walls: Box::new(walls),
            config,
            is_found: false,
            before: None,
            driven_s: 0.0,
            moved_m: 0.0,
            has_begun: false,
            searching_since: Timestamp::default(),
            has_complained: false,
            recognised: 1.0,
            scratch: Vec::new(),
        })
    }

    fn search(&mut self, at: Timestamp, events: &mut Vec<Event>) -> Option<Found> {
        let pose = self.walls.pose()?;
        let found = self.searcher.find(&self.walls.raster(), MIN_SOLID, MARGIN);
        let believed = found.filter(|found| found.best.fit >= MIN_FIT && found.rival.is_none());
        let before = std::mem::replace(&mut self.before, believed.map(|found| found.best));
        let agreed = believed.map(|found| found.best).filter(|best| before.is_some_and(|before| best.agrees(&before)));
        if let Some(place) = agreed {
            self.begin(at, place, place.transform * pose, events);
        }
        found
    }

    fn begin(&mut self, at: Timestamp, place: Place, pose: Pose2, events: &mut Vec<Event>) {
        let fresh = WallSlam::new(&self.config, &self.ring);
        let local = std::mem::replace(&mut *self.walls, fresh);
        // What was restored once can be restored again.
        let Ok(walls) = local.localized(&self.memory, pose, FOUND_SIGMA_M) else { return };
        *self.walls = walls;
        (self.is_found, self.recognised, self.before) = (true, 1.0, None);
        let reason = format!(
            "position found after {:.0} s of driving: {:.2}, {:.2} m, {:.0} degrees; the map explains {:.0} % of what was heard",
            self.driven_s,
            pose.x_m,
            pose.y_m,
            pose.theta_rad.to_degrees(),
            100.0 * place.fit
        );
        self.tell(at, SearchState::Found, reason, events);
    }

    /// A robot that recognises nothing any more is not where it is believed to be, nor is one that fits nowhere among the walls.
    fn watch(&mut self, at: Timestamp, is_abandoned: bool, events: &mut Vec<Event>) {
        let associations = self.walls.associations();
        let hears = associations.iter().any(|used| !matches!(used, Association::Unused));
        if hears {
            let recognises = associations.iter().any(|used| matches!(used, Association::Wall(_)));
            self.recognised += FORGET * (f64::from(u8::from(recognises)) - self.recognised);
        }
        if is_abandoned || self.recognised < LOST_SHARE {
            *self.walls = WallSlam::new(&self.config, &self.ring);
            (self.is_found, self.driven_s, self.moved_m, self.has_complained) = (false, 0.0, 0.0, false);
            self.searching_since = at;
            self.tell(
                at,
                SearchState::Lost,
                "position lost: nothing that is heard is in the map; it is sought again".into(),
                events,
            );
        }
    }

    fn tell(&self, at: Timestamp, state: SearchState, reason: String, events: &mut Vec<Event>) {
        let change = LocalizationChange::KnownMap(KnownMapSearch { state, driven_s: self.driven_s, reason });
        events.push(Event::Localization(LocalizationEvent { at, since: self.searching_since, change }));
    }
}

impl Estimator for Localizer {
    fn update(&mut self, sweep: &Sweep, events: &mut Vec<Event>) {
        if !std::mem::replace(&mut self.has_begun, true) {
            self.searching_since = sweep.at;
            let reason = "position unknown: it is sought in the map as soon as the robot drives";
            self.tell(sweep.at, SearchState::Started, reason.into(), events);
        }
        let rolled_m = 0.5 * (sweep.left_m + sweep.right_m).abs();
        let turned_rad = (sweep.right_m - sweep.left_m).abs() / self.config.robot.wheel_base_m;
        self.moved_m += rolled_m + M_PER_RAD * turned_rad;
        if sweep.left_m.abs() + sweep.right_m.abs() > STILL_M {
            self.driven_s += sweep.elapsed_s;
        }
        if self.is_found {
            let before = events.len();
            self.walls.update(sweep, events);
            self.watch(sweep.at, events[before..].iter().any(is_abandoned), events);
            return;
        }
        self.walls.update(sweep, &mut self.scratch);
        // Poses in the temporary map's frame, and changes of its localization, mean nothing outside.
        let is_private = |event: &Event| matches!(event, Event::Estimate(_) | Event::Localization(_));
        events.extend(self.scratch.drain(..).filter(|event| !is_private(event)));
        if self.moved_m >= SEARCH_M {
            self.moved_m = 0.0;
            let found = self.search(sweep.at, events);
            if !self.is_found && self.driven_s > PATIENCE_S && !self.has_complained {
                self.has_complained = true;
                let reason =
                    format!("position still unknown after {:.0} s of driving: {}", self.driven_s, why_not(found));
                self.tell(sweep.at, SearchState::StillUnknown, reason, events);
            }
        }
    }

    fn raster(&self) -> Raster {
        self.known.clone()
    }

    fn map_since(&self, revision: u64) -> Option<(MapChange, u64)> {
        // A known map does not change.
        (revision == 0).then(|| (MapChange::Whole(self.raster()), 0))
    }

    fn states(&self) -> &[SensorState] {
        self.walls.states()
    }

    fn verdict(&self, sensor: usize) -> Verdict {
        self.walls.verdict(sensor)
    }

    fn fault_evidence(&self, sensor: usize) -> (f64, f64) {
        self.walls.fault_evidence(sensor)
    }

    fn segments(&self) -> Vec<Segment> {
        if self.is_found { self.walls.segments() } else { Vec::new() }
    }

    fn reversed_encoders(&self) -> [bool; 2] {
        self.walls.reversed_encoders()
    }

    fn calibration(&self) -> Option<Calibration> {
        self.walls.calibration()
    }
}

impl Place {
    fn agrees(&self, other: &Self) -> bool {
        let apart = self.transform.position() - other.transform.position();
        apart.norm() < AGREE_M && wrap_angle(self.transform.theta_rad - other.transform.theta_rad).abs() < 0.1
    }
}

fn is_abandoned(event: &Event) -> bool {
    matches!(event, Event::Localization(LocalizationEvent { change: LocalizationChange::Abandoned, .. }))
}

fn why_not(found: Option<Found>) -> String {
    match found {
        None => "too few walls were heard".into(),
        Some(Found { rival: Some(rival), best }) => format!(
            "two places explain what was heard almost alike ({:.0} % and {:.0} %)",
            100.0 * best.fit,
            100.0 * rival.fit
        ),
        Some(Found { best, .. }) if best.fit < MIN_FIT => {
            format!("no place in the map explains more than {:.0} % of what was heard", 100.0 * best.fit)
        }
        Some(_) => "the last two searches disagree".into(),
    }
}
