//! What every mode uses: the fault tests, the heading check and the map.

use super::axis_monitor::AxisMonitor;
use super::doubts::{Doubt, Doubts};
use super::expected_range;
use super::params::Params;
use super::place::jump::{Hands, JumpDetector};
use super::place::monitor::{PlaceMonitor, Scene};
use super::place::params::Params as PlaceParams;
use super::place::search::{Find, PlaceSearch};
use super::place::trail::Trail;
use crate::config::Config;
use crate::event::{Calibration, Event};
use crate::fault::detector::Detector;
use crate::fault::encoder::{EncoderChange, EncoderWatch};
use crate::geometry::{Placement, Pose2, Ring};
use crate::mapping::grid::OccupancyGrid;
use crate::orientation::axis_tracker::{AxisTracker, Turn};
use crate::orientation::dominant_directions::DominantDirections;
use crate::params;
use crate::position;
use crate::position::ekf_slam::EkfSlam;
use crate::position::heading_update::AxisReading;
use crate::robot_model::{ModelAspect, ModelEvent, ModelFinding, ModelState};
use crate::sweep::{Beam, Sweep};
use crate::time::Timestamp;

/// The parts that outlive a mode.
#[derive(Debug)]
pub(super) struct Stages {
    pub(super) params: Params,
    /// The constants of each new [`EkfSlam`].
    pub(super) position: position::params::Params,
    pub(super) max_range_m: f64,
    /// The wheels as configured.
    pub(super) wheels: Calibration,
    pub(super) detector: Detector,
    pub(super) encoders: EncoderWatch,
    pub(super) axis: AxisTracker,
    pub(super) axis_monitor: AxisMonitor,
    /// Scratch of the initializer and the relocalizer, which lay out all returns anew for each search.
    pub(super) finder: DominantDirections,
    pub(super) grid: OccupancyGrid,
    /// The way and the time of its last mark.
    marked: (f64, Timestamp),
    /// True if the ring has enough sensors to correct the pose.
    pub(super) can_correct: bool,
    /// True if the ring has enough sensors to tell clutter from another location.
    pub(super) can_detect_loss: bool,
    /// The last sweep whose echoes agreed with the walls.
    pub(super) last_agreement: (u64, Timestamp),
    pub(super) doubts: Doubts,
    pub(super) place_params: PlaceParams,
    /// How much the latest sweeps contradict the map.
    pub(super) place: PlaceMonitor,
    /// The readings of the last metres.
    pub(super) trail: Trail,
    jumps: JumpDetector,
    /// The noise that the readings show, metres, if it is far more than configured; and whether that was told.
    far_range_sigma_m: (Option<f64>, bool),
}

impl Stages {
    pub(super) fn new(config: &Config, ring: &Ring, params: &params::Params) -> Self {
        let finder = DominantDirections::new(params.orientation);
        let mut position = params.position;
        if let Some(range_sigma_m) = config.ring.range_sigma_m {
            position.beam.range_sigma_m = range_sigma_m;
        }
        let mut detector = Detector::with_params(ring, config.ring.max_range_m, params.fault.clone());
        detector.set_range_sigma(position.beam.range_sigma_m);
        Self {
            max_range_m: config.ring.max_range_m,
            wheels: config.robot.wheels(),
            detector,
            encoders: EncoderWatch::with_params(ring, config.robot.wheel_base_m, params.fault.clone()),
            axis: AxisTracker::new(params.orientation.track),
            axis_monitor: AxisMonitor::default(),
            finder,
            grid: OccupancyGrid::with_params(config.map.cell_m, params.mapping),
            marked: (f64::NEG_INFINITY, Timestamp::default()),
            can_correct: ring.len() >= params.wall_slam.min_sensors_to_correct,
            can_detect_loss: ring.len() >= params.wall_slam.min_sensors_to_detect_loss,
            last_agreement: (0, Timestamp::default()),
            doubts: Doubts::default(),
            place_params: params.place,
            place: PlaceMonitor::new(&params.place),
            trail: Trail::new(&params.place),
            jumps: JumpDetector::new(ring.len(), &params.place),
            far_range_sigma_m: (None, false),
            params: params.wall_slam,
            position,
        }
    }

    /// Runs the sensors' fault tests. With a `pose`, a silent beam is compared with what the map says it must hear from there.
    pub(super) fn judge_sensors(&mut self, sweep: &Sweep, pose: Option<Placement>, events: &mut Vec<Event>) {
        let Self { params, max_range_m, detector, grid, .. } = self;
        let expected = |beam: &Beam| {
            let map_from_sensor = pose? * beam.robot_from_sensor;
            expected_range::expected(grid, map_from_sensor, beam.half_angle_rad, *max_range_m, params)
        };
        detector.inspect(sweep, expected, events);
    }

    /// Takes what a corrected filter knows of the readings' noise and of its own errors.
    pub(super) fn learn_errors(&mut self, ekf: &EkfSlam) {
        self.detector.set_range_sigma(ekf.range_sigma_m());
        self.jumps.set_range_sigma(ekf.range_sigma_m());
        self.far_range_sigma_m.0 = ekf.far_range_sigma_m();
        let cov = ekf.stated_covariance();
        let variance = cov[(0, 0)] + cov[(1, 1)];
        let is_vague = self.doubts.holds(Doubt::Vague);
        let limit_m = if is_vague { self.params.known_sigma_m } else { self.params.vague_sigma_m };
        self.doubts.set(Doubt::Vague, variance > limit_m * limit_m);
        self.doubts.set(Doubt::Dragged, ekf.is_dragged());
    }

    /// Tells why the pose is doubtful, and that the readings' noise is another than configured. `told` events are older than the sweep.
    pub(super) fn tell_doubts(&mut self, sweep: &Sweep, told: usize, events: &mut Vec<Event>) {
        self.doubts.set(Doubt::RingSuspect, self.detector.is_ring_suspect());
        self.doubts.tell(sweep.at, told, events);
        if let (Some(range_sigma_m), false) = self.far_range_sigma_m {
            self.far_range_sigma_m.1 = true;
            let prior_m = self.position.beam.range_sigma_m;
            let finding = ModelFinding {
                aspect: ModelAspect::RangeNoise,
                measured: range_sigma_m,
                sigma: 0.25 * range_sigma_m,
                clause: format!("readings scatter by {range_sigma_m:.2} m, not by {prior_m:.2} m"),
                remedies: vec![("ring.range_sigma_m", format!("{range_sigma_m:.2}"))],
            };
            let event = ModelEvent { at: sweep.at, since: sweep.at, finding, state: ModelState::Corrected };
            events.push(Event::Model(event));
        }
    }

    /// The map and what the ring can measure.
    pub(super) fn scene(&self) -> Scene<'_> {
        Scene { grid: &self.grid, max_range_m: self.max_range_m, params: &self.place_params }
    }

    /// Keeps a sweep's readings after a motion by the wheels. Returns the way of it, metres, unless hands moved the robot.
    pub(super) fn follow_way(&mut self, sweep: &Sweep, step: Pose2) -> Result<f64, Hands> {
        let is_trusted = |sensor| self.detector.is_trusted(sensor);
        let hands = self.jumps.add(sweep, step, is_trusted);
        if hands.is_some() {
            self.trail.clear();
            self.axis.clear();
        }
        self.axis.add(sweep, step, is_trusted);
        let way_m = self.trail.add(sweep, step, is_trusted);
        hands.map_or(Ok(way_m), Err)
    }

    /// Forgets the readings of the last metres: the wheels were wrong.
    pub(super) fn forget_way(&mut self) {
        self.trail.clear();
        self.place.reset();
        self.axis.clear();
        self.axis_monitor.reset();
    }

    /// Compares a sweep seen from `pose` with the map.
    pub(super) fn check_place(&mut self, sweep: &Sweep, pose: Pose2, way_m: Result<f64, Hands>) {
        let way_m = match way_m {
            Ok(way_m) => way_m,
            Err(hands) => return self.place.jump(hands, self.jumps.before()),
        };
        let scene = Scene { grid: &self.grid, max_range_m: self.max_range_m, params: &self.place_params };
        self.place.add(&scene, sweep, pose, way_m, |sensor| self.detector.is_trusted(sensor));
    }

    /// Tells the search that the pose it found is wrong.
    pub(super) fn reject(&mut self, search: &mut PlaceSearch) {
        search.reject(&self.trail, &self.place_params);
        self.place.reset();
    }

    /// Searches a lost robot a little farther.
    pub(super) fn search(&mut self, search: &mut PlaceSearch) -> Option<Find> {
        let scene = Scene { grid: &self.grid, max_range_m: self.max_range_m, params: &self.place_params };
        search.step(&self.trail, &scene, &mut self.finder)
    }

    /// Runs the encoders' fault tests.
    pub(super) fn judge_encoders(&mut self, sweep: &Sweep, events: &mut Vec<Event>) -> Option<EncoderChange> {
        self.encoders.inspect(sweep, |sensor| self.detector.is_trusted(sensor), events)
    }

    /// Compares the heading with the building's axis, and corrects it.
    pub(super) fn check_heading(&mut self, ekf: &mut EkfSlam, sweep: &Sweep) {
        let heading_rad = ekf.filter.pose().theta_rad;
        if let Some(off_rad) = self.axis.read_window(heading_rad) {
            self.axis_monitor.compare(off_rad, sweep, &self.params);
        }
        if let Some(turn) = self.axis.read(heading_rad) {
            let Turn { angle_rad, variance, window_variance, lag } = turn;
            ekf.correct_heading(&AxisReading { angle_rad, variance, window_variance, lag });
        }
    }

    /// Marks the map from time to time: what is drawn after a mark can be taken back.
    pub(super) fn mark_map(&mut self, sweep: &Sweep) {
        let (way_m, at) = self.marked;
        if self.trail.way_m() - way_m >= self.params.mark_m || sweep.at.seconds_since(at) >= self.params.mark_s {
            self.marked = (self.trail.way_m(), sweep.at);
            self.grid.mark(sweep.index);
        }
    }

    /// Continues with another map. Returns seen in the old one are discarded.
    pub(super) fn replace_map(&mut self, grid: OccupancyGrid) {
        self.grid = grid;
        self.forget_way();
    }

    /// Discards the map: the encoder was faulty when it began.
    pub(super) fn discard_map(&mut self) {
        self.replace_map(OccupancyGrid::with_params(self.grid.cell_m(), *self.grid.params()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_discarded_map_leaves_its_constants() {
        let mut params = params::Params::default();
        params.mapping.wall = 34;
        let mut stages = Stages::new(&Config::default(), &Ring::default(), &params);
        stages.discard_map();
        assert_eq!(*stages.grid.params(), params.mapping);
    }
}
