//! The default method as the pipeline sees it.

use super::WallSlam;
use crate::event::{Calibration, Event, SensorState, Verdict};
use crate::geometry::{Placement, Segment};
use crate::mapping::grid::MapChange;
use crate::mapping::raster::Raster;
use crate::pipeline::Estimator;
use crate::position::ekf_slam::{Association, EkfSlam};
use crate::saved_state::SavedState;
use crate::sweep::{Beam, Sweep};

impl Estimator for WallSlam {
    fn update(&mut self, sweep: &Sweep, events: &mut Vec<Event>) {
        if self.blind.is_some() {
            self.detector.inspect(sweep, |_| None, events);
            self.watch_encoders(sweep, events);
            self.hold_pose(sweep, events);
        } else if let (Some(tracker), true) = (&mut self.tracker, self.waiting.is_empty()) {
            tracker.predict(sweep.left_m, sweep.right_m);
            tracker.predict_ranges(sweep);
            let is_lost = self.lost.is_some() || self.encoders.is_suspected();
            let place = Placement::from(tracker.filter.pose());
            let expected = |beam: &Beam| {
                let map_from_sensor = place * beam.robot_from_sensor;
                (!is_lost).then(|| {
                    super::expected_range::expected(&self.grid, map_from_sensor, beam.half_angle_rad, self.max_range_m)
                })?
            };
            self.detector.inspect(sweep, expected, events);
            self.watch_encoders(sweep, events);
            if self.blind.is_some() { self.hold_pose(sweep, events) } else { self.follow(sweep, events) }
        } else {
            self.detector.inspect(sweep, |_| None, events);
            self.watch_encoders(sweep, events);
            self.seek(sweep);
            self.catch_up(events);
        }
    }

    fn end(&mut self, events: &mut Vec<Event>) {
        while !self.waiting.is_empty() {
            self.catch_up(events);
        }
    }

    fn raster(&self) -> Raster {
        self.grid.raster()
    }

    fn map_since(&self, revision: u64) -> Option<(MapChange, u64)> {
        let change = MapChange::Patches(self.grid.cell_m(), self.grid.patches_since(revision));
        Some((change, self.grid.revision()))
    }

    fn states(&self) -> &[SensorState] {
        self.detector.states()
    }

    fn verdict(&self, sensor: usize) -> Verdict {
        match self.associations().get(sensor) {
            _ if !self.detector.is_trusted(sensor) => Verdict::Ignored,
            Some(Association::Wall(_)) => Verdict::Used,
            Some(Association::Unexplained) => Verdict::Unexplained,
            Some(Association::Unused) | None => Verdict::Silent,
        }
    }

    fn fault_evidence(&self, sensor: usize) -> (f64, f64) {
        (self.detector.score(sensor), self.detector.residual_m(sensor))
    }

    fn segments(&self) -> Vec<Segment> {
        self.tracker.as_ref().map(|tracker| tracker.segments().collect()).unwrap_or_default()
    }

    fn reversed_encoders(&self) -> [bool; 2] {
        self.encoders.is_reversed()
    }

    fn calibration(&self) -> Option<Calibration> {
        Some(self.wheels())
    }

    fn saved_state(&self) -> Option<SavedState> {
        let is_astray = self.blind.is_some() || self.lost.as_ref().is_some_and(|lost| lost.blind_m.is_some());
        let tracker = self.tracker.as_ref().filter(|_| !is_astray)?;
        let (walls, inactive) = tracker.landmark_states();
        Some(SavedState {
            filter: tracker.filter.saved_state(),
            walls,
            inactive,
            map: self.grid.saved_state(),
            sensors: self.detector.saved_state(),
        })
    }

    fn nis(&self) -> f64 {
        self.tracker.as_ref().map_or(f64::NAN, EkfSlam::nis)
    }
}

impl WallSlam {
    /// The wheels as learnt so far.
    #[must_use]
    pub(crate) fn wheels(&self) -> Calibration {
        self.tracker.as_ref().map_or(self.wheels, |tracker| tracker.filter.calibration())
    }
}
