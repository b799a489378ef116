//! The default method as the pipeline sees it: the entry points, and what can be read of its state.

use super::initializing::Initializing;
use super::step::RobotState;
use super::{Mode, OdometryOutage, WallSlam};
use crate::event::{Calibration, Event, SensorState, Verdict};
use crate::geometry::{Pose2, Segment};
use crate::mapping::grid::MapChange;
use crate::mapping::raster::Raster;
use crate::pipeline::{Estimator, Waiting};
use crate::position::ekf_slam::{Association, EkfSlam};
use crate::saved_state::{FoundRobot, SavedState};
use crate::sweep::Sweep;

impl Estimator for WallSlam {
    fn update(&mut self, sweep: &Sweep, events: &mut Vec<Event>) {
        Self::update(self, sweep, events);
    }

    fn end(&mut self, events: &mut Vec<Event>) {
        Self::end(self, events);
    }

    fn raster(&self) -> Raster {
        self.stages.grid.raster()
    }

    fn map_since(&self, revision: u64) -> Option<(MapChange, u64)> {
        let grid = &self.stages.grid;
        Some((MapChange::Patches(grid.cell_m(), grid.patches_since(revision)), grid.revision()))
    }

    fn states(&self) -> &[SensorState] {
        self.stages.detector.states()
    }

    fn verdict(&self, sensor: usize) -> Verdict {
        match self.associations().get(sensor) {
            _ if !self.stages.detector.is_trusted(sensor) => Verdict::Ignored,
            Some(Association::Wall(_)) => Verdict::Used,
            Some(Association::Unexplained) => Verdict::Unexplained,
            Some(Association::Unused) | None => Verdict::Silent,
        }
    }

    fn fault_evidence(&self, sensor: usize) -> (f64, f64) {
        (self.stages.detector.score(sensor), self.stages.detector.residual_m(sensor))
    }

    fn segments(&self) -> Vec<Segment> {
        self.ekf().map(|ekf| ekf.segments().collect()).unwrap_or_default()
    }

    fn waiting(&self) -> Option<Waiting> {
        match &self.mode {
            Mode::Initializing(Initializing::Collecting(initializer))
            | Mode::OdometryOutage(OdometryOutage::BeforeMap(initializer)) => Some(initializer.waiting()),
            _ => None,
        }
    }

    fn reversed_encoders(&self) -> [bool; 2] {
        self.stages.encoders.is_reversed()
    }

    fn calibration(&self) -> Option<Calibration> {
        Some(self.wheels())
    }

    fn saved_state(&self) -> Option<SavedState> {
        let ekf = self.ekf().filter(|_| !self.mode.has_unknown_position())?;
        let (walls, inactive) = ekf.landmark_states();
        Some(SavedState {
            filter: ekf.filter.saved_state(),
            walls,
            inactive,
            map: self.stages.grid.saved_state(),
            sensors: self.stages.detector.saved_state(),
            robot: FoundRobot::default(),
        })
    }

    fn nis(&self) -> f64 {
        self.ekf().map_or(f64::NAN, EkfSlam::nis)
    }
}

impl WallSlam {
    /// The robot in the map; none before the building's axis is found.
    #[must_use]
    pub fn pose(&self) -> Option<Pose2> {
        self.ekf().map(|ekf| ekf.filter.pose())
    }

    /// The association of each beam of the last sweep, by sensor.
    #[must_use]
    pub fn associations(&self) -> &[Association] {
        self.ekf().map_or(&[], EkfSlam::associations)
    }

    /// True while the robot is elsewhere than its pose.
    pub(crate) const fn is_lost(&self) -> bool {
        matches!(self.mode, Mode::Lost(_))
    }

    /// The wheels as learnt so far.
    #[must_use]
    pub(crate) fn wheels(&self) -> Calibration {
        self.ekf().map_or(self.stages.wheels, |ekf| ekf.filter.calibration())
    }

    /// True over reported travel as learnt so far.
    pub(crate) fn travel_scale(&self) -> f64 {
        self.ekf().map_or(1.0, |ekf| ekf.filter.travel_scale().0)
    }

    fn ekf(&self) -> Option<&EkfSlam> {
        self.mode.robot().map(|robot| &robot.ekf)
    }
}

impl Mode {
    fn robot(&self) -> Option<&RobotState> {
        match self {
            Self::Initializing(initializing) => initializing.robot(),
            Self::Tracking(tracking) => Some(&tracking.robot),
            Self::Relocalizing(relocalizing) => Some(&relocalizing.robot),
            Self::Lost(lost) => Some(&lost.robot),
            Self::OdometryOutage(OdometryOutage::PoseHeld(held)) => Some(&held.robot),
            Self::OdometryOutage(OdometryOutage::BeforeMap(_)) => None,
        }
    }

    /// True if an outage of the odometry has left the robot anywhere around its pose: a next run could not resume there.
    fn has_unknown_position(&self) -> bool {
        match self {
            Self::Initializing(_) | Self::Tracking(_) | Self::Lost(_) => false,
            Self::Relocalizing(relocalizing) => relocalizing.relocalizer.is_after_outage(),
            Self::OdometryOutage(_) => true,
        }
    }
}
