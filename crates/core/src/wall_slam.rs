//! The default method: the walls of an orthogonal building in one filter with the pose.
//!
//! 1. PCA over three instants, with the neighbours' and the map's evidence, tells which sensors to distrust ([`crate::fault`]).
//! 2. A Hough transform over sonar arcs finds the building's axis, at the start from the first sweeps and later, from the last
//!    ones, as a check on the heading ([`crate::orientation`]).
//! 3. An extended Kalman filter over pose, wheels and wall offsets follows the robot ([`crate::position`]).
//! 4. Where what is heard contradicts the walls, the place is sought anew among them; meanwhile nothing is learnt.
//! 5. Beams clear their cones and mark the walls they heard ([`crate::mapping`]).
//!
//! The map frame has its origin where the robot started and its axes along the building's walls. Poses of the sweeps before the axis
//! was found follow within a second when it is.

mod expected_range;
mod initializer;
mod introspection;
mod odometry_outage;
mod relocalizer;

use crate::config::Config;
use crate::event::{Calibration, Estimate, Event, LockChange, LockEvent};
use crate::fault::detector::Detector;
use crate::fault::encoder::EncoderWatch;
use crate::geometry::{Placement, Point, Pose2, Ring, wrap_angle};
use crate::mapping::cone::{self, ReturnKind};
use crate::mapping::grid::{OccupancyGrid, WallNormal};
use crate::orientation::dominant_directions::DominantDirections;
use crate::position::beam_model::observe_wall;
use crate::position::ekf_slam::{Association, EkfSlam, WallLandmark};
use crate::saved_state::{InvalidState, SavedState};
use crate::sweep::{Beam, Sweep};
use crate::time::Timestamp;
use initializer::{Initialized, Initializer};
use odometry_outage::{OdometryOutage, Trail, unknown_within};
use relocalizer::Relocalizer;
use std::collections::VecDeque;

/// The walls method at work.
#[derive(Debug)]
pub struct WallSlam {
    max_range_m: f64,
    wheels: Calibration,
    detector: Detector,
    encoders: EncoderWatch,
    axis: DominantDirections,
    axis_sweeps: usize,
    initializer: Initializer,
    /// The first sweeps that are still to be used.
    waiting: VecDeque<Sweep>,
    /// The first sweep of a building that this run has begun.
    begun_sweep: Option<u64>,
    trail: Trail,
    /// Set while a wheel does not count.
    blind: Option<OdometryOutage>,
    tracker: Option<EkfSlam>,
    grid: OccupancyGrid,
    /// Whether the ring has beams enough to tell clutter from another place.
    can_tell: bool,
    lost: Option<Relocalizer>,
    search: DominantDirections,
    /// When what was heard last agreed with the walls.
    sure: (u64, Timestamp),
}

/// A robot that was put back by hand stands this far from where it stood, metres.
const RESUME_SIGMA_M: f64 = 0.1;
/// What an axis says of the heading: its standard deviation.
const AXIS_SIGMA_RAD: f64 = 3.0 * std::f64::consts::PI / 180.0;
/// Fewer sensors raise false alarms: of 8, one drive in three.
const MIN_SENSORS: usize = 12;
/// A place found this near is the one that was believed.
const HERE_M: f64 = 0.25;
const HERE_RAD: f64 = 0.15;
/// Of the first sweeps so many are used with each that comes, until none waits.
const CATCH_UP_SWEEPS: usize = 8;
/// Sweeps between two checks of the heading.
const CHECK_SWEEPS: usize = 25;
/// A heading known to this is known better than a check could tell.
const DOUBT_RAD: f64 = 1.0 * std::f64::consts::PI / 180.0;
/// A check farther off than this speaks of another axis, not of drift.
const CHECK_RAD: f64 = 6.0 * std::f64::consts::PI / 180.0;
/// A sensor clears its cone in one of so many sweeps; what it hears is marked in each.
const CLEARING_SWEEPS: u64 = 8;
/// A return is a known wall's when it lies on its line up to this, at most so far beyond where the wall has been seen, metres.
const ON_LINE_M: f64 = 0.06;
const EXTENDED_M: f64 = 1.0;

impl WallSlam {
    /// The method for a robot and its ring.
    #[must_use]
    pub fn new(config: &Config, ring: &Ring) -> Self {
        Self {
            max_range_m: config.ring.max_range_m,
            wheels: config.robot.wheels(),
            detector: Detector::new(ring, config.ring.max_range_m),
            encoders: EncoderWatch::new(ring, config.robot.wheel_base_m),
            axis: DominantDirections::default(),
            axis_sweeps: 0,
            initializer: Initializer::new(),
            waiting: VecDeque::new(),
            begun_sweep: None,
            trail: Trail::new(),
            blind: None,
            tracker: None,
            grid: OccupancyGrid::new(config.map.cell_m),
            can_tell: ring.len() >= MIN_SENSORS,
            lost: None,
            search: DominantDirections::default(),
            sure: (0, Timestamp::default()),
        }
    }

    /// The method in a building that it knows: it goes on at the remembered pose, of which it is less certain than it was, for
    /// somebody may have touched the robot.
    ///
    /// # Errors
    /// Where the memory holds what cannot be.
    pub fn resume(config: &Config, ring: &Ring, memory: &SavedState) -> Result<Self, InvalidState> {
        let mut tracker = EkfSlam::restore(memory)?;
        tracker.filter.inflate(RESUME_SIGMA_M, AXIS_SIGMA_RAD);
        let mut detector = Detector::new(ring, config.ring.max_range_m);
        detector.restore(&memory.sensors)?;
        let grid = OccupancyGrid::restore(&memory.map)?;
        Ok(Self { tracker: Some(tracker), detector, grid, ..Self::new(config, ring) })
    }

    /// The method in a building that it knows and does not change, at `pose`, which is known to `sigma_m` and 3 degrees;
    /// what was found of the sensors meanwhile stays.
    ///
    /// # Errors
    /// Where the memory holds what cannot be.
    pub fn localized(self, memory: &SavedState, pose: Pose2, sigma_m: f64) -> Result<Self, InvalidState> {
        let mut tracker = EkfSlam::restore(memory)?;
        tracker.freeze_walls();
        tracker.filter.relocate(pose, sigma_m, AXIS_SIGMA_RAD);
        Ok(Self {
            tracker: Some(tracker),
            grid: OccupancyGrid::restore(&memory.map)?,
            axis: DominantDirections::default(),
            lost: None,
            waiting: VecDeque::new(),
            begun_sweep: None,
            trail: Trail::new(),
            blind: None,
            ..self
        })
    }

    /// The robot in the map; none before the building's axis is found.
    #[must_use]
    pub fn pose(&self) -> Option<Pose2> {
        self.tracker.as_ref().map(|tracker| tracker.filter.pose())
    }

    /// What became of each beam of the last sweep, by sensor.
    #[must_use]
    pub fn associations(&self) -> &[Association] {
        self.tracker.as_ref().map_or(&[], EkfSlam::associations)
    }

    /// Gathers the first sweeps until they agree on the building's axis.
    fn seek(&mut self, sweep: &Sweep) {
        if self.tracker.is_some() {
            return self.waiting.push_back(sweep.clone());
        }
        let begun = self.initializer.add(sweep, &self.wheels, |sensor| self.detector.is_trusted(sensor));
        if let Some(Initialized { tracker, sweeps }) = begun {
            self.tracker = Some(tracker);
            self.begun_sweep = sweeps.first().map(|first| first.index);
            self.waiting = sweeps.into();
        }
    }

    /// Uses the first sweeps, a few at a time: none shall hold up what comes.
    fn catch_up(&mut self, events: &mut Vec<Event>) {
        for _ in 0..CATCH_UP_SWEEPS {
            let (Some(tracker), Some(sweep)) = (&mut self.tracker, self.waiting.pop_front()) else { return };
            tracker.predict(sweep.left_m, sweep.right_m);
            tracker.predict_ranges(&sweep);
            self.follow(&sweep, events);
        }
    }

    /// What follows once the pose is predicted and the sensors are judged.
    fn follow(&mut self, sweep: &Sweep, events: &mut Vec<Event>) {
        let Some(tracker) = &mut self.tracker else { return };
        let may_learn = self.lost.is_none() && !self.encoders.is_suspected();
        tracker.correct(sweep, may_learn, |sensor| self.detector.is_trusted(sensor));
        self.check_heading(sweep);
        if self.lost.is_some() {
            self.relocalize(sweep, events);
        } else {
            self.watch_lock(sweep, events);
            if may_learn {
                self.integrate_beam(sweep);
            }
        }
        if let Some(tracker) = &self.tracker {
            let blind_m = self.lost.as_ref().and_then(|lost| lost.blind_m);
            self.trail.push(sweep, tracker.filter.pose());
            events.push(Event::Estimate(Estimate {
                at: sweep.at,
                sweep: sweep.index,
                pose: tracker.filter.pose(),
                covariance: blind_m.map_or_else(|| tracker.filter.pose_covariance(), unknown_within),
                odometry: sweep.odometry,
                nis: tracker.nis(),
            }));
        }
    }

    /// Notices when what is heard contradicts the map.
    fn watch_lock(&mut self, sweep: &Sweep, events: &mut Vec<Event>) {
        let Some(tracker) = &mut self.tracker else { return };
        if tracker.monitor().is_sure() {
            self.sure = (sweep.index, sweep.at);
        }
        if self.can_tell && tracker.monitor().is_lost() {
            let (since_sweep, since) = self.sure;
            self.lost = Some(Relocalizer::new(since, since_sweep, tracker.filter.pose(), sweep.odometry));
            events.push(Event::Lock(LockEvent { at: sweep.at, since, change: LockChange::Lost }));
        }
    }

    /// Seeks the place of a robot that may be elsewhere.
    fn relocalize(&mut self, sweep: &Sweep, events: &mut Vec<Event>) {
        let (Some(tracker), Some(lost)) = (&mut self.tracker, &mut self.lost) else { return };
        lost.add(sweep, |sensor| self.detector.is_trusted(sensor));
        let believed = tracker.filter.pose();
        let walls = tracker.known_walls(lost.since_sweep);
        let change = if let Some(pose) = lost.find(sweep.odometry, &mut self.search, tracker.params(), walls) {
            let moved_m = (pose.position() - believed.position()).norm();
            let turned_rad = wrap_angle(pose.theta_rad - believed.theta_rad);
            if moved_m > HERE_M || turned_rad.abs() > HERE_RAD {
                tracker.relocate(pose, lost.since_sweep);
            }
            LockChange::Regained { moved_m, turned_rad }
        } else if tracker.monitor().is_sure() && lost.may_be_wrong() {
            LockChange::Regained { moved_m: 0.0, turned_rad: 0.0 }
        } else if lost.is_hopeless() {
            LockChange::Abandoned
        } else {
            return;
        };
        tracker.reset_monitor();
        events.push(Event::Lock(LockEvent { at: sweep.at, since: lost.since, change }));
        self.lost = None;
    }

    /// While the heading is in doubt, the axis of what was just heard is sought every few seconds, and must be the building's.
    fn check_heading(&mut self, sweep: &Sweep) {
        let Some(tracker) = &mut self.tracker else { return };
        let place = Placement::from(tracker.filter.pose());
        for (sensor, beam) in sweep.beams.iter().enumerate() {
            if self.detector.is_trusted(sensor) {
                self.axis.add(place, beam);
            }
        }
        self.axis_sweeps += 1;
        if self.axis_sweeps < CHECK_SWEEPS {
            return;
        }
        let is_in_doubt =
            !tracker.monitor().is_sure() || tracker.filter.pose_covariance()[(2, 2)] > DOUBT_RAD * DOUBT_RAD;
        let axis = if is_in_doubt { self.axis.find() } else { None };
        if let Some(axis) = axis.filter(|axis| axis.is_believed() && axis.angle_rad.abs() < CHECK_RAD) {
            tracker.filter.update_heading(-axis.angle_rad, AXIS_SIGMA_RAD * AXIS_SIGMA_RAD);
        }
        self.axis.clear();
        self.axis_sweeps = 0;
    }

    /// Draws what the trusted beams heard.
    fn integrate_beam(&mut self, sweep: &Sweep) {
        let Some(tracker) = self.tracker.as_ref().filter(|tracker| !tracker.is_frozen()) else { return };
        let place = Placement::from(tracker.filter.pose());
        self.grid.revise();
        for (sensor, (beam, used)) in sweep.beams.iter().zip(tracker.associations()).enumerate() {
            let is_turn = (sweep.index + sensor as u64).is_multiple_of(CLEARING_SWEEPS);
            let (range_m, kind) = match used {
                Association::Wall(_) | Association::Unexplained => match heard_wall(tracker, place, beam) {
                    Some((point, normal)) if !is_turn => {
                        cone::mark_wall(&mut self.grid, point, normal);
                        continue;
                    }
                    Some((point, normal)) => (beam.range_m, ReturnKind::Wall(point, normal)),
                    None => (beam.range_m, ReturnKind::Something),
                },
                Association::Unused if is_turn && beam.is_clear() && self.detector.is_trusted(sensor) => {
                    (self.max_range_m, ReturnKind::Nothing)
                }
                Association::Unused => continue,
            };
            cone::integrate_beam(&mut self.grid, place * beam.robot_from_sensor, beam.half_angle_rad, range_m, kind);
        }
    }
}

/// The point of a known wall that a return may have come from: on the wall's line, in its extent or a little beyond.
fn heard_wall(tracker: &EkfSlam, place: Placement, beam: &Beam) -> Option<(Point, WallNormal)> {
    let observation = observe_wall(&tracker.params().beam, place, beam)?;
    let off_m = |(index, _): &(usize, &WallLandmark)| (tracker.filter.offset_m(*index) - observation.offset_m()).abs();
    // Heard squarely beyond its end it would be the end itself, somewhere in the cone.
    let beyond_m = if observation.oblique_rad > 0.0 { EXTENDED_M } else { 0.0 };
    let walls = tracker.walls().iter().enumerate().filter(|(_, wall)| {
        wall.side == observation.side && (wall.lo_m - beyond_m..wall.hi_m + beyond_m).contains(&observation.along_m)
    });
    let nearest = walls.min_by(|a, b| off_m(a).total_cmp(&off_m(b))).filter(|wall| off_m(wall) < ON_LINE_M)?;
    let normal = if observation.side.axis() == 0 { WallNormal::X } else { WallNormal::Y };
    Some((observation.side.join(tracker.filter.offset_m(nearest.0), observation.along_m), normal))
}
