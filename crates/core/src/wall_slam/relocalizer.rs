//! A robot that may be elsewhere: what it hears is gathered along the wheels' path until it fits one place among the walls it knew.
//!
//! The filter goes on meanwhile, for the doubt may be wrong; it is moved only where another place explains what is heard distinctly better.

use crate::geometry::Pose2;
use crate::orientation::dominant_directions::{Axis, DominantDirections};
use crate::position::params::Params;
use crate::position::relocalize::{self, KnownWall};
use crate::sweep::{Beam, Sweep};
use crate::time::Timestamp;

/// A robot in doubt.
#[derive(Debug)]
pub(super) struct Relocalizer {
    /// From when on its poses are uncertain.
    pub(super) since: Timestamp,
    /// The first sweep of that time: walls learnt from it on may be wrong.
    pub(super) since_sweep: u64,
    map_from_odom: Pose2,
    returns: Vec<(Pose2, Beam)>,
    sweeps: u32,
    /// How far it may have gone before without knowing, metres; only a robot that could not count its wheel has.
    pub(super) blind_m: Option<f64>,
    /// An encoder has led it astray: it is known to be elsewhere, and must be found.
    must_be_found: bool,
}

/// A place is sought from so many sweeps on, and then every few.
const FIRST_SWEEPS: u32 = 20;
const EVERY_SWEEPS: u32 = 5;
/// After so many it is given up.
const MAX_SWEEPS: u32 = 300;
/// Older returns than so many say little: the wheels have moved on.
const MAX_RETURNS: usize = 1_000;

impl Relocalizer {
    /// The doubt begins, with the robot believed at `pose`.
    pub(super) fn new(since: Timestamp, since_sweep: u64, pose: Pose2, odometry: Pose2) -> Self {
        let map_from_odom = pose * odometry.inverse();
        Self {
            since,
            since_sweep,
            map_from_odom,
            returns: Vec::with_capacity(MAX_RETURNS),
            sweeps: 0,
            blind_m: None,
            must_be_found: false,
        }
    }

    /// The robot has gone up to `way_m` without knowing: it is not where it is believed to be, and is sought for as long as it takes.
    pub(super) fn after_blindness(self, way_m: f64) -> Self {
        Self { blind_m: Some(way_m), must_be_found: true, ..self }
    }

    /// The robot has been put where it must be, which has to be seen first.
    pub(super) fn after_reversal(self) -> Self {
        Self { must_be_found: true, ..self }
    }

    /// Whether the doubt may be wrong: then it is over once what is heard agrees with the map.
    pub(super) fn may_be_wrong(&self) -> bool {
        !self.must_be_found
    }

    /// Keeps what the trusted beams heard, seen from the pose that the wheels alone tell.
    pub(super) fn add(&mut self, sweep: &Sweep, is_trusted: impl Fn(usize) -> bool) {
        self.sweeps += 1;
        let pose = self.map_from_odom * sweep.odometry;
        let excess = (self.returns.len() + sweep.beams.len()).saturating_sub(MAX_RETURNS);
        self.returns.drain(..excess.min(self.returns.len()));
        let heard = sweep.beams.iter().enumerate().filter(|(sensor, beam)| is_trusted(*sensor) && beam.has_range());
        self.returns.extend(heard.map(|(_, beam)| (pose, *beam)));
    }

    /// The pose, once it is known, at the sweep with this odometry.
    pub(super) fn find(
        &self,
        odometry: Pose2,
        finder: &mut DominantDirections,
        params: &Params,
        walls: impl Iterator<Item = KnownWall>,
    ) -> Option<Pose2> {
        if self.sweeps < FIRST_SWEEPS || !self.sweeps.is_multiple_of(EVERY_SWEEPS) {
            return None;
        }
        finder.clear();
        self.returns.iter().for_each(|(pose, beam)| finder.add(*pose, beam));
        let axis = finder.find().filter(Axis::is_believed);
        finder.clear();
        let place = relocalize::find(params, &self.returns, walls, axis?.angle_rad)?;
        Some(place.correction * self.map_from_odom * odometry)
    }

    /// True where seeking on is of no use. After an encoder's fault it never is: the doubt has a reason.
    pub(super) fn is_hopeless(&self) -> bool {
        self.sweeps >= MAX_SWEEPS && !self.must_be_found
    }
}
