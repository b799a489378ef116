//! A robot that does not know where it is: it gathers what it hears until that fits one place among the walls it knows.

use crate::geometry::Pose2;
use crate::orientation::axis::AxisFinder;
use crate::position::relock::{self, KnownWall, Place};
use crate::sweep::{Beam, Sweep};
use crate::time::Timestamp;

/// A lost robot.
#[derive(Debug)]
pub(super) struct Lost {
    /// From when on its poses are uncertain.
    pub(super) since: Timestamp,
    returns: Vec<(Pose2, Beam)>,
    sweeps: u32,
}

/// A place is sought from so many sweeps on, and then every few.
const FIRST_SWEEPS: u32 = 20;
const EVERY_SWEEPS: u32 = 5;
/// After so many it is given up.
const MOST_SWEEPS: u32 = 300;
/// Older returns than so many say little: the wheels have moved on.
const MOST_RETURNS: usize = 1_000;
/// A direction is believed when its votes gather this much better than the median direction's.
const CONTRAST: f64 = 1.25;

impl Lost {
    pub(super) fn new(since: Timestamp) -> Self {
        Self { since, returns: Vec::with_capacity(MOST_RETURNS), sweeps: 0 }
    }

    /// Keeps what the trusted beams heard, seen from the pose that the wheels alone tell.
    pub(super) fn add(&mut self, pose: Pose2, sweep: &Sweep, is_trusted: impl Fn(usize) -> bool) {
        self.sweeps += 1;
        let excess = (self.returns.len() + sweep.beams.len()).saturating_sub(MOST_RETURNS);
        self.returns.drain(..excess.min(self.returns.len()));
        let heard = sweep.beams.iter().enumerate().filter(|(sensor, beam)| is_trusted(*sensor) && beam.has_range());
        self.returns.extend(heard.map(|(_, beam)| (pose, *beam)));
    }

    /// The place, once it is known.
    pub(super) fn find(&self, finder: &mut AxisFinder, walls: &[KnownWall]) -> Option<Place> {
        if self.sweeps < FIRST_SWEEPS || !self.sweeps.is_multiple_of(EVERY_SWEEPS) {
            return None;
        }
        finder.clear();
        self.returns.iter().for_each(|(pose, beam)| finder.add(*pose, beam));
        let axis = finder.find().filter(|axis| axis.contrast >= CONTRAST)?;
        finder.clear();
        relock::find(&self.returns, walls, axis.angle_rad)
    }

    /// True where seeking on is of no use.
    pub(super) fn is_hopeless(&self) -> bool {
        self.sweeps >= MOST_SWEEPS
    }
}
