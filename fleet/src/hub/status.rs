//! The hub's output for people and programs: `status.json`, and a summary of each drive.

use crate::name::Name;
use crate::session::SessionId;
use crate::wire::Status;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;

/// `status.json`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SiteStatus {
    /// SHA-256 of `merged.map`.
    pub merged_sha256: String,
    /// Each robot of the fleet file.
    pub robots: BTreeMap<Name, RobotStatus>,
}

/// The status of one robot.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RobotStatus {
    /// True if the robot is connected.
    pub online: bool,
    /// Its newest drive; null before its first status.
    pub session: Option<SessionId>,
    /// Bytes of that drive's capture on the robot.
    pub offered_bytes: u64,
    /// Bytes of that capture on the hub.
    pub fetched_bytes: u64,
    /// Number of complete captures whose poses are written.
    pub whole_captures: u64,
    /// The placement of its map, as text.
    pub place: String,
}

/// `captures/ROBOT/SESSION.json`: the summary of a complete drive.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SessionSummary {
    /// The robot.
    pub robot: Name,
    /// The drive.
    pub session: SessionId,
    /// Bytes of the capture.
    pub bytes: u64,
    /// Its SHA-256.
    pub sha256: String,
    /// Poses of the drive, all of which are in `SESSION.poses.csv`.
    pub poses: usize,
    /// Poses received live. The others were refilled from the capture.
    pub poses_heard: usize,
    /// Sweeps of the drive.
    pub sweeps: usize,
    /// Sweeps received live.
    pub sweeps_heard: usize,
}

impl RobotStatus {
    /// Updates the status with the robot's offer.
    pub fn offered(&mut self, status: &Status) {
        let Some(last) = status.captures.last() else { return };
        if self.session != Some(last.session) {
            (self.session, self.fetched_bytes) = (Some(last.session), 0);
        }
        self.offered_bytes = last.bytes;
    }
}

impl SiteStatus {
    /// As a file.
    #[must_use]
    pub fn to_json(&self) -> Vec<u8> {
        pretty(self)
    }
}

impl SessionSummary {
    /// As a file.
    #[must_use]
    pub fn to_json(&self) -> Vec<u8> {
        pretty(self)
    }
}

impl fmt::Display for SessionSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { robot, session, bytes, poses, poses_heard, sweeps, sweeps_heard, .. } = self;
        let lost = |all: &usize, heard: &usize| all.saturating_sub(*heard);
        write!(
            f,
            "{robot}: session {session} is whole, {bytes} bytes: {poses} poses and {sweeps} sweeps, of which {} and {} were lost on the way and \
             refilled from the capture",
            lost(poses, poses_heard),
            lost(sweeps, sweeps_heard)
        )
    }
}

fn pretty<T: Serialize>(value: &T) -> Vec<u8> {
    let mut text = serde_json::to_vec_pretty(value).expect("numbers and texts");
    text.push(b'\n');
    text
}
