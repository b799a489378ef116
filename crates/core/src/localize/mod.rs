//! Localization in a known map, from an unknown pose.
//!
//! 1. While the pose is unknown, [`WallSlam`] draws a temporary map. Its frame differs from the known map's by quarter turns and a
//!    translation.
//! 2. Every half metre the temporary map is matched with the known one ([`search`]): four headings, all translations.
//! 3. The best match is accepted if it explains most of the temporary map, no other match is nearly as good, and the search before
//!    found the same one. Until then the pose is reported as unknown, not guessed.
//! 4. From then on [`WallSlam`] tracks the robot among the known walls. Map and walls are not changed.

mod known_map;
pub(crate) mod params;
pub(crate) mod search;

use crate::config::Config;
use crate::event::{
    Calibration, Event, KnownMapSearch, LocalizationChange, LocalizationEvent, SearchState, SensorState, Verdict,
};
use crate::geometry::{Pose2, Ring, Segment, wrap_angle};
use crate::mapping::grid::{MapChange, OccupancyGrid};
use crate::mapping::raster::Raster;
use crate::params::Params;
use crate::pipeline::{Estimator, Waiting};
use crate::position::ekf_slam::Association;
use crate::saved_state::{InvalidState, SavedState};
use crate::sweep::{Beam, Sweep};
use crate::time::Timestamp;
use crate::wall_slam::WallSlam;
use search::{Found, Place, Searcher};

/// Localizes the robot in a known map.
#[derive(Debug)]
pub(crate) struct Localizer {
    params: Params,
    config: Config,
    ring: Ring,
    memory: Box<SavedState>,
    known: Raster,
    searcher: Searcher,
    slam: Box<WallSlam>,
    is_found: bool,
    /// The match that the last search accepted.
    last_match: Option<Place>,
    driven_s: f64,
    moved_m: f64,
    has_started: bool,
    has_warned: bool,
    /// Start of the current search.
    searching_since: Timestamp,
    /// The running share of sweeps that match a known wall.
    matching_share: f64,
    scratch: Vec<Event>,
}

impl Localizer {
    /// A robot anywhere in the saved building.
    ///
    /// # Errors
    /// If the saved state is invalid or its map too wide.
    pub(crate) fn with_params(
        config: &Config,
        ring: &Ring,
        memory: &SavedState,
        params: &Params,
    ) -> Result<Self, InvalidState> {
        let known = OccupancyGrid::restore_with_params(&memory.map, params.mapping)?.raster();
        if known.occupancy.len() > params.localize.max_cells {
            return Err(InvalidState("the map is too wide to be searched for the robot"));
        }
        let mut config = config.clone();
        // Both maps must have cells of one size.
        config.map.cell_m = memory.map.cell_m;
        let new = || WallSlam::with_params(&config, ring, params);
        new().localized(memory, Pose2::default(), params.localize.found_sigma_m)?;
        Ok(Self {
            ring: ring.clone(),
            memory: Box::new(memory.clone()),
            searcher: Searcher::with_params(&known, params.localize),
            known,
            slam: Box::new(new()),
            params: params.clone(),
            config,
            is_found: false,
            last_match: None,
            driven_s: 0.0,
            moved_m: 0.0,
            has_started: false,
            searching_since: Timestamp::default(),
            has_warned: false,
            matching_share: 1.0,
            scratch: Vec::new(),
        })
    }

    fn search(&mut self, at: Timestamp, events: &mut Vec<Event>) -> Option<Found> {
        let pose = self.slam.pose()?;
        let params::Params { min_solid, min_lead, min_fit, .. } = self.params.localize;
        let found = self.searcher.find(&self.slam.raster(), min_solid, min_lead);
        let accepted = found.filter(|found| found.best.fit >= min_fit && found.rival.is_none());
        let last = std::mem::replace(&mut self.last_match, accepted.map(|found| found.best));
        let agreed = accepted.map(|found| found.best).filter(|best| last.is_some_and(|last| self.agree(best, &last)));
        if let Some(place) = agreed {
            self.start_tracking(at, place, place.transform * pose, events);
        }
        found
    }

    fn start_tracking(&mut self, at: Timestamp, place: Place, pose: Pose2, events: &mut Vec<Event>) {
        let fresh = WallSlam::with_params(&self.config, &self.ring, &self.params);
        let local = std::mem::replace(&mut *self.slam, fresh);
        // `with_params` has restored this state once, so it is valid.
        let Ok(slam) = local.localized(&self.memory, pose, self.params.localize.found_sigma_m) else { return };
        *self.slam = slam;
        (self.is_found, self.matching_share, self.last_match) = (true, 1.0, None);
        let reason = format!(
            "position found after {:.0} s of driving: {:.2}, {:.2} m, {:.0} degrees; the map explains {:.0} % of what was heard",
            self.driven_s,
            pose.x_m,
            pose.y_m,
            pose.theta_rad.to_degrees(),
            100.0 * place.fit
        );
        self.report(at, SearchState::Found, reason, events);
    }

    /// Starts the search again if the sweeps no longer match the known walls.
    fn detect_loss(&mut self, sweep: &Sweep, is_driving: bool, events: &mut Vec<Event>) {
        let at = sweep.at;
        let associations = self.slam.associations();
        // A lost robot follows its wheels, and no return is associated with a wall.
        let is_lost = self.slam.is_lost() && is_driving && sweep.beams.iter().any(Beam::has_range);
        let has_returns = is_lost || associations.iter().any(|used| !matches!(used, Association::Unused));
        if has_returns {
            let matches_wall = associations.iter().any(|used| matches!(used, Association::Wall(_)));
            self.matching_share +=
                self.params.localize.share_gain * (f64::from(u8::from(matches_wall)) - self.matching_share);
        }
        if self.matching_share < self.params.localize.lost_share {
            *self.slam = WallSlam::with_params(&self.config, &self.ring, &self.params);
            (self.is_found, self.driven_s, self.moved_m, self.has_warned) = (false, 0.0, 0.0, false);
            self.searching_since = at;
            self.report(
                at,
                SearchState::Lost,
                "position lost: nothing that is heard is in the map; it is sought again".into(),
                events,
            );
        }
    }

    /// True if two searches found the same place.
    fn agree(&self, a: &Place, b: &Place) -> bool {
        let params::Params { agree_m, agree_rad, .. } = self.params.localize;
        let apart = a.transform.position() - b.transform.position();
        apart.norm() < agree_m && wrap_angle(a.transform.theta_rad - b.transform.theta_rad).abs() < agree_rad
    }

    /// Why a search found no place.
    fn why_not(&self, found: Option<Found>) -> String {
        match found {
            None => "too few walls were heard".into(),
            Some(Found { rival: Some(rival), best }) => format!(
                "two places explain what was heard almost alike ({:.0} % and {:.0} %)",
                100.0 * best.fit,
                100.0 * rival.fit
            ),
            Some(Found { best, .. }) if best.fit < self.params.localize.min_fit => {
                format!("no place in the map explains more than {:.0} % of what was heard", 100.0 * best.fit)
            }
            Some(_) => "the last two searches disagree".into(),
        }
    }

    fn report(&self, at: Timestamp, state: SearchState, reason: String, events: &mut Vec<Event>) {
        let change = LocalizationChange::KnownMap(KnownMapSearch { state, driven_s: self.driven_s, reason });
        events.push(Event::Localization(LocalizationEvent { at, since: self.searching_since, change }));
    }
}

impl Estimator for Localizer {
    fn update(&mut self, sweep: &Sweep, events: &mut Vec<Event>) {
        if !std::mem::replace(&mut self.has_started, true) {
            self.searching_since = sweep.at;
            let reason = "position unknown: it is sought in the map as soon as the robot drives";
            self.report(sweep.at, SearchState::Started, reason.into(), events);
        }
        let rolled_m = 0.5 * (sweep.left_m + sweep.right_m).abs();
        let turned_rad = (sweep.right_m - sweep.left_m).abs() / self.config.robot.wheel_base_m;
        self.moved_m += rolled_m + self.params.localize.turn_m_per_rad * turned_rad;
        let is_driving = sweep.left_m.abs() + sweep.right_m.abs() > self.params.localize.standstill_m;
        if is_driving {
            self.driven_s += sweep.elapsed_s;
        }
        if self.is_found {
            self.slam.update(sweep, events);
            self.detect_loss(sweep, is_driving, events);
            return;
        }
        self.slam.update(sweep, &mut self.scratch);
        // Poses in the temporary map's frame, and changes of its localization, mean nothing outside.
        let is_private = |event: &Event| matches!(event, Event::Estimate(_) | Event::Localization(_));
        events.extend(self.scratch.drain(..).filter(|event| !is_private(event)));
        if self.moved_m >= self.params.localize.search_m {
            self.moved_m = 0.0;
            let found = self.search(sweep.at, events);
            if !self.is_found && self.driven_s > self.params.localize.warning_s && !self.has_warned {
                self.has_warned = true;
                let reason =
                    format!("position still unknown after {:.0} s of driving: {}", self.driven_s, self.why_not(found));
                self.report(sweep.at, SearchState::StillUnknown, reason, events);
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
        self.slam.states()
    }

    fn verdict(&self, sensor: usize) -> Verdict {
        self.slam.verdict(sensor)
    }

    fn fault_evidence(&self, sensor: usize) -> (f64, f64) {
        self.slam.fault_evidence(sensor)
    }

    fn segments(&self) -> Vec<Segment> {
        if self.is_found { self.slam.segments() } else { Vec::new() }
    }

    fn waiting(&self) -> Option<Waiting> {
        self.slam.waiting()
    }

    fn reversed_encoders(&self) -> [bool; 2] {
        self.slam.reversed_encoders()
    }

    fn calibration(&self) -> Option<Calibration> {
        self.slam.calibration()
    }
}
