//! The default method, with the robot itself checked against the walls.
//!
//! Every sweep goes to [`WallSlam`], as the believed robot made it, and to the check. If the check finds another robot and the drive's
//! sweeps are still there, the map is begun anew with the robot found, from the first sweep on; otherwise the pose stays in doubt.

use super::check::{ModelCheck, Verdict};
use super::doubt::{Doubt, SUSPECTED, doubted, lost};
use super::finding::{ModelEvent, ModelState};
use super::history::History;
use super::hypothesis::RobotModel;
use super::naming;
use crate::config::Config;
use crate::event::{
    Calibration, EncoderState, Estimate, Event, LocalizationChange, LocalizationEvent, SensorState, Wheel,
};
use crate::geometry::{Pose2, Ring, Segment};
use crate::mapping::grid::MapChange;
use crate::mapping::raster::Raster;
use crate::params::Params;
use crate::pipeline::{Estimator, Waiting};
use crate::saved_state::{InvalidState, SavedState};
use crate::sweep::Sweep;
use crate::time::Timestamp;
use crate::wall_slam::WallSlam;

/// EKF-SLAM with walls, and the check of its robot.
#[derive(Debug)]
pub(crate) struct CheckedSlam {
    config: Config,
    ring: Ring,
    params: Params,
    slam: WallSlam,
    model: RobotModel,
    /// The model comes from a saved session, and was not told yet.
    is_untold: bool,
    /// The model was found in this run, and the filter learns its values better than the search.
    is_rough: bool,
    /// Sweeps of the drive when the map was begun anew.
    restart_sweeps: usize,
    /// The pose by the wheels of the robot found.
    odometry: Pose2,
    /// The sweep as that robot made it.
    corrected: Sweep,
    check: ModelCheck,
    history: History,
    /// What the method says of the readings' noise, until the robot is known: the walls of a wrong one look noisy.
    noise: Option<Event>,
    doubt: Doubt,
    /// The robot that was told last.
    told: Option<RobotModel>,
    is_lost: bool,
    encoders: [EncoderState; 2],
    /// Added to the map's revisions: the map before the last restart had fewer.
    first_revision: u64,
}

impl CheckedSlam {
    pub(crate) fn new(config: &Config, ring: &Ring, params: &Params) -> Self {
        let slam = WallSlam::with_params(config, ring, params);
        Self::around(slam, config, ring, params, History::new(params.robot_model.max_history_sweeps))
    }

    /// Resumes in a saved building, as [`WallSlam::resume`].
    pub(crate) fn resume(
        config: &Config,
        ring: &Ring,
        state: &SavedState,
        params: &Params,
    ) -> Result<Self, InvalidState> {
        let model = RobotModel::restore(&state.robot, config)?;
        let slam = WallSlam::resume_with_params(config, &model.ring(ring), state, params)?;
        let is_untold = model != RobotModel::AS_CONFIGURED;
        Ok(Self { model, is_untold, ..Self::around(slam, config, ring, params, History::new(0)) })
    }

    fn around(slam: WallSlam, config: &Config, ring: &Ring, params: &Params, history: History) -> Self {
        Self {
            config: config.clone(),
            ring: ring.clone(),
            slam,
            model: RobotModel::AS_CONFIGURED,
            is_untold: false,
            is_rough: false,
            restart_sweeps: 0,
            odometry: Pose2::default(),
            corrected: Sweep::default(),
            check: ModelCheck::new(ring, config.robot.wheel_base_m, &params.robot_model),
            history,
            noise: None,
            doubt: Doubt::None,
            told: None,
            is_lost: false,
            encoders: [EncoderState::Healthy; 2],
            first_revision: 0,
            params: params.clone(),
        }
    }

    /// The configured robot with all that was found and learnt of it so far.
    fn believed(&self) -> RobotModel {
        let learnt_base_m = self.slam.wheels().wheel_base_m;
        RobotModel {
            travel: self.model.travel * self.slam.travel_scale(),
            turn: self.model.turn * self.config.robot.wheel_base_m / learnt_base_m,
            ..self.model
        }
    }

    /// The robot that the drive has taught meanwhile, if the map is to be begun anew with it. What the search found is rough: so is the
    /// map, until it was drawn anew with twice the sweeps.
    fn taught(&mut self, believed: RobotModel) -> Option<RobotModel> {
        let params = &self.params.robot_model;
        let sweeps = self.history.len().unwrap_or(0);
        if self.is_rough && sweeps >= 2 * self.restart_sweeps {
            self.restart_sweeps = sweeps;
            let refined = self.check.with_refined_ring(&believed);
            return (refined.distance(&self.model) > params.restart_distance).then_some(refined);
        }
        (believed.distance(&self.model) > params.learnt_distance).then_some(believed)
    }

    /// Hands a sweep to the method, as the believed robot made it.
    fn follow(&mut self, sweep: &Sweep, events: &mut Vec<Event>) {
        if self.model == RobotModel::AS_CONFIGURED {
            self.slam.update(sweep, events);
            return;
        }
        self.corrected.clone_from(sweep);
        self.model.correct(&mut self.corrected, &self.ring, self.config.robot.wheel_base_m, &mut self.odometry);
        self.slam.update(&self.corrected, events);
    }

    /// States the error of the robot's scale with each new pose: a map that is a tenth too large is wrong by a tenth of the distance from
    /// its origin.
    fn state_scale(&self, estimate: &mut Estimate) {
        let (params, known) = (&self.params.robot_model, self.check.known_share());
        let sigma = params.unknown_scale_sigma * (1.0 - known) + params.known_scale_sigma * known;
        let variance_m2 = (sigma * estimate.pose.position().coords.norm()).powi(2);
        estimate.covariance[(0, 0)] += variance_m2;
        estimate.covariance[(1, 1)] += variance_m2;
    }

    /// Notes what the new events say of the encoders. True while one is dead: then wheels and walls cannot be compared.
    fn follow_encoders(&mut self, events: &[Event], earlier: usize) -> bool {
        for event in events.iter().skip(earlier) {
            if let Event::Encoder(encoder) = event {
                self.encoders[usize::from(encoder.wheel == Wheel::Right)] = encoder.state;
                self.check.clear();
            }
        }
        self.encoders.contains(&EncoderState::Dead)
    }

    /// Says what was found, and begins anew with it where that is possible.
    ///
    /// The events from `earlier` on are of this sweep: its pose in the discarded map is none any more.
    fn adopt(&mut self, found: RobotModel, at: Timestamp, earlier: usize, events: &mut Vec<Event>) {
        let is_reversed = self.slam.reversed_encoders() != [false; 2];
        let is_known = !naming::is_beyond_search(&found);
        let can_restart = self.history.len().is_some() && !is_reversed && is_known;
        let state = if can_restart && !found.is_mirrored() { ModelState::Corrected } else { ModelState::Doubted };
        let mut again = Vec::new();
        if can_restart {
            let own = events.split_off(earlier);
            events.extend(own.into_iter().filter(|event| !matches!(event, Event::Estimate(_))));
            self.restart(found, at, &mut again);
        }
        let robot = if can_restart { self.model } else { found };
        self.tell(&robot, state, at, events);
        events.append(&mut again);
        if state == ModelState::Doubted {
            self.begin_doubt(at, "the robot is not what its configuration says", events);
            self.doubt = Doubt::Lasting;
        }
    }

    /// Says in what a robot differs from the configured one.
    fn tell(&mut self, found: &RobotModel, state: ModelState, at: Timestamp, events: &mut Vec<Event>) {
        self.told = Some(*found);
        let since = Timestamp::default();
        let findings = naming::findings(&self.config, found).into_iter();
        events.extend(findings.map(|finding| Event::Model(ModelEvent { at, since, finding, state })));
    }

    /// What is added to the revisions of a map that takes the place of this one.
    fn next_revision(&self) -> u64 {
        self.first_revision + self.slam.map_since(u64::MAX).map_or(0, |(_, newest)| newest) + 2
    }

    /// Processes the drive's sweeps again with another robot. Of the events, only those count that change what is known now.
    ///
    /// The search ends a few per cent beside the true robot, and the walls that were drawn meanwhile keep that error. So what a pass
    /// learns of the robot is where the next one begins.
    fn restart(&mut self, found: RobotModel, at: Timestamp, events: &mut Vec<Event>) {
        let before: Vec<SensorState> = self.slam.states().to_vec();
        self.first_revision = self.next_revision();
        self.is_rough = !found.is_mirrored();
        self.restart_sweeps = self.history.len().unwrap_or(0);
        let (mut again, mut poses) = self.follow_again(found, &found);
        for _ in 1..self.params.robot_model.restart_passes {
            let learnt = self.believed();
            if learnt.distance(&self.model) < self.params.robot_model.restart_distance {
                break;
            }
            (again, poses) = self.follow_again(learnt, &found);
        }
        self.is_lost = again.iter().rev().find_map(lost).unwrap_or(false);
        poses.iter_mut().for_each(|pose| self.state_scale(pose));
        let newest = poses.pop();
        events.push(Event::Revised { at, poses });
        events.extend(newest.map(Event::Estimate));
        let states = self.slam.states();
        for event in again {
            let is_news = match &event {
                Event::Fault(fault) => {
                    states.get(fault.sensor) == Some(&fault.state) && before.get(fault.sensor) != Some(&fault.state)
                }
                Event::Localization(_) | Event::Model(_) => false,
                _ => true,
            };
            if is_news {
                events.push(event);
            }
        }
    }

    /// Begins anew with a robot, and processes the drive's sweeps: the faults, the localization and the last sweep's events; all poses.
    ///
    /// What the search `found` is only as exact as its steps, and the filter learns the rest; what it left alone is as certain as before.
    fn follow_again(&mut self, robot: RobotModel, found: &RobotModel) -> (Vec<Event>, Vec<Estimate>) {
        self.model = robot;
        self.odometry = Pose2::default();
        self.noise = None;
        let (mut config, mut params) = (self.config.clone(), self.params.clone());
        let sigma = self.params.robot_model.found_sigma;
        let is_found = |factor: f64| libm::log(factor.abs()).abs() > 0.5 * sigma;
        if is_found(found.travel / found.turn) {
            config.robot.wheel_base_sigma_m = Some(sigma * config.robot.wheel_base_m);
        }
        if is_found(found.travel) {
            params.position.filter.travel_sigma = sigma;
        }
        self.slam = WallSlam::with_params(&config, &robot.ring(&self.ring), &params);
        let history = std::mem::replace(&mut self.history, History::new(0));
        let (mut again, mut poses) = (Vec::new(), Vec::new());
        for sweep in history.sweeps() {
            again.retain(|event| matches!(event, Event::Fault(_) | Event::Localization(_)));
            self.follow(&sweep, &mut again);
            again.retain(|event| match event {
                Event::Estimate(pose) => {
                    poses.push(*pose);
                    false
                }
                _ => true,
            });
        }
        self.history = history;
        (again, poses)
    }

    fn begin_doubt(&mut self, at: Timestamp, reason: &str, events: &mut Vec<Event>) {
        let since = Timestamp::default();
        if self.doubt == Doubt::None {
            self.doubt = Doubt::Open(since);
            if !self.is_lost {
                events.push(doubted(at, since, reason));
            }
        }
    }

    fn end_doubt(&mut self, at: Timestamp, events: &mut Vec<Event>) {
        if let Doubt::Open(since) = self.doubt {
            self.doubt = Doubt::None;
            if !self.is_lost {
                events.push(Event::Localization(LocalizationEvent { at, since, change: LocalizationChange::Trusted }));
            }
        }
    }
}

impl Estimator for CheckedSlam {
    fn update(&mut self, sweep: &Sweep, events: &mut Vec<Event>) {
        self.history.push(sweep, self.params.wall_slam.axis_every_sweeps);
        if std::mem::take(&mut self.is_untold) {
            let model = self.model;
            self.tell(&model, ModelState::Corrected, sweep.at, events);
        }
        let earlier = events.len();
        self.follow(sweep, events);
        for event in events.iter_mut().skip(earlier) {
            if let Event::Estimate(estimate) = event {
                self.state_scale(estimate);
            }
        }
        if let Some(noise) = events.iter().skip(earlier).position(|event| matches!(event, Event::Model(_))) {
            self.noise = Some(events.remove(earlier + noise));
        }
        if let Some(is_lost) = events.iter().skip(earlier).rev().find_map(lost) {
            self.is_lost = is_lost;
            if !is_lost && self.doubt != Doubt::None {
                events.push(doubted(sweep.at, sweep.at, SUSPECTED));
            }
        }
        if self.follow_encoders(events, earlier) {
            return;
        }
        let (believed, states) = (self.believed(), self.slam.states());
        let is_trusted = |sensor: usize| states.get(sensor) == Some(&SensorState::Healthy);
        match self.check.update(sweep, &believed, is_trusted) {
            Verdict::Open => {}
            Verdict::Fits => {
                if let Some(taught) = self.taught(believed) {
                    self.adopt(taught, sweep.at, earlier, events);
                    return;
                }
                self.end_doubt(sweep.at, events);
                if self.check.is_known() {
                    events.extend(self.noise.take());
                    if std::mem::take(&mut self.is_rough) {
                        self.tell(&believed, ModelState::Corrected, sweep.at, events);
                    }
                }
            }
            Verdict::Suspected => self.begin_doubt(sweep.at, SUSPECTED, events),
            Verdict::Found(found) => self.adopt(found, sweep.at, earlier, events),
        }
    }

    fn end(&mut self, events: &mut Vec<Event>) {
        self.slam.end(events);
    }

    fn begin_anew(&mut self, at: Timestamp, events: &mut Vec<Event>) {
        self.told.take().inspect(|told| self.tell(told, ModelState::Resolved, at, events));
        if self.is_lost || self.doubt != Doubt::None {
            let trusted = LocalizationEvent { at, since: at, change: LocalizationChange::Trusted };
            events.push(Event::Localization(trusted));
        }
        let (first_revision, config) = (self.next_revision(), &self.config);
        let slam = WallSlam::with_params(config, &self.ring, &self.params);
        let history = History::new(self.params.robot_model.max_history_sweeps);
        *self = Self { first_revision, ..Self::around(slam, config, &self.ring, &self.params, history) };
        events.push(Event::Revised { at, poses: Vec::new() });
    }

    fn raster(&self) -> Raster {
        self.slam.raster()
    }

    fn map_since(&self, revision: u64) -> Option<(MapChange, u64)> {
        let (change, newest) = self.slam.map_since(revision.saturating_sub(self.first_revision))?;
        // Who knows the map of the wrong robot needs the whole new one.
        let is_stale = revision > 0 && revision < self.first_revision;
        let change = if is_stale { MapChange::Whole(self.slam.raster()) } else { change };
        Some((change, newest + self.first_revision))
    }

    fn states(&self) -> &[SensorState] {
        self.slam.states()
    }

    fn verdict(&self, sensor: usize) -> crate::event::Verdict {
        self.slam.verdict(sensor)
    }

    fn fault_evidence(&self, sensor: usize) -> (f64, f64) {
        self.slam.fault_evidence(sensor)
    }

    fn segments(&self) -> Vec<Segment> {
        self.slam.segments()
    }

    fn waiting(&self) -> Option<Waiting> {
        self.slam.waiting()
    }

    fn reversed_encoders(&self) -> [bool; 2] {
        self.slam.reversed_encoders()
    }

    fn calibration(&self) -> Option<Calibration> {
        let wheels = self.slam.wheels();
        let base = (self.model.travel / self.model.turn).abs();
        Some(Calibration {
            wheel_base_m: wheels.wheel_base_m * base,
            wheel_base_sigma_m: wheels.wheel_base_sigma_m * base,
            ..wheels
        })
    }

    fn saved_state(&self) -> Option<SavedState> {
        self.slam.saved_state().map(|state| SavedState { robot: self.model.saved(&self.config), ..state })
    }

    fn nis(&self) -> f64 {
        Estimator::nis(&self.slam)
    }
}
