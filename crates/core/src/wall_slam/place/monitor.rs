//! Sums the log-likelihood ratio of "the robot is elsewhere" against "it is where the filter believes" along its way: Page's CUSUM. Its
//! last zero dates the onset.
//!
//! Readings of one beam repeat themselves, so a sweep counts by the way since the last one, and no ring counts for more than eight beams.

use super::agreement::{Outcome, outcome};
use super::jump::Hands;
use super::params::Params;
use crate::geometry::{Placement, Pose2};
use crate::mapping::grid::OccupancyGrid;
use crate::sweep::{Beam, Sweep};
use crate::time::Timestamp;

/// The evidence against the believed pose.
#[derive(Clone, Copy, Debug)]
pub(in crate::wall_slam) struct PlaceMonitor {
    sum: f64,
    hands: Option<Hands>,
    /// The last sweep without any evidence.
    onset: (u64, Timestamp),
    /// What was heard since the pose was moved.
    record: Record,
    params: Params,
}

/// What was heard over a way.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::wall_slam) struct Record {
    pub(in crate::wall_slam) way_m: f64,
    heard: f64,
    explained: f64,
    contradicted: f64,
}

/// The map and what a ring can measure.
#[derive(Clone, Copy, Debug)]
pub(in crate::wall_slam) struct Scene<'a> {
    pub(in crate::wall_slam) grid: &'a OccupancyGrid,
    pub(in crate::wall_slam) max_range_m: f64,
    pub(in crate::wall_slam) params: &'a Params,
}

/// What the readings of some beams say of a pose.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Tally {
    /// Sum of the beams' log-likelihood ratios, nats.
    pub(super) sum: f64,
    pub(super) beams: f64,
    pub(super) explained: f64,
    pub(super) contradicted: f64,
    /// Returns among the beams.
    pub(super) heard: f64,
}

impl Scene<'_> {
    /// Adds one reading of a sensor there.
    pub(super) fn add(&self, tally: &mut Tally, map_from_sensor: Pose2, beam: &Beam) {
        if !beam.has_range() && !beam.is_clear() {
            return;
        }
        let range_m = beam.has_range().then_some(beam.range_m);
        let found = outcome(self.grid, map_from_sensor, beam.half_angle_rad, range_m, self.max_range_m, self.params);
        tally.sum += self.params.weights[found as usize];
        tally.beams += 1.0;
        tally.heard += f64::from(u8::from(beam.has_range()));
        match found {
            Outcome::Explained => tally.explained += 1.0,
            Outcome::Unknown => {}
            _ => tally.contradicted += 1.0,
        }
    }

    /// The evidence of a tally gathered over `way_m`, nats.
    pub(super) fn evidence(&self, tally: &Tally, way_m: f64) -> f64 {
        let mean = tally.sum / tally.beams.max(1.0);
        mean * tally.beams.min(self.params.max_beams as f64) * way_m / self.params.independent_m
    }
}

impl PlaceMonitor {
    pub(in crate::wall_slam) fn new(params: &Params) -> Self {
        Self { sum: 0.0, hands: None, onset: (0, Timestamp::default()), record: Record::default(), params: *params }
    }

    /// Hands moved the robot after the sweep `before`.
    pub(in crate::wall_slam) fn jump(&mut self, hands: Hands, before: (u64, Timestamp)) {
        (self.sum, self.hands, self.onset) = (2.0 * self.params.lost, Some(hands), self.onset.min(before));
    }

    /// What hands did to the robot since the sum was last zero.
    pub(in crate::wall_slam) const fn hands(&self) -> Option<Hands> {
        self.hands
    }

    /// Begins anew: the pose was moved.
    pub(in crate::wall_slam) fn reset(&mut self) {
        (self.sum, self.hands, self.record) = (0.0, None, Record::default());
    }

    /// Adds a sweep seen from `pose`, after so much way.
    pub(in crate::wall_slam) fn add(
        &mut self,
        scene: &Scene<'_>,
        sweep: &Sweep,
        pose: Pose2,
        way_m: f64,
        is_trusted: impl Fn(usize) -> bool,
    ) {
        let pose = Placement::from(pose);
        let mut tally = Tally::default();
        // Of a large ring every second or fourth sensor is enough; the others follow in the next sweeps.
        let stride = (sweep.beams.len() / self.params.max_beams).max(1);
        let first = usize::try_from(sweep.index % stride as u64).unwrap_or(0);
        for (sensor, beam) in sweep.beams.iter().enumerate().skip(first).step_by(stride) {
            if is_trusted(sensor) {
                scene.add(&mut tally, pose * beam.robot_from_sensor, beam);
            }
        }
        self.record.add(&tally, way_m);
        let way_m = way_m.min(self.params.max_step_m);
        self.sum = (self.sum + scene.evidence(&tally, way_m) - self.params.leak_per_m * way_m).max(0.0);
        if self.sum <= 0.0 {
            self.hands = None;
            self.onset = (sweep.index, sweep.at);
        }
    }

    /// What was heard since the pose was moved.
    pub(in crate::wall_slam) const fn record(&self) -> &Record {
        &self.record
    }

    /// The last sweep before the evidence began.
    pub(in crate::wall_slam) const fn onset(&self) -> (u64, Timestamp) {
        self.onset
    }

    /// True while so much contradicts that the map is suspended.
    pub(in crate::wall_slam) fn is_suspicious(&self) -> bool {
        self.sum > self.params.suspect
    }

    /// True once a pose that is only tried is wrong.
    pub(in crate::wall_slam) fn is_contradicted(&self) -> bool {
        self.sum > self.params.contradicted
    }

    /// True once the robot is elsewhere.
    pub(in crate::wall_slam) fn is_lost(&self) -> bool {
        self.sum > self.params.lost
    }
}

impl Record {
    pub(super) fn add(&mut self, tally: &Tally, way_m: f64) {
        self.way_m += way_m;
        self.heard += tally.heard;
        self.explained += tally.explained;
        self.contradicted += tally.contradicted;
    }

    /// Share of the returns of which the map tells.
    pub(in crate::wall_slam) fn told(&self) -> f64 {
        (self.explained + self.contradicted) / self.heard.max(1.0)
    }

    /// The explained share of those.
    pub(in crate::wall_slam) fn explained(&self) -> f64 {
        self.explained / (self.explained + self.contradicted).max(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Point;
    use crate::mapping::cone::{ReturnKind, integrate_beam, mark_wall};
    use crate::mapping::grid::WallNormal;
    use std::f64::consts::TAU;

    const HALF_RAD: f64 = 0.2;

    /// A room of 4 by 3 m around the origin, well mapped.
    fn room() -> OccupancyGrid {
        let mut grid = OccupancyGrid::new(0.05);
        for _ in 0..20 {
            for index in 0..24 {
                let pose = Pose2::new(0.0, 0.0, TAU * f64::from(index) / 24.0);
                integrate_beam(&mut grid, pose, HALF_RAD, 1.4, ReturnKind::Nothing);
            }
            for step in -80..=80 {
                let along_m = 0.025 * f64::from(step);
                [-2.02, 2.02].iter().for_each(|&x| mark_wall(&mut grid, Point::new(x, 0.75 * along_m), WallNormal::X));
                [-1.52, 1.52].iter().for_each(|&y| mark_wall(&mut grid, Point::new(along_m, y), WallNormal::Y));
            }
        }
        grid
    }

    /// What eight sensors measure in a room whose walls are so far off: ahead, left, behind, right.
    fn heard(walls_m: [f64; 4]) -> Sweep {
        let beam = |sensor: usize| {
            let bearing_rad = TAU * sensor as f64 / 8.0;
            let range_m = if sensor.is_multiple_of(2) { walls_m[sensor / 2] } else { f64::INFINITY };
            let robot_from_sensor = Pose2::new(0.0, 0.0, bearing_rad);
            Beam { range_m, no_measurement: None, age_s: 0.0, robot_from_sensor, half_angle_rad: HALF_RAD }
        };
        Sweep { beams: (0..8).map(beam).collect(), ..Sweep::default() }
    }

    /// A monitor after a metre in which the robot at the origin hears those walls.
    fn after_a_metre(walls_m: [f64; 4]) -> PlaceMonitor {
        let (grid, params) = (room(), Params::default());
        let scene = Scene { grid: &grid, max_range_m: 3.0, params: &params };
        let mut monitor = PlaceMonitor::new(&params);
        (0..25).for_each(|_| monitor.add(&scene, &heard(walls_m), Pose2::default(), 0.04, |_| true));
        monitor
    }

    #[test]
    fn the_room_it_is_in_agrees_and_another_one_does_not() {
        let here = after_a_metre([2.0, 1.5, 2.0, 1.5]);
        assert!(!here.is_suspicious() && here.record().explained() > 0.9, "{here:?}");
        let elsewhere = after_a_metre([1.2, 2.6, 0.6, 2.4]);
        assert!(elsewhere.is_lost() && elsewhere.record().explained() < 0.1, "{elsewhere:?}");
    }

    #[test]
    fn something_new_before_one_wall_is_not_another_place() {
        let changed = after_a_metre([0.6, 1.5, 2.0, 1.5]);
        assert!(!changed.is_lost() && changed.record().told() > 0.9, "{changed:?}");
    }

    #[test]
    fn a_robot_off_the_map_is_not_lost() {
        let (grid, params) = (OccupancyGrid::new(0.05), Params::default());
        let scene = Scene { grid: &grid, max_range_m: 3.0, params: &params };
        let mut monitor = PlaceMonitor::new(&params);
        monitor.jump(Hands::Carried, (0, Timestamp::default()));
        assert!(monitor.is_lost());
        monitor.reset();
        (0..99).for_each(|_| monitor.add(&scene, &heard([1.0; 4]), Pose2::default(), 0.04, |_| true));
        assert!(!monitor.is_suspicious() && monitor.record().told() < 0.01, "{monitor:?}");
    }
}
