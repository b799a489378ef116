//! The default method: EKF-SLAM with wall landmarks in a Manhattan world.
//!
//! 1. Fault tests over PCA residuals, neighbours and the map decide which sensors to trust ([`crate::fault`]).
//! 2. A Hough transform over sonar arcs finds the building's axis from the first sweeps; then the returns of the last metre and a half
//!    measure the heading against it ([`crate::orientation`]).
//! 3. An extended Kalman filter over pose, wheels and wall offsets tracks the robot ([`crate::position`]).
//! 4. When the echoes contradict the map, the pose is lost, and the robot is sought in the map. Map updates are suspended meanwhile.
//! 5. Beams clear their cones and mark the walls that reflected them ([`crate::mapping`]).
//!
//! The map frame has its origin at the robot's start and its axes along the building's walls. The poses of the first sweeps are
//! published within a second after the axis is found.
//!
//! [`WallSlam::update`] is the method in short. Each mode has a file of its own; `step.rs` holds the types that fix the order of
//! the work within a sweep.

mod axis_monitor;
mod doubts;
mod encoder_fault;
mod expected_range;
mod initializer;
mod initializing;
mod introspection;
mod lost;
mod map_update;
mod odometry_outage;
pub(crate) mod params;
pub(crate) mod place;
mod pose_history;
mod relocalizer;
mod relocalizing;
mod stages;
mod step;
mod tracking;

use crate::config::Config;
use crate::event::Event;
use crate::geometry::{Pose2, Ring};
use crate::mapping::grid::OccupancyGrid;
use crate::params::Params;
use crate::position::ekf_slam::EkfSlam;
use crate::saved_state::{InvalidState, SavedState};
use crate::sweep::Sweep;
use initializing::Initializing;
use lost::Lost;
use odometry_outage::OdometryOutage;
use relocalizing::Relocalizing;
use stages::Stages;
use step::RobotState;
use tracking::Tracking;

/// EKF-SLAM with wall landmarks.
#[derive(Debug)]
pub struct WallSlam {
    stages: Stages,
    mode: Mode,
}

/// What the method is doing. Each mode owns what only it needs.
#[derive(Debug)]
enum Mode {
    /// There is no pose yet, or the first sweeps are still being processed.
    Initializing(Initializing),
    /// The pose is known; walls and map are updated.
    Tracking(Tracking),
    /// The pose is in doubt after an encoder fault; walls and map are kept as they are.
    Relocalizing(Relocalizing),
    /// The robot is elsewhere; walls and map are kept as they are.
    Lost(Lost),
    /// A wheel encoder is dead, so the motion is unknown.
    OdometryOutage(OdometryOutage),
}

impl WallSlam {
    /// Processes one sweep: pushes an [`Event::Estimate`] for each sweep whose pose is known now, and what else has happened.
    pub fn update(&mut self, sweep: &Sweep, events: &mut Vec<Event>) {
        let (stages, told) = (&mut self.stages, events.len());
        self.mode = match std::mem::take(&mut self.mode) {
            Mode::Initializing(initializing) => initializing.update(sweep, stages, events),
            Mode::Tracking(tracking) => tracking.update(sweep, stages, events),
            Mode::Relocalizing(relocalizing) => relocalizing.update(sweep, stages, events),
            Mode::Lost(lost) => lost.update(sweep, stages, events),
            Mode::OdometryOutage(outage) => outage.update(sweep, stages, events),
        };
        // The other modes say themselves that the pose is unknown.
        if let Mode::Tracking(_) = self.mode {
            stages.tell_doubts(sweep, told, events);
        }
    }

    /// Processes the sweeps that still wait: no more will come.
    pub fn end(&mut self, events: &mut Vec<Event>) {
        self.mode = match std::mem::take(&mut self.mode) {
            Mode::Initializing(initializing) => initializing.end(&mut self.stages, events),
            mode => mode,
        };
    }

    /// The method for a robot and its ring in an unknown building.
    #[must_use]
    pub fn new(config: &Config, ring: &Ring) -> Self {
        Self::with_params(config, ring, &Params::default())
    }

    /// [`WallSlam::new`] with other constants.
    #[must_use]
    pub fn with_params(config: &Config, ring: &Ring, params: &Params) -> Self {
        Self { stages: Stages::new(config, ring, params), mode: Mode::default() }
    }

    /// Resumes in a saved building at the saved pose. The pose is less certain than it was when saved: the robot may have been
    /// touched since.
    ///
    /// # Errors
    /// If the saved state is invalid.
    pub fn resume(config: &Config, ring: &Ring, memory: &SavedState) -> Result<Self, InvalidState> {
        Self::resume_with_params(config, ring, memory, &Params::default())
    }

    /// [`WallSlam::resume`] with other constants.
    ///
    /// # Errors
    /// If the saved state is invalid.
    pub fn resume_with_params(
        config: &Config,
        ring: &Ring,
        memory: &SavedState,
        params: &Params,
    ) -> Result<Self, InvalidState> {
        let mut slam = Self::with_params(config, ring, params);
        let Stages { params, position, detector, grid, .. } = &mut slam.stages;
        let mut ekf = EkfSlam::restore_with_params(position, memory)?;
        ekf.filter.inflate(params.resume_sigma_m, params.axis_sigma_rad);
        detector.restore(&memory.sensors)?;
        *grid = OccupancyGrid::restore_with_params(&memory.map, *grid.params())?;
        slam.mode = Mode::Tracking(Tracking { robot: RobotState::new(ekf, None, params) });
        Ok(slam)
    }

    /// Switches to a saved building whose walls stay as they are, with the robot at `pose`, known to `sigma_m` and 3 degrees. The
    /// states of sensors and encoders are kept.
    ///
    /// # Errors
    /// If the saved state is invalid.
    pub fn localized(mut self, memory: &SavedState, pose: Pose2, sigma_m: f64) -> Result<Self, InvalidState> {
        let mut ekf = EkfSlam::restore_with_params(&self.stages.position, memory)?;
        ekf.freeze_walls();
        ekf.filter.relocate(pose, sigma_m, self.stages.params.axis_sigma_rad);
        let grid = OccupancyGrid::restore_with_params(&memory.map, *self.stages.grid.params())?;
        self.stages.replace_map(grid);
        self.mode = Mode::Tracking(Tracking { robot: RobotState::new(ekf, None, &self.stages.params) });
        Ok(self)
    }
}

/// An unknown building. Allocates nothing, so that it can stand in while a mode is moved.
impl Default for Mode {
    fn default() -> Self {
        Self::Initializing(Initializing::default())
    }
}
