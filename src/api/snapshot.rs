//! One moment of a session, as it is handed to the server.

use slamd_core::event::{Counters, Estimate, FaultEvent, SensorState, Verdict};
use slamd_core::geometry::Ring;
use slamd_core::link::LinkState;
use slamd_core::time::Timestamp;

/// One moment of a session. Filled in place, again and again.
#[derive(Clone, Debug, Default)]
pub struct Snapshot {
    /// Session time.
    pub at: Timestamp,
    /// Microseconds from 1970 to session time zero; none before the session has begun, or without a clock.
    pub unix_zero_us: Option<u64>,
    /// The robot's name.
    pub robot: String,
    /// How the line fares.
    pub link: LinkState,
    /// Why, in words.
    pub cause: String,
    /// The board's name and firmware; empty while unknown.
    pub board: [String; 2],
    /// Its major and minor version of the protocol.
    pub protocol: Option<(u8, u8)>,
    /// Where its sensors sit; empty while unknown.
    pub ring: Ring,
    /// The number of the last sweep.
    pub sweep: Option<u64>,
    /// Its reference instant.
    pub sweep_at: Timestamp,
    /// Its ranges, by sensor, metres or as in REP-117.
    pub ranges_m: Vec<f64>,
    /// What became of them.
    pub verdicts: Vec<Verdict>,
    /// The newest pose.
    pub estimate: Option<Estimate>,
    /// The pose is not to be relied on.
    pub is_lost: bool,
    /// The last change of each sensor's state, by id.
    pub changes: Vec<Option<FaultEvent>>,
    /// What has been counted.
    pub counters: Counters,
}

impl Snapshot {
    /// The sensors that are faulty now.
    pub fn faulty(&self) -> impl Iterator<Item = &FaultEvent> {
        self.changes.iter().flatten().filter(|change| change.state != SensorState::Healthy)
    }
}
